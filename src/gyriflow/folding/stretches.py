"""How the elements of a mesh are stretched by a displacement, and how stiff they are to what diffuses, by C code."""

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from scipy import sparse

from ..geometry.diffusion import ALONE, Share
from ..geometry.triangles import Floats, Ints
from .compilation import compiled
from .stress import packed

MOST_STRAIN = 0.3
"""Largest logarithmic growth in any direction in a step: more belongs to elements that the target folds over."""
SMALL = 0.12
"""Largest entry of FᵀF − 1 for which the logarithm is taken by its series."""
PAIRS = ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3))
"""Corners of an element's edges, in the order of the code's pairs."""
DECLARATION = """void stretch(long count, double small, void *tets, void *X, void *x,
                              void *sums, void *pairs, void *gradients, void *large);"""
"""Of `count` elements between vertices at X before and x after: adds V/4 ln U (xx yy zz xy xz yz) and V/4 to the `sums`
(·, 7) of their corners, and sets their F in `gradients` (·, 3, 3) and V ∇Nᵢ·∇Nⱼ in `pairs` (·, 6). Six terms of the
series of ln(1 + x) give the logarithm to 3e-8. Where an entry of FᵀF − 1 is not `small`, it is left out and `large`
(·,) is set to 1."""
CODE = """
#include <math.h>
#include <stdint.h>
#define EACH(i, n) for (int i = 0; i < n; i++)

static void cross(const double *a, const double *b, double *c) {
    EACH(i, 3) c[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
}

static double dot(const double *a, const double *b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

void stretch(long count, double small, const int64_t (*tets)[4], const double (*X)[3], const double (*x)[3],
             double (*sums)[7], double (*pairs)[6], double (*gradients)[3][3], uint8_t *large) {
    for (long e = 0; e < count; e++) {
        const int64_t *n = tets[e];
        double edge[3][3], slope[4][3], F[3][3] = {0}, E[3][3], log[3][3], next[3][3], most = 0;
        EACH(a, 3) EACH(i, 3) edge[a][i] = X[n[a + 1]][i] - X[n[0]][i];
        EACH(a, 3) cross(edge[(a + 1) % 3], edge[(a + 2) % 3], slope[a + 1]);
        double six = dot(edge[0], slope[1]), volume = six / 6;
        EACH(a, 3) EACH(i, 3) slope[a + 1][i] /= six;
        EACH(i, 3) slope[0][i] = -(slope[1][i] + slope[2][i] + slope[3][i]);
        for (int a = 0, k = 0; a < 4; a++)
            for (int b = a + 1; b < 4; b++) pairs[e][k++] = volume * dot(slope[a], slope[b]);
        EACH(a, 3) EACH(i, 3) EACH(j, 3) F[i][j] += (x[n[a + 1]][i] - x[n[0]][i]) * slope[a + 1][j];
        EACH(i, 3) EACH(j, 3) {
            gradients[e][i][j] = F[i][j];
            E[i][j] = F[0][i] * F[0][j] + F[1][i] * F[1][j] + F[2][i] * F[2][j] - (i == j);
            log[i][j] = (i == j) / 6.0;
            most = fmax(most, fabs(E[i][j]));
        }
        for (int order = 5; order >= 0; order--) {
            EACH(i, 3) EACH(j, 3) next[i][j] = E[i][0] * log[0][j] + E[i][1] * log[1][j] + E[i][2] * log[2][j];
            EACH(i, 3) EACH(j, 3) log[i][j] = order ? (i == j) / (double)order - next[i][j] : next[i][j] / 2;
        }
        large[e] = !(most <= small);
        double share = large[e] ? 0 : volume / 4;
        double of_corner[7] = {share * log[0][0], share * log[1][1], share * log[2][2],
                               share * log[0][1], share * log[0][2], share * log[1][2], volume / 4};
        EACH(a, 4) EACH(i, 7) sums[n[a]][i] += of_corner[i];
    }
}
"""


class Stretches:
    """The stretches and stiffness of (m, 4) tetrahedra between n vertices that move.

    Where the stiffness has its entries is found once, which takes longer than all else. Processes that `share` the
    elements, each with some of the `tets`, all have the whole.
    """

    def __init__(self, tets: Ints, count: int, share: Share = ALONE) -> None:
        self._interface, self._code = compiled(MPI.COMM_SELF, DECLARATION, CODE)
        self.tets = np.ascontiguousarray(tets[share.of(len(tets))], dtype=np.int64)
        self.share, self._count = share, count
        numbers = np.unique(_edge_numbers(tets, count))
        self._edge = np.searchsorted(numbers, _edge_numbers(self.tets, count).ravel()).astype(np.int32)
        self._ends = np.divmod(numbers, count)
        vertices = np.arange(count)
        rows, columns = (np.concatenate([*ends, vertices]) for ends in (self._ends, self._ends[::-1]))
        self._places = sparse.coo_matrix((np.arange(len(rows)), (rows, columns))).tocsr()

    def of(self, positions: Floats, displacement: Floats) -> tuple[Floats, Floats, sparse.csr_matrix]:
        """Return sums at the vertices over the elements around them, and the (n, n) stiffness matrix.

        Positions and displacement are (n, 3) in mm. The sums are (n, 6) of ln U and (n,) of the size, of which a
        quarter of each element's volume counts at each of its corners.
        """
        count, elements = self._count, len(self.tets)
        sums, pairs = np.zeros((count, 7)), np.empty((elements, len(PAIRS)))
        gradients, large = np.empty((elements, 3, 3)), np.empty(elements, dtype=np.uint8)
        places = (np.ascontiguousarray(at, dtype=float) for at in (positions, positions + displacement))
        arrays = self.tets, *places, sums, pairs, gradients, large
        self._code.stretch(elements, SMALL, *map(self._interface.from_buffer, arrays))
        corners = self.tets[large > 0]
        edges = positions[corners[:, 1:]] - positions[corners[:, :1]]
        logs = packed(log_stretch(gradients[large > 0])) * np.linalg.det(edges)[:, None] / 24
        np.add.at(sums[:, :6], corners, logs[:, None])
        stiff = np.bincount(self._edge, pairs.ravel(), minlength=len(self._ends[0]))
        everything = self.share.summed(np.concatenate([sums.ravel(), stiff]))
        sums, between = everything[: 7 * count].reshape(count, 7), everything[7 * count :]
        # rows sum to zero
        own = -sum(np.bincount(ends, between, minlength=count) for ends in self._ends)
        entries = np.concatenate([between, between, own])[self._places.data]
        matrix = sparse.csr_matrix((entries, self._places.indices, self._places.indptr), shape=(count, count))
        return sums[:, :6], sums[:, 6], matrix


def log_stretch(F: NDArray[np.floating]) -> Floats:
    """Return the (..., 3, 3) logarithms ln U of the right stretch of gradients, no eigenvalue above `MOST_STRAIN`."""
    values, axes = np.linalg.eigh(np.swapaxes(F, -1, -2) @ F)
    stretches = np.clip(0.5 * np.log(np.maximum(values, 1e-12)), -MOST_STRAIN, MOST_STRAIN)
    return np.asarray((axes * stretches[..., None, :]) @ np.swapaxes(axes, -1, -2))


def _edge_numbers(tets: Ints, count: int) -> Ints:
    first, second = (tets[:, corners] for corners in np.transpose(PAIRS))
    return np.minimum(first, second) * count + np.maximum(first, second)
