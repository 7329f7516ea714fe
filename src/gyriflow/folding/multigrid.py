"""Multigrid by order: the corners' unknowns as the coarse level of quadratic elements, and algebraic multigrid below.

Algebraic multigrid is made for linear elements, whose stiffness is what is left of that of quadratic ones where the
nodes on edges follow their ends: Galerkin's coarse matrix PᵀAP. Displacements of the coarse level are continuous and
linear in each (curved) element, so that rigid motions are there too.
"""

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from ..geometry.jacobians import EDGES
from .domain import Domain


class OrderHierarchy:
    """The two upper levels of multigrid for quadratic elements; parameters as of `linear_in_quadratic`."""

    def __init__(self, domain: Domain, fixed: NDArray[np.bool_]) -> None:
        self._prolongation, self._corners = linear_in_quadratic(domain, fixed)

    def attach(self, multigrid: PETSc.PC) -> None:
        """Makes a preconditioner multigrid of two levels, whose coarse one is solved by algebraic multigrid."""
        multigrid.setType("mg")
        multigrid.setMGLevels(2)
        multigrid.setMGInterpolation(1, self._prolongation)

    def renew(self, multigrid: PETSc.PC, matrix: PETSc.Mat) -> None:
        """Gives a preconditioner that is to be set up the coarse level of a matrix, with its near-null space."""
        coarse = matrix.ptap(self._prolongation)
        coarse.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        vectors: list[PETSc.Vec] = []
        for mode in matrix.getNearNullSpace().getVecs():
            vector = coarse.createVecRight()
            vector.array[:] = mode.array_r.reshape(-1, 3)[self._corners].ravel()
            for other in vectors:
                vector.axpy(-vector.dot(other), other)
            vector.normalize()
            vectors.append(vector)
        coarse.setNearNullSpace(PETSc.NullSpace().create(vectors=vectors, comm=matrix.comm))
        multigrid.getMGCoarseSolve().setOperators(coarse, coarse)
        # the solver holds them now
        for held in (coarse, *vectors):
            held.destroy()


def linear_in_quadratic(domain: Domain, fixed: NDArray[np.bool_]) -> tuple[PETSc.Mat, NDArray[np.int64]]:
    """Returns the prolongation from corners to all nodes, 3 unknowns each, and the local nodes of the owned corners.

    `fixed` (owned, 3) are the components of the owned nodes whose rows and columns are those of the unit matrix: they
    stay apart from others.
    """
    comm, owned = domain.comm, domain.owned
    everywhere = np.concatenate(comm.allgather(fixed))
    # by global nodes, which all ranks agree on; the ends of a node are itself where it is a corner
    first = sum(comm.allgather(owned)[: comm.rank])
    number = domain.node_of_vertex[domain.vertex_of_node]
    ends = np.full((len(number), 2), -1, dtype=np.int64)
    for middle, edge in enumerate(EDGES):
        ends[domain.cells[:, 4 + middle]] = number[domain.cells[:, edge]]
    corner = ends[:, 0] < 0
    ends[corner] = number[corner, None]
    corners = np.flatnonzero(corner[:owned])
    counts = comm.allgather(len(corners))
    names = np.concatenate(comm.allgather(first + corners))  # global nodes by their number among the corners
    place = np.full(len(everywhere), -1, dtype=np.int64)
    place[names] = np.arange(len(names))

    own_ends, own_corner = ends[:owned], corner[:owned]
    columns = np.sort(place[own_ends], axis=1)
    weights = np.full((owned, 3, 2), 0.5)
    held = everywhere[names[columns]].transpose(0, 2, 1)
    # a fixed node moves with none, and none moves with a fixed corner but itself
    weights[held | fixed[:, :, None]] = 0.0
    weights[own_corner] = [1.0, 0.0]
    kept = np.broadcast_to(np.stack([np.ones(owned, bool), ~own_corner], axis=1)[:, None, :], weights.shape)
    entries = 3 * columns[:, None, :] + np.arange(3)[None, :, None]
    start = np.concatenate([[0], np.cumsum(kept.sum(axis=2).ravel())]).astype(PETSc.IntType)
    size = ((3 * owned, 3 * len(everywhere)), (3 * len(corners), 3 * sum(counts)))
    prolongation = PETSc.Mat().createAIJ(
        size, bsize=3, csr=(start, entries[kept].astype(PETSc.IntType), weights[kept]), comm=comm
    )
    return prolongation, corners
