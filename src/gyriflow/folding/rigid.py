"""Rigid motions of the parts of a mesh: the linear solver's coarse level, and removed from unconstrained bodies."""

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc

from ..geometry.triangles import Floats
from .domain import Domain

Ints = NDArray[np.int64]


def rigid_motions(positions: Floats, part: Ints) -> Floats:
    """Returns the (n, 3, 6) translations and rotations of points, each about the centre of its part.

    Parameters
    ----------
    positions : (n, 3) float
        Where the points are.
    part : (n,) int
        Number of the part that each belongs to. Rotations are scaled by the size of the largest part.
    """
    counts = np.bincount(part)
    centres = np.stack([np.bincount(part, weights=x) for x in positions.T], axis=1) / np.maximum(counts, 1)[:, None]
    arm = positions - centres[part]
    arm /= np.abs(arm).max()
    motions = np.zeros((len(positions), 3, 6))
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        motions[:, i, i] = 1.0
        motions[:, j, 3 + i], motions[:, k, 3 + i] = -arm[:, k], arm[:, j]
    return motions


class RigidMotions:
    """The translations and rotations, orthonormal, of the parts of the present mesh that vertices belong to by (n,)
    numbers."""

    def __init__(self, domain: Domain, part: Ints) -> None:
        self.comm = domain.comm
        motions = rigid_motions(domain.positions, part)
        modes = []
        for number in range(int(part.max()) + 1):
            whole = np.where((part == number)[:, None, None], motions, 0.0)
            orthonormal = np.linalg.qr(whole.reshape(-1, 6))[0].reshape(-1, 3, 6)
            modes.append(orthonormal[domain.vertex_of_node[: domain.owned]])
        self.modes: Floats = np.concatenate(modes, axis=2).reshape(3 * domain.owned, -1)

    def remove(self, values: Floats) -> None:
        """Takes the rigid motions out of the owned components of a vector, in place."""
        amounts = self.comm.allreduce(self.modes.T @ values, op=MPI.SUM)
        values -= self.modes @ amounts

    def null_space(self, like: PETSc.Vec) -> PETSc.NullSpace:
        """Returns the motions as PETSc vectors of the layout of `like`."""
        vectors = []
        for mode in self.modes.T:
            vector = like.duplicate()
            vector.array[:] = mode
            vectors.append(vector)
        return PETSc.NullSpace().create(vectors=vectors, comm=self.comm)
