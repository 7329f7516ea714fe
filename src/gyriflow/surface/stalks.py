"""Parts that hang on a brain by a thin stalk, found in masks and surfaces and cut off."""

from typing import Any

import numpy as np
import pyvista as pv
from numpy.typing import NDArray
from scipy import ndimage

from ..geometry.triangles import TriangleMesh, corners, submesh
from .repair import clean

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

# stalks are thinner than twice this
NECK_RADIUS_MM = 1.6
# the stalk's cross-section, and the part that hangs on it: larger ones are no polyps but parts of a brain
MOST_NECK_MM2 = 12.0
MOST_SHARE = 0.05
LEAST_MM3 = 15.0
# how far from the hanging part its stalk is cut away with it
REACH_MM = 4.0
# cuts follow the triangles, so that they are wider than the stalks
WIDEST_CUT_MM = 12.0
# voxels in which a surface is looked at
SURFACE_VOXEL_MM = 0.8
# lengths of brains and hemispheres
SMALLEST_MM, LARGEST_MM = 15.0, 300.0
INSIDE = ndimage.generate_binary_structure(3, 1)


def hanging_parts(mask: Mask, size_mm: Floats) -> Mask:
    """Returns which voxels of an (i, j, k) mask hang on it by thin stalks, these included.

    A part hangs where a ball of 3.2 mm across cannot pass from the rest to it, and no more than 12 mm² join it to the
    rest: a gyrus, which may be as thin, is joined along its length. `size_mm` (3,) are the voxels' edges.
    """
    hanging = np.zeros_like(mask)
    depth = ndimage.distance_transform_edt(mask, sampling=size_mm)
    number, count = ndimage.label(depth > NECK_RADIUS_MM, INSIDE)
    if count < 2:
        return hanging
    sizes = np.bincount(number.ravel())[1:]
    main = np.isin(number, np.flatnonzero(sizes >= MOST_SHARE * sizes.sum()) + 1)
    solid = mask & (ndimage.distance_transform_edt(~main, sampling=size_mm) <= NECK_RADIUS_MM)
    for part in np.flatnonzero(sizes < MOST_SHARE * sizes.sum()) + 1:
        ball = number == part
        near = ndimage.distance_transform_edt(~ball, sampling=size_mm) <= NECK_RADIUS_MM + REACH_MM
        loose, _ = ndimage.label(mask & ~solid & near, INSIDE)
        cut = np.isin(loose, np.setdiff1d(loose[ball], 0))
        large_enough = cut.sum() * size_mm.prod() >= LEAST_MM3 and cut.sum() < MOST_SHARE * mask.sum()
        if large_enough and 0 < _contact_mm2(cut, mask & ~cut, size_mm) <= MOST_NECK_MM2:
            hanging |= cut
    return hanging


def without_stalks(mask: Mask, affine: Floats) -> tuple[Mask, list[dict[str, Any]]]:
    """Returns the (i, j, k) mask without what hangs on it by stalks, and each part's volume, stalk and place in mm."""
    size = np.linalg.norm(affine[:3, :3], axis=0)
    number, count = ndimage.label(hanging_parts(mask, size), INSIDE)
    left, report = mask & (number == 0), []
    for part in (number == n for n in range(1, count + 1)):
        place = affine[:3, :3] @ np.argwhere(part).mean(axis=0) + affine[:3, 3]
        report.append(
            {
                "volume_mm3": float(part.sum() * size.prod()),
                "stalk_mm2": _contact_mm2(part, left, size),
                "place_mm": place.round(1).tolist(),
            }
        )
    return left, report


def surface_without_stalks(mesh: TriangleMesh) -> tuple[TriangleMesh, list[dict[str, Any]]]:
    """Returns a closed surface without what hangs on it by stalks, closed where these were cut, and the parts."""
    if not SMALLEST_MM < np.ptp(mesh.vertices, axis=0).max() < LARGEST_MM:
        # in another unit, which is reported elsewhere
        return mesh, []
    size = np.full(3, SURFACE_VOXEL_MM)
    first = mesh.vertices.min(axis=0) - 2.0 * size
    shape = np.ceil((np.ptp(mesh.vertices, axis=0) + 4.0 * size) / size).astype(int)
    grid = pv.ImageData(dimensions=shape, spacing=size, origin=first)
    body = pv.PolyData.from_regular_faces(np.array(mesh.vertices), np.array(mesh.faces, dtype=int))
    image = body.voxelize_binary_mask(reference_volume=grid)
    mask = np.asarray(image["mask"]).reshape(shape, order="F") > 0
    affine = np.diag([*size, 1.0])
    affine[:3, 3] = first
    left, report = without_stalks(mask, affine)
    if not report:
        return mesh, []
    # which side of the cuts each face is on: that of the nearest voxel inside
    _, nearest = ndimage.distance_transform_edt(~mask, return_indices=True)
    at = np.clip(np.rint((corners(mesh).mean(axis=1) - first) / size).astype(int), 0, shape - 1)
    kept = left[tuple(nearest[(slice(None), *at.T)])]
    open_, _ = submesh(mesh, kept)
    return clean(open_, WIDEST_CUT_MM)[0], report


def _contact_mm2(one: Mask, other: Mask, size_mm: Floats) -> float:
    """Returns the area in mm² of the faces between voxels of two masks."""
    total = 0.0
    for axis in range(3):
        a, b = np.moveaxis(one, axis, 0), np.moveaxis(other, axis, 0)
        faces = (a[:-1] & b[1:]).sum() + (b[:-1] & a[1:]).sum()
        total += float(faces * np.prod(np.delete(size_mm, axis)))
    return total
