"""What conjugate gradients do in each iteration, in C and in single precision: half of the memory to read.

A linear solve leaves a thousandth of its right-hand side or more: digits beyond the seventh are of no use to it.
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
                 void restrict_to_parts(long count, void *part, void *arms, void *x, void *of_parts);
                 void add_motions(long count, void *part, void *arms, void *of_parts, void *y);
                 void multiply_blocks(long count, void *blocks, void *x, void *y);"""


@cache
def _library() -> tuple[Any, Any]:
    return compiled(MPI.COMM_SELF, DECLARATION, Path(__file__).with_suffix(".c").read_text())


def _call(function: str, count: int, *arrays: NDArray) -> None:
    interface, code = _library()
    getattr(code, function)(count, *map(interface.from_buffer, arrays))


class SymmetricProducts:
    """The products of a rank's rows of a symmetric matrix that is spread over ranks.

    Of its (b,) blocks, ascending by the owned row `nodes`, with local columns `of_entry` in the map `columns`, there
    are those of owned columns on and above the diagonal, and all others.
    """

    def __init__(self, columns: IndexMap, nodes: Ints, of_entry: NDArray[np.int32]) -> None:
        self._owned = columns.size_local
        self._columns = of_entry.astype(np.int32)
        self._ends = np.searchsorted(nodes, np.arange(self._owned + 1)).astype(np.int32)
        # vectors of four numbers are read at the last block's third row too
        self._blocks = np.zeros(9 * len(nodes) + 1, dtype=np.float32)
        self._x = dolfinx.la.vector(columns, 4, dtype=np.float32)
        self._sums = np.zeros((self._owned, 4), dtype=np.float32)

    def take(self, values: Floats, entries: NDArray[np.int32]) -> None:
        """Take over the blocks, which are the given (b,) entries of (·, 3, 3) values."""
        _call("to_single_blocks", len(entries), entries, values, self._blocks)

    def multiply(self, x: Floats, y: Floats) -> None:
        """Set the owned components y (3 · owned,) to the product with those of x."""
        _call("to_single_vectors", self._owned, x, self._x.array)
        self._x.scatter_forward()
        _call("multiply", self._owned, self._ends, self._columns, self._blocks, self._x.array, self._sums, y)


class PartMotions:
    """Rigid motions of parts, for nodes in the (k,) `part`s at (k, 3) `arms` from these parts' centres."""

    def __init__(self, part: Ints, arms: NDArray[np.float32]) -> None:
        self._part, self._arms = part.astype(np.int32), arms

    def restrict(self, x: Floats, parts: int) -> Floats:
        """Return the forces and torques (6 · parts,) on the parts from the forces (3 · k,) on the nodes."""
        of_parts = np.zeros(6 * parts)
        _call("restrict_to_parts", len(self._part), self._part, self._arms, x, of_parts)
        return of_parts

    def add(self, of_parts: Floats, y: Floats) -> None:
        """Add translations and rotations (6 · parts,) of the parts to the displacements (3 · k,) of the nodes."""
        _call("add_motions", len(self._part), self._part, self._arms, of_parts, y)


def multiply_blocks(blocks: NDArray[np.float32], x: Floats, y: Floats) -> None:
    """Set y (3 · k,) to the products of (k, 3, 3) blocks with x."""
    _call("multiply_blocks", len(blocks), blocks, x, y)
