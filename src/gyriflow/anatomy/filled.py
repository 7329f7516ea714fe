"""Label volumes filled from pial and white surfaces, for the registration of brains that have no labels."""

from collections.abc import Sequence

import igl
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from ..geometry.deformations import transform_points
from ..geometry.matching import layer_thickness, nearest_on, surface_mask
from ..geometry.triangles import Floats, TriangleMesh, merged
from ..settings.schemes import FILLED
from .fissure import FISSURE_MM
from .thickness import FISSURE_REACH_MM, MIN_MM

TYPICAL_THICKNESS_MM = 2.0
"""Thickness of the cortex if no brain of the study has a measured one; means in label atlases are 0.8 to 2.7 mm."""
TYPICAL_VOXEL_MM = 0.8
"""Voxel size if no brain of the study has labels: that of label atlases."""
CUT_TOL_MM = 1e-3
"""A voxel lies below a cut if that is nearer than the pial surface by more than this."""


def filled_labels(
    whole: TriangleMesh,
    sides: Sequence[TriangleMesh],
    fissure_x_mm: float,
    *,
    whites: Sequence[TriangleMesh] = (),
    thickness_mm: float = TYPICAL_THICKNESS_MM,
    voxel_mm: float = TYPICAL_VOXEL_MM,
) -> tuple[NDArray[np.int32], Floats]:
    """Return an (i, j, k) volume with the labels of `FILLED` inside a pial surface, and its (4, 4) affine.

    `whole` is the closed surface, `sides` are its hemispheres, open or capped at the midline, all in one pose. Cortex
    lies between the `sides` and the `whites`, or else within `thickness_mm`; cuts and coinciding surfaces have none.
    Hemispheres are joined where their gap at the fissure is as narrow as one that is opened in labels.
    """
    mask, affine = surface_mask(whole, voxel_mm)
    inside = mask > 0
    if len(sides) > 1:
        inside |= _narrow_gaps(inside, affine, fissure_x_mm)
    points, pial = transform_points(np.argwhere(inside), affine), merged(*sides)
    depth, faces, _ = nearest_on(points, pial)
    if whites:
        white = merged(*whites)
        thickness = layer_thickness(pial, white)[pial.faces[faces]].mean(axis=1)
        # the sign depends on the order of corners
        outside = np.abs(igl.fast_winding_number(white.vertices, white.faces, points)) < 0.5
        below_cut = depth > nearest_on(points, whole)[0] + CUT_TOL_MM
        is_cortex = outside & (thickness >= MIN_MM) & ((depth <= thickness) | ~below_cut)
    else:
        is_cortex = depth <= thickness_mm
    labels = np.zeros(inside.shape, dtype=np.int32)
    (cortex,) = FILLED.cortex
    (core,) = set(FILLED.cerebrum) - {cortex}
    labels[inside] = np.where(is_cortex, cortex, core)
    return labels, affine


def _narrow_gaps(inside: NDArray[np.bool_], affine: Floats, fissure_x_mm: float) -> NDArray[np.bool_]:
    """Return the mask of the gaps at the fissure up to `FISSURE_MM` and a voxel wide."""
    voxel = float(affine[0, 0])
    radius = 0.5 * (FISSURE_MM + voxel)
    near = ndimage.distance_transform_edt(~inside, sampling=voxel) <= radius
    closed = ndimage.distance_transform_edt(near, sampling=voxel) > radius
    x = affine[0, 3] + voxel * np.arange(inside.shape[0])
    return closed & (np.abs(x - fissure_x_mm) <= FISSURE_REACH_MM)[:, None, None]
