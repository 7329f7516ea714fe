"""MeshLab's filters, loaded so that PETSc can be used in the same process."""

from petsc4py.lib import ImportPETSc

# Loaded, not initialised, which would start MPI. The wheel of pymeshlab brings libraries such as OpenSSL under the
# names of the system's; where they come first, those that PETSc needs cannot be loaded any more.
ImportPETSc()

import pymeshlab  # noqa: E402

__all__ = ["pymeshlab"]
