"""Products in each iteration of conjugate gradients, in C and single precision, which
halves the memory traffic.

A linear solve leaves at least a thousandth of its right-hand side, so that seven digits
are enough.
"""

import dolfinx
import numpy as np
from dolfinx.common import IndexMap
from numpy.typing import NDArray

from ..geometry.triangles import Floats, Ints
from .compilation import library_of, pointer

DECLARATION = """
void to_single_blocks(long count, void *entries, void *values, void *blocks);
void to_single_vectors(long count, void *x, void *single);
void multiply(long owned, void *ends, void *columns, void *blocks, void *x, void *sums,
              void *y);
void restrict_to_parts(long count, void *part, void *arms, void *x, void *loads);
void add_motions(long count, void *part, void *arms, void *motions, void *y);
void multiply_blocks(long count, void *blocks, void *x, void *y);
"""


def _call(
    function: str,
    count: int,
    *arrays: tuple[NDArray, type, int],
    written: NDArray,
) -> None:
    """Call a function with arrays, the type of each and the least number of its values;
    one of them is `written`."""
    interface, code = library_of(__file__, DECLARATION)
    pointers = []
    for array, dtype, size in arrays:
        pointers.append(
            pointer(interface, array, dtype, size, is_written=array is written)
        )
    getattr(code, function)(count, *pointers)


class SymmetricProducts:
    """Products of a rank's rows of a symmetric matrix that is distributed over the
    ranks.

    Its (b,) blocks are ascending by their row `nodes`, with local `columns` in the map
    `column_map`: those of owned columns on and above the diagonal, and all of ghost
    columns.
    """

    def __init__(
        self,
        column_map: IndexMap,
        nodes: Ints,
        columns: NDArray[np.int32],
    ) -> None:
        self._owned = column_map.size_local
        self._columns = columns.astype(np.int32)
        ends = np.searchsorted(
            nodes,
            np.arange(self._owned + 1),
        )
        self._ends = ends.astype(np.int32)
        # the C code reads vectors of four numbers, also at the last row of the last
        # block
        self._blocks = np.zeros(
            9 * len(nodes) + 1,
            dtype=np.float32,
        )
        self._x = dolfinx.la.vector(
            column_map,
            4,
            dtype=np.float32,
        )
        self._sums = np.zeros(
            (self._owned, 4),
            dtype=np.float32,
        )

    def take(self, values: Floats, entries: NDArray[np.int32]) -> None:
        """Set the blocks to the given (b,) entries of (·, 3, 3) values."""
        count = len(entries)
        _call(
            "to_single_blocks",
            count,
            (entries, np.int32, count),
            (values, np.float64, 9 * count),
            (self._blocks, np.float32, 9 * count + 1),
            written=self._blocks,
        )

    def multiply(self, x: Floats, y: Floats) -> None:
        """Set y (3 · n_owned,) to the product with x, both owned components."""
        owned, ghosted = self._owned, self._x.array
        _call(
            "to_single_vectors",
            owned,
            (x, np.float64, 3 * owned),
            (ghosted, np.float32, 4 * owned),
            written=ghosted,
        )
        self._x.scatter_forward()
        _call(
            "multiply",
            owned,
            (self._ends, np.int32, owned + 1),
            (self._columns, np.int32, 0),
            (
                self._blocks,
                np.float32,
                9 * len(self._columns) + 1,
            ),
            (ghosted, np.float32, 4 * owned),
            (self._sums, np.float32, 4 * owned),
            (y, np.float64, 3 * owned),
            written=y,
        )


class PartMotions:
    """Rigid motions of parts, for nodes in the (k,) `part`s at (k, 3) `arms` from the
    parts' centres."""

    def __init__(self, part: Ints, arms: NDArray[np.float32]) -> None:
        self._part, self._arms = part.astype(np.int32), arms

    def restrict(self, x: Floats, parts: int) -> Floats:
        """Return the forces and torques (6 · parts,) on the parts from the forces (3 ·
        k,) on the nodes."""
        loads = np.zeros(6 * parts)
        count = len(self._part)
        _call(
            "restrict_to_parts",
            count,
            (self._part, np.int32, count),
            (self._arms, np.float32, 3 * count),
            (x, np.float64, 3 * count),
            (loads, np.float64, 6 * parts),
            written=loads,
        )
        return loads

    def add(self, motions: Floats, y: Floats) -> None:
        """Add translations and rotations (6 · parts,) of the parts to the displacements
        (3 · k,) of the nodes."""
        count = len(self._part)
        _call(
            "add_motions",
            count,
            (self._part, np.int32, count),
            (self._arms, np.float32, 3 * count),
            (motions, np.float64, 0),
            (y, np.float64, 3 * count),
            written=y,
        )


def multiply_blocks(
    blocks: NDArray[np.float32],
    x: Floats,
    y: Floats,
) -> None:
    """Set y (3 · k,) to the products of (k, 3, 3) blocks with x."""
    count = len(blocks)
    _call(
        "multiply_blocks",
        count,
        (blocks, np.float32, 9 * count),
        (x, np.float64, 3 * count),
        (y, np.float64, 3 * count),
        written=y,
    )
