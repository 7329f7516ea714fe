"""Regions of the cortex: from what users give to the vertices of a brain's pial surfaces, and from brain to brain."""

from collections.abc import Mapping

import igl
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..errors import InputError
from ..geometry.matching import labels_at, match_points
from ..geometry.triangles import Floats, Ints, TriangleMesh, vertex_normals

NO_REGION = 0
REACH_MM = 4.0
"""How far from the pial surface voxels may lie that give it their region."""
ELSEWHERE_MM = 5.0
"""Mean distance beyond which a surface is not that of the brain."""


def number_regions(*tables: Mapping[int, str]) -> dict[str, int]:
    """Returns a number from 1 for each name in tables of labels, in the order of the labels.

    Labels of one name, such as those of left and right, are one region.
    """
    names = dict.fromkeys(table[label] for table in tables for label in sorted(table))
    return {name: number for number, name in enumerate(names, start=1)}


def renumber(labels: NDArray[np.integer], names: Mapping[int, str], numbers: Mapping[str, int]) -> Ints:
    """Returns labels as numbers of the regions that they name; 0 for those without a name."""
    values, back = np.unique(labels, return_inverse=True)
    found = [numbers[names[int(value)]] if int(value) in names else NO_REGION for value in values]
    return np.array(found, dtype=np.int64)[back].reshape(np.shape(labels))


def regions_from_volume(points: Floats, regions: NDArray[np.integer], affine: Floats) -> Ints:
    """Returns for (n, 3) points in mm the region of the nearest voxel that has one, 0 where none is within 4 mm.

    Parameters
    ----------
    regions, affine
        (i, j, k) numbers, 0 for none, and the (4, 4) matrix from index to the points' space.

    InputError where no point is near a region.
    """
    inside = np.argwhere(regions > 0)
    if not len(inside):
        raise InputError("no voxel has a region", expected="labels that are named")
    centres = inside @ affine[:3, :3].T + affine[:3, 3]
    away, nearest = cKDTree(centres).query(points, distance_upper_bound=REACH_MM)
    found = np.full(len(points), NO_REGION, dtype=np.int64)
    near = np.isfinite(away)
    if not near.any():
        raise InputError(
            "no region is near the pial surface",
            found=f"no named voxel within {REACH_MM:g} mm",
            expected="regions along the cortex, in the space of the brain's labels",
        )
    found[near] = regions[tuple(inside[nearest[near]].T)]
    return found


def regions_from_surface(target: TriangleMesh, surface: TriangleMesh, regions: NDArray[np.integer]) -> Ints:
    """Returns for the vertices of `target` the regions of the nearest points of another surface of the same hemisphere.

    Normals of both have to agree, so that no vertex takes the region of the other wall of a sulcus. InputError where
    the labels are not those of the surface, or the surface lies elsewhere.
    """
    if len(regions) != len(surface.vertices):
        raise InputError(
            "labels do not belong to their surface",
            found=f"{len(regions)} labels",
            expected=f"{len(surface.vertices)}, the number of its vertices",
        )
    match = match_points(target.vertices, vertex_normals(target), surface)
    if match.distance_mm.mean() > ELSEWHERE_MM:
        raise InputError(
            "the surface of the regions is not that of the brain",
            found=f"{match.distance_mm.mean():.1f} mm between them on average",
            expected=f"at most {ELSEWHERE_MM:g} mm",
            remedy="Give it in the coordinates of the brain's own files.",
        )
    return labels_at(match, regions)


def surface_mask(mesh: TriangleMesh, voxel_mm: float) -> tuple[NDArray[np.int32], Floats]:
    """Returns a label volume with 1 inside a closed surface, and its (4, 4) affine: what a brain without labels has.

    It can be registered with other brains, by its shape alone.
    """
    margin = 4 * voxel_mm
    low = mesh.vertices.min(axis=0) - margin
    shape = np.ceil((np.ptp(mesh.vertices, axis=0) + 2 * margin) / voxel_mm).astype(int) + 1
    centres = low + voxel_mm * np.indices(shape).reshape(3, -1).T
    inside = igl.fast_winding_number(mesh.vertices, mesh.faces, centres) > 0.5
    affine = np.diag([voxel_mm, voxel_mm, voxel_mm, 1.0])
    affine[:3, 3] = low
    return inside.reshape(shape).astype(np.int32), affine
