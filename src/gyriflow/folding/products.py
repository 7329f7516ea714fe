"""Products in each iteration of conjugate gradients, in C and single precision, which halves the memory traffic.

A linear solve leaves at least a thousandth of its right-hand side, so that seven digits are enough.
"""

from functools import cache
from pathlib import Path
from typing import Any

import dolfinx
import numpy as np
from dolfinx.common import IndexMap
from mpi4py import MPI
from numpy.typing import NDArray

from ..geometry.triangles import Floats, Ints
from .compilation import compiled

DECLARATION = """void to_single_blocks(long count, void *entries, void *values, void *blocks);
                 void to_single_vectors(long count, void *x, void *single);
                 void multiply(long owned, void *ends, void *columns, void *blocks, void *x, void *sums, void *y);
                 void restrict_to_parts(long count, void *part, void *arms, void *x, void *loads);
                 void add_motions(long count, void *part, void *arms, void *motions, void *y);
                 void multiply_blocks(long count, void *blocks, void *x, void *y);"""


@cache
def _library() -> tuple[Any, Any]:
    return compiled(MPI.COMM_SELF, DECLARATION, Path(__file__).with_suffix(".c").read_text())


def _call(function: str, count: int, *arrays: NDArray) -> None:
    interface, code = _library()
    getattr(code, function)(count, *map(interface.from_buffer, arrays))


class SymmetricProducts:
    """Products of a rank's rows of a symmetric matrix that is distributed over the ranks.

    Its (b,) blocks are ascending by their row `nodes`, with local `columns` in the map `column_map`: those of owned
    columns on and above the diagonal, and all of ghost columns.
    """

    def __init__(self, column_map: IndexMap, nodes: Ints, columns: NDArray[np.int32]) -> None:
        self._owned = column_map.size_local
        self._columns = columns.astype(np.int32)
        self._ends = np.searchsorted(nodes, np.arange(self._owned + 1)).astype(np.int32)
        # the C code reads vectors of four numbers, also at the last row of the last block
        self._blocks = np.zeros(9 * len(nodes) + 1, dtype=np.float32)
        self._x = dolfinx.la.vector(column_map, 4, dtype=np.float32)
        self._sums = np.zeros((self._owned, 4), dtype=np.float32)

    def take(self, values: Floats, entries: NDArray[np.int32]) -> None:
        """Set the blocks to the given (b,) entries of (·, 3, 3) values."""
        _call("to_single_blocks", len(entries), entries, values, self._blocks)

    def multiply(self, x: Floats, y: Floats) -> None:
        """Set y (3 · n_owned,) to the product with x, both owned components."""
        _call("to_single_vectors", self._owned, x, self._x.array)
        self._x.scatter_forward()
        _call("multiply", self._owned, self._ends, self._columns, self._blocks, self._x.array, self._sums, y)


class PartMotions:
    """Rigid motions of parts, for nodes in the (k,) `part`s at (k, 3) `arms` from the parts' centres."""

    def __init__(self, part: Ints, arms: NDArray[np.float32]) -> None:
        self._part, self._arms = part.astype(np.int32), arms

    def restrict(self, x: Floats, parts: int) -> Floats:
        """Return the forces and torques (6 · parts,) on the parts from the forces (3 · k,) on the nodes."""
        loads = np.zeros(6 * parts)
        _call("restrict_to_parts", len(self._part), self._part, self._arms, x, loads)
        return loads

    def add(self, motions: Floats, y: Floats) -> None:
        """Add translations and rotations (6 · parts,) of the parts to the displacements (3 · k,) of the nodes."""
        _call("add_motions", len(self._part), self._part, self._arms, motions, y)


def multiply_blocks(blocks: NDArray[np.float32], x: Floats, y: Floats) -> None:
    """Set y (3 · k,) to the products of (k, 3, 3) blocks with x."""
    _call("multiply_blocks", len(blocks), blocks, x, y)
