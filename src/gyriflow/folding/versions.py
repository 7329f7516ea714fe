"""What differs between versions of dolfinx (0.9 to 0.11) and of the PETSc that comes with them, in one place."""

import os

import dolfinx
import ufl
from mpi4py import MPI
from numpy.typing import NDArray

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
