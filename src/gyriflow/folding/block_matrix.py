"""Matrices of 3 × 3 blocks, filled by dolfinx and handed to PETSc.

dolfinx fills its own block matrices about twice as fast as PETSc's, and PETSc takes all values over in one call with a
place for each worked out once (its coordinate format, which petsc4py 3.22 does not offer yet). That gives the matrix
that multigrid is built on. Products go to a second one, the blocks on and above the diagonal: a third of the memory
to read, three fifths of the time.
"""

import ctypes

import numpy as np
from dolfinx.la import MatrixCSR
from numpy.typing import NDArray
from petsc4py import PETSc

from .versions import keeps_old_inverses

# PETSc itself, through the library that is linked with it
_PETSC = ctypes.CDLL(PETSc.__file__)
_INSERT = int(PETSc.InsertMode.INSERT_VALUES)


def _check(code: int) -> None:
    if code:
        raise PETSc.Error(code)


class BlockMatrix:
    """A square matrix with the same entries for dolfinx and for PETSc: 3 × 3 blocks, one block row for each local node.

    `fixed` (owned, 3) are the components of the owned nodes whose rows and columns are those of the unit matrix.
    """

    def __init__(self, blocks: MatrixCSR, fixed: NDArray[np.bool_]) -> None:
        self.blocks = blocks
        row_map, column_map = blocks.index_map(0), blocks.index_map(1)
        owned = row_map.size_local
        rows = np.repeat(np.arange(owned, dtype=np.int32), np.diff(blocks.indptr[: owned + 1]))
        columns = blocks.indices[: len(rows)]
        self._row_ends = blocks.indptr[: owned + 1].astype(PETSc.IntType)
        self._columns = column_map.local_to_global(columns).astype(PETSc.IntType)
        first, second = np.divmod(np.arange(9), 3)
        i = (3 * row_map.local_to_global(rows)[:, None] + first).ravel().astype(PETSc.IntType)
        j = (3 * self._columns[:, None] + second).ravel().astype(PETSc.IntType)
        self._entries = len(i)
        self._products: PETSc.Mat | None = None
        self._handed: PETSc.Mat | None = None  # what was returned last, where it is not the matrix itself
        # by global numbers, since the columns reach nodes that no local element has
        everywhere = np.concatenate(row_map.comm.allgather(fixed))
        across = everywhere[self._columns]
        crossed = fixed[rows][:, :, None] | across[:, None, :]
        self._crossed = np.flatnonzero(crossed.ravel())
        diagonal = (rows == columns)[:, None, None] & (fixed[rows][:, :, None] & np.eye(3, dtype=bool))
        self._fixed_diagonal = np.flatnonzero(diagonal.ravel())
        self._matrix = PETSc.Mat().create(row_map.comm)
        size = (3 * owned, 3 * row_map.size_global)
        self._matrix.setSizes((size, size), bsize=3)
        self._matrix.setType("aij")
        _check(
            _PETSC.MatSetPreallocationCOO(
                ctypes.c_void_p(self._matrix.handle),
                ctypes.c_ssize_t(len(i)),
                i.ctypes.data_as(ctypes.c_void_p),
                j.ctypes.data_as(ctypes.c_void_p),
            )
        )
        self._matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)

    def assembled(self) -> PETSc.Mat:
        """Returns the PETSc matrix with the present values of the blocks, contributions to ghost rows added."""
        self.blocks.scatter_reverse()
        values = self.blocks.data[: self._entries]
        values[self._crossed] = 0.0
        values[self._fixed_diagonal] = 1.0
        _check(
            _PETSC.MatSetValuesCOO(
                ctypes.c_void_p(self._matrix.handle), values.ctypes.data_as(ctypes.c_void_p), ctypes.c_int(_INSERT)
            )
        )
        self._matrix.stateIncrease()
        if not keeps_old_inverses():
            return self._matrix
        if self._handed is not None:
            self._handed.destroy()  # solvers that use it hold it
        self._handed = self._matrix.copy()
        self._handed.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        return self._handed

    def for_products(self) -> PETSc.Mat:
        """Returns the PETSc matrix of the same values for products, which holds one of its two triangles."""
        if self._products is None:
            self._products = self._matrix.convert("sbaij", out=PETSc.Mat())
            self._products.setOption(PETSc.Mat.Option.IGNORE_LOWER_TRIANGULAR, True)
        self._products.setValuesBlockedIJV(self._row_ends, self._columns, self.blocks.data[: self._entries])
        self._products.assemble()
        return self._products
