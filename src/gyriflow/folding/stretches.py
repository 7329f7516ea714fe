"""Stretches and rotations of a mesh's elements under a displacement, and its matrix of diffusion, in C code."""

from pathlib import Path

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from scipy import sparse
from scipy.spatial.transform import Rotation

from ..geometry.diffusion import ALONE, Share
from ..geometry.triangles import Floats, Ints
from .compilation import compiled
from .stress import packed

MAX_STRAIN = 0.3
"""Largest principal Hencky strain of a displacement; larger ones are clipped."""
MAX_SERIES_NORM = 0.12
"""Largest row sum of |FᵀF − I|, a bound of its eigenvalues, for which the logarithm is computed by its series."""
PAIRS = ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3))
"""Corners of an element's edges, in the order of the pairs in the C code."""
DECLARATION = """void stretch(long count, double small, void *tets, void *X, void *x,
                              void *sums, void *pairs, void *gradients, void *large);
void rotation(long count, void *tets, void *X, void *x, void *sums);"""


class Stretches:
    """Stretches and stiffness of (m, 4) tetrahedra between n vertices that move.

    The sparsity pattern of the stiffness is computed once, which takes longer than the rest. Processes that `share` the
    elements each compute with some of the `tets`; all get the whole result.
    """

    def __init__(self, tets: Ints, count: int, share: Share = ALONE) -> None:
        self._interface, self._code = compiled(MPI.COMM_SELF, DECLARATION, Path(__file__).with_suffix(".c").read_text())
        self.tets = np.ascontiguousarray(tets[share.of(len(tets))], dtype=np.int64)
        self.share, self._count = share, count
        numbers = np.unique(_edge_numbers(tets, count))
        self._edge = np.searchsorted(numbers, _edge_numbers(self.tets, count).ravel()).astype(np.int32)
        self._ends = np.divmod(numbers, count)
        vertices = np.arange(count)
        rows, columns = (np.concatenate([*ends, vertices]) for ends in (self._ends, self._ends[::-1]))
        self._pattern = sparse.coo_matrix((np.arange(len(rows)), (rows, columns))).tocsr()

    def compute(self, positions: Floats, displacement: Floats) -> tuple[Floats, Floats, sparse.csr_matrix]:
        """Return volume-weighted sums of ln U (n, 6), volumes (n,), and the (n, n) stiffness matrix.

        Positions and displacement are (n, 3) in mm. Each element counts at each of its corners with a quarter of its
        volume.
        """
        count, elements = self._count, len(self.tets)
        sums, pairs = np.zeros((count, 7)), np.empty((elements, len(PAIRS)))
        gradients, large = np.empty((elements, 3, 3)), np.empty(elements, dtype=np.uint8)
        both = (np.ascontiguousarray(x, dtype=float) for x in (positions, positions + displacement))
        arrays = self.tets, *both, sums, pairs, gradients, large
        self._code.stretch(elements, MAX_SERIES_NORM, *map(self._interface.from_buffer, arrays))
        corners = self.tets[large > 0]
        edges = positions[corners[:, 1:]] - positions[corners[:, :1]]
        logs = packed(log_stretch(gradients[large > 0])) * np.linalg.det(edges)[:, None] / 24
        np.add.at(sums[:, :6], corners, logs[:, None])
        edge_sums = np.bincount(self._edge, pairs.ravel(), minlength=len(self._ends[0]))
        totals = self.share.summed(np.concatenate([sums.ravel(), edge_sums]))
        sums, off_diagonal = totals[: 7 * count].reshape(count, 7), totals[7 * count :]
        # rows sum to zero
        diagonal = -sum(np.bincount(ends, off_diagonal, minlength=count) for ends in self._ends)
        entries = np.concatenate([off_diagonal, off_diagonal, diagonal])[self._pattern.data]
        matrix = sparse.csr_matrix((entries, self._pattern.indices, self._pattern.indptr), shape=(count, count))
        return sums[:, :6], sums[:, 6], matrix

    def rotations(self, positions: Floats, displacement: Floats) -> Rotation:
        """Return the n rotations of the tissue at the vertices, means of the elements around them.

        Positions and displacement are (n, 3) in mm. Shear must be small, as in a time step.
        """
        own = np.zeros((self._count, 4))
        both = (np.ascontiguousarray(x, dtype=float) for x in (positions, positions + displacement))
        self._code.rotation(len(self.tets), *map(self._interface.from_buffer, (self.tets, *both, own)))
        sums = self.share.summed(own)
        # the axial vector of a rotation has the length of its sine
        axial = sums[:, :3] / np.where(sums[:, 3:] > 0, sums[:, 3:], 1.0)
        sine = np.minimum(np.linalg.norm(axial, axis=1, keepdims=True), 1.0)
        return Rotation.from_rotvec(axial * np.where(sine > 0, np.arcsin(sine) / np.where(sine > 0, sine, 1.0), 1.0))


def log_stretch(F: NDArray[np.floating]) -> Floats:
    """Return the (..., 3, 3) logarithms ln U of the right stretch of gradients, eigenvalues clipped to `MAX_STRAIN`."""
    values, axes = np.linalg.eigh(np.swapaxes(F, -1, -2) @ F)
    stretches = np.clip(0.5 * np.log(np.maximum(values, 1e-12)), -MAX_STRAIN, MAX_STRAIN)
    return np.asarray((axes * stretches[..., None, :]) @ np.swapaxes(axes, -1, -2))


def _edge_numbers(tets: Ints, count: int) -> Ints:
    first, second = (tets[:, corners] for corners in np.transpose(PAIRS))
    return np.minimum(first, second) * count + np.maximum(first, second)
