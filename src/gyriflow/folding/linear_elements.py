"""Energy, forces and stiffness of linear elements, two to four times as fast as code by
FFCx."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from dolfinx.la import MatrixCSR
from numpy.typing import NDArray
from scipy import sparse

from ..geometry.triangles import Floats
from ..mechanics.materials import Material, energy_code
from .compilation import compiled, pointer
from .domain import Domain

DECLARATION = """
double assemble(long count, double bulk_to_shear, void *cells, void *X, void *u,
                void *H, void *weight, void *range, void *forces, void *places,
                void *blocks);
"""


@dataclass(frozen=True)
class ElementTotals:
    """Energy in J of a rank's elements, and the smallest and largest det F among them,
    NaN if any is."""

    energy: float
    smallest: float
    largest: float


class LinearElements:
    """The local elements of a domain.

    Attributes set by the user: the `weight` (c, 1) in Pa and the tensor `H` (c, 1, 3,
    3) of the step's energy (`NonlinearProblem.set_step`).
    """

    def __init__(self, domain: Domain, material: Material) -> None:
        self._domain = domain
        self._bulk_to_shear = material.bulk_to_shear_ratio
        elements = Path(__file__).with_suffix(".c").read_text(encoding="utf-8")
        code = energy_code(material) + elements
        self._interface, self._code = compiled(domain.comm, DECLARATION, code)
        self._places: NDArray[np.int32] | None = None
        self.weight: Floats
        self.H: Floats

    def assemble(
        self,
        u: Floats,
        forces: Floats | None = None,
        matrix: MatrixCSR | None = None,
    ) -> ElementTotals:
        """Return the totals at displacements u (k, 3) in m; add to the given forces in
        N and matrix in N/m.

        Blocks of the stiffness below the diagonal between owned nodes are omitted.
        """
        cells = self._domain.cells
        nodes = self._domain.nodes
        volume_range = np.empty(2)
        count = len(cells)
        values = None
        places = None
        n_values = 0
        if matrix is not None:
            if self._places is None:
                self._places = self._places_in(matrix)
            places = self._places
            values = matrix.data
            n_values = 9 * len(matrix.indices)
        pointers = [
            self._pointer(cells, np.int32, 4 * count),
            self._pointer(nodes, np.float64, nodes.size),
            self._pointer(u, np.float64, nodes.size),
            self._pointer(self.H, np.float64, 9 * count),
            self._pointer(self.weight, np.float64, count),
            self._pointer(volume_range, np.float64, 2, is_written=True),
            self._pointer(
                forces,
                np.float64,
                nodes.size,
                is_written=True,
            ),
            self._pointer(places, np.int32, 16 * count),
            self._pointer(values, np.float64, n_values, is_written=True),
        ]
        energy = self._code.assemble(count, self._bulk_to_shear, *pointers)
        return ElementTotals(float(energy), *volume_range.tolist())

    def _places_in(self, matrix: MatrixCSR) -> NDArray[np.int32]:
        """Return the (16 c,) numbers in a matrix of the blocks of elements' pairs of
        nodes, -1 for those that are omitted."""
        numbers = np.arange(
            len(matrix.indices),
            dtype=np.int32,
        )
        places = sparse.csr_array(
            (
                numbers,
                matrix.indices,
                matrix.indptr,
            )
        )
        cells = self._domain.cells
        rows = np.repeat(cells, 4, axis=1).ravel()
        columns = np.tile(cells, 4).ravel()
        # blocks below the diagonal are needed only if one of their nodes is a ghost
        n_owned = self._domain.n_owned
        is_below = columns < rows
        is_owned = (columns < n_owned) & (rows < n_owned)
        found = places[rows, columns]
        found[is_below & is_owned] = -1
        return found

    def _pointer(
        self,
        array: NDArray | None,
        dtype: type,
        size: int,
        *,
        is_written: bool = False,
    ) -> Any:
        if array is None:
            return self._interface.NULL
        return pointer(self._interface, array, dtype, size, is_written=is_written)
