"""Rigid motions of the parts of a mesh: for multigrid's coarse spaces, and removed from unconstrained bodies."""

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc

from .domain import Domain

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class RigidMotions:
    """The translations and rotations, orthonormal, of the parts of the present mesh that vertices belong to by (n,)
    numbers."""

    def __init__(self, domain: Domain, part: Ints) -> None:
        self.comm = domain.comm
        x = domain.positions
        modes = []
        for number in range(int(part.max()) + 1):
            inside = np.flatnonzero(part == number)
            arm = x[inside] - x[inside].mean(axis=0)
            motions = np.zeros((len(inside), 3, 6))
            for i in range(3):
                j, k = (i + 1) % 3, (i + 2) % 3
                motions[:, i, i] = 1.0
                motions[:, j, 3 + i], motions[:, k, 3 + i] = -arm[:, k], arm[:, j]
            whole = np.zeros((len(x), 3, 6))
            whole[inside] = np.linalg.qr(motions.reshape(-1, 6))[0].reshape(-1, 3, 6)
            modes.append(whole[domain.vertex_of_node[: domain.owned]])
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
