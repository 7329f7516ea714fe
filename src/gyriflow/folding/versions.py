"""What differs between versions of dolfinx (0.9 to 0.11) and of the PETSc that comes with them, in one place."""

import os
from functools import cache

import dolfinx
import numpy as np
import ufl
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc

# read by Scotch when it first shares out a mesh: else a run would not give the same numbers twice
for name in ("SCOTCH_RANDOM_FIXED_SEED", "SCOTCH_DETERMINISTIC", "SCOTCH_PTHREAD_NUMBER"):
    os.environ.setdefault(name, "1")


def create_mesh(
    comm: MPI.Comm, cells: NDArray, points: NDArray, element: ufl.AbstractFiniteElement
) -> dolfinx.mesh.Mesh:
    """Returns a distributed mesh from cells and points, which one rank or several give."""
    # by keywords, whose order changed between versions; without ghost cells, the default in all of them
    return dolfinx.mesh.create_mesh(comm, cells=cells, x=points, e=ufl.Mesh(element))


def geometry_nodes(mesh: dolfinx.mesh.Mesh) -> NDArray:
    """Returns the (c, k) nodes of the geometry of a mesh that each local cell has."""
    by_cell_type = getattr(mesh.geometry, "dofmaps", None)
    # a list of one array for each type of cell from 0.11 on, where `dofmap` is on its way out
    return by_cell_type[0] if isinstance(by_cell_type, list) else mesh.geometry.dofmap


@cache
def keeps_old_inverses() -> bool:
    """Returns whether PETSc goes on using the inverse of a matrix's block diagonal when its values have changed.

    PETSc 3.22 does not, 3.25 does: Jacobi's smoother then stays that of the first values, even in a new solver, and
    conjugate gradients fail with it. A matrix of other values has to be another object there.
    """
    matrix = PETSc.Mat().createAIJ(((3, 3), (3, 3)), bsize=3, nnz=3, comm=PETSc.COMM_SELF)
    found = []
    for scale in (1.0, 2.0):
        matrix.setValuesBlocked([0], [0], scale * np.eye(3))
        matrix.assemble()
        found.append(float(matrix.invertBlockDiagonal()[0, 0, 0]))
    matrix.destroy()
    return found[0] == found[1]
