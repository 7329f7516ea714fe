"""The folding solve: a growing neo-Hookean brain, step by step from an early week to a
late one."""

import sys
from collections.abc import Sequence
from types import ModuleType


class MPIFirst:
    """Imports dolfinx_solver before the first import of dolfinx or PETSc, whose wheels
    find MPI only then.

    dolfinx_solver is the package of these wheels; conda's dolfinx has none and needs
    none.
    """

    def find_spec(
        self,
        name: str,
        path: Sequence[str] | None,
        target: ModuleType | None = None,
    ) -> None:
        """Import MPI if dolfinx or PETSc is about to be imported, and leave finding it
        to the others."""
        if name not in ("dolfinx", "petsc4py"):
            return
        sys.meta_path.remove(self)
        try:
            import dolfinx_solver  # noqa: F401
        except ModuleNotFoundError as error:
            if error.name != "dolfinx_solver":
                raise


sys.meta_path.insert(0, MPIFirst())
