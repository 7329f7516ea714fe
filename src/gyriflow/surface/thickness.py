"""Cortical thickness at the vertices of a pial surface, from labels of the cortex."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import cKDTree

from ..errors import InputError
from ..geometry.layers import layer_thickness
from ..geometry.triangles import TriangleMesh, vertex_areas
from .extraction import LEVEL, isosurface, main_parts, smooth_mask
from .fissure import sample

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

# a vertex has cortex under it where the centre of a voxel of cortex is nearer than this, and lies on the labels' own
# surface where voxels outside are not much further
NEAR_VOXELS = 1.0
FARTHEST_VOXELS = 1.5
# a layer thinner than this part of a voxel is none
THINNEST_VOXELS = 1 / 3
QUANTILES = (0.05, 0.95)


@dataclass(frozen=True, eq=False)
class Thickness:
    """Cortical thickness on a surface.

    Attributes
    ----------
    values_mm : (n,) float
        Thickness at each vertex; where it could not be measured, that of the nearest vertex where it could.
    measured : (n,) bool
        Where there is cortex and its thickness was measured.
    report
        Means and shares, in plain values for JSON.
    """

    values_mm: Floats
    measured: Mask
    report: dict[str, Any]

    @property
    def measured_mm(self) -> Floats:
        """The (n,) thickness at each vertex, NaN where it was not measured."""
        return np.where(self.measured, self.values_mm, np.nan)


def cortical_thickness(
    pial: TriangleMesh, cerebrum: Mask, cortex: Mask, affine: Floats, smoothing_voxels: float
) -> Thickness:
    """Returns the cortical thickness at the vertices of a pial surface; InputError where it has no cortex under it.

    The inner border is the isosurface of the smoothed mask of the cerebrum without its cortex, which lies between
    voxels as the pial surface does. The thickness at a vertex is the mean of two distances: from the vertex to the
    nearest point of the inner border, and from there to the nearest point of the pial surface (Fischl & Dale 2000,
    doi 10.1073/pnas.200033797). It is not measured where the surface has no cortex under it (corpus callosum,
    brainstem), and where a fissure that the labels hide was opened.

    Parameters
    ----------
    pial
        In the coordinates of the affine, in mm.
    cerebrum, cortex : (i, j, k) bool
        Where the cerebrum is, and where in it the cortex.
    affine : (4, 4) float
        Voxel index to position in mm.
    smoothing_voxels
        σ of the Gaussian with which the pial surface was made.
    """
    core = smooth_mask(cerebrum & ~cortex, smoothing_voxels)
    kept, _, _ = main_parts(core > LEVEL)
    core = np.where(kept, np.maximum(core, LEVEL + 1e-3), np.minimum(core, LEVEL - 1e-3)).astype(np.float32)
    inner = isosurface(core, affine)
    points = pial.vertices
    values = layer_thickness(pial, inner)
    voxel = float(abs(np.linalg.det(affine[:3, :3])) ** (1 / 3))
    measured = _cortex_under(points, cerebrum, cortex, affine, voxel) & (values >= THINNEST_VOXELS * voxel)
    if not measured.any():
        raise InputError(
            "the labels of the cortex lie nowhere at the surface of the cerebrum",
            found=f"{int(cortex.sum())} voxels of cortex, all of them deep inside or thinner than a third of a voxel",
            expected="a layer around the cerebrum",
            remedy="Check which labels the scheme calls cortex.",
        )
    _, known = cKDTree(points[measured]).query(points[~measured])
    filled = values.copy()
    filled[~measured] = values[measured][known]
    report = summary(values, measured, vertex_areas(pial))
    return Thickness(filled, measured, report | {"voxels_through_cortex": report["mean_mm"] / voxel})


def _cortex_under(points: Floats, cerebrum: Mask, cortex: Mask, affine: Floats, voxel_mm: float) -> Mask:
    """Returns which of (n, 3) points lie at the surface of the cerebrum's labels, with cortex under them."""
    size = np.linalg.norm(affine[:3, :3], axis=0)
    to_cortex, to_outside = (ndimage.distance_transform_edt(mask, sampling=size) for mask in (~cortex, cerebrum))
    near = sample(to_cortex, affine, points) < NEAR_VOXELS * voxel_mm
    return near & (sample(to_outside, affine, points) < FARTHEST_VOXELS * voxel_mm)


def summary(values: Floats, measured: Mask, areas: Floats) -> dict[str, Any]:
    """Returns the summary of the thickness; means are weighted by area."""
    chosen, weights = values[measured], areas[measured]
    quantiles = np.quantile(chosen, [QUANTILES[0], 0.5, QUANTILES[1]], weights=weights, method="inverted_cdf")
    low, median, high = map(float, quantiles)
    mean = float(np.average(chosen, weights=weights))
    return {
        "mean_mm": mean,
        "median_mm": median,
        "quantile05_mm": low,
        "quantile95_mm": high,
        "sd_mm": float(np.sqrt(np.average((chosen - mean) ** 2, weights=weights))),
        "measured_area_share": float(weights.sum() / areas.sum()),
        "suggested_thickness_mm": round(mean, 2),
    }
