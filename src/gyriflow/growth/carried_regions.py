"""Regions of the cortex: from volumes or surfaces to the vertices of a brain."""

import logging
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..errors import InputError
from ..geometry.matching import labels_at, match_points
from ..geometry.triangles import Floats, Ints, TriangleMesh, vertex_normals
from ..settings.terms import NO_REGION

log = logging.getLogger(__name__)

REACH_MM = 4.0
"""Largest distance of a voxel from the pial vertices to which it gives its region."""
MIN_NEAR, USUAL_NEAR = 0.5, 0.8
"""Shares of vertices near a region, or of regions near vertices, below which regions
are refused or warned of."""
MAX_MEAN_DISTANCE_MM = 5.0
"""Largest mean distance of the regions' surface from the brain's surface."""


def number_regions(*tables: Mapping[int, str]) -> dict[str, int]:
    """Number the names in tables of labels from 1, in the order of the labels.

    Labels with the same name, such as those of left and right, are one region.
    """
    names = dict.fromkeys(table[label] for table in tables for label in sorted(table))
    return {name: number for number, name in enumerate(names, start=1)}


def renumber(
    labels: NDArray[np.integer], names: Mapping[int, str], numbers: Mapping[str, int]
) -> Ints:
    """Convert labels to the numbers of their regions; 0 for labels without a name."""
    values, back = np.unique(labels, return_inverse=True)
    regions = [
        numbers[names[int(value)]] if int(value) in names else NO_REGION
        for value in values
    ]
    return np.array(regions, dtype=np.int64)[back].reshape(np.shape(labels))


def regions_from_volume(
    points: Mapping[str, Floats], regions: NDArray[np.integer], affine: Floats
) -> dict[str, Ints]:
    """Return the region of the voxel nearest to each vertex; 0 if none is within 4 mm.

    `points` are the (n, 3) vertices of the pial surfaces by side, `regions` (i, j, k)
    numbers, 0 for none, and `affine` (4, 4) leads from index to the points' space.

    InputError if no vertex of a side is near a region, or if the regions are not along
    the surfaces.
    """
    inside = np.argwhere(regions > 0)
    if not len(inside):
        raise InputError("no voxel has a region", expected="labels that have a name")
    centres = inside @ affine[:3, :3].T + affine[:3, 3]
    tree = cKDTree(centres)
    by_side: dict[str, Ints] = {}
    reached = []
    for side, vertices in points.items():
        distance, nearest = tree.query(vertices, distance_upper_bound=REACH_MM)
        near = np.isfinite(distance)
        if not near.any():
            raise InputError(
                "no region is close to the pial surface",
                found=f"no named voxel within {REACH_MM:g} mm of the {side} one",
                expected="regions along the cortex, in the space of the brain's labels",
            )
        reached.append(near)
        by_side[side] = np.full(len(vertices), NO_REGION, dtype=np.int64)
        by_side[side][near] = regions[tuple(inside[nearest[near]].T)]
    share = float(np.concatenate(reached).mean())
    if share < USUAL_NEAR:
        # with few regions most vertices have none, but the regions themselves lie along
        # the surface
        distance, _ = cKDTree(np.concatenate(list(points.values()))).query(
            centres, distance_upper_bound=REACH_MM
        )
        share = max(share, float(np.isfinite(distance).mean()))
    if share < MIN_NEAR:
        raise InputError(
            "the regions do not lie along the pial surface",
            found=f"{100 * share:.0f} % within {REACH_MM:g} mm",
            expected=f"{100 * MIN_NEAR:.0f} % or more",
            remedy=(
                "Give them in the space of the brain's own files. Surfaces of"
                " FreeSurfer in tkr RAS lie off volumes by C_RAS: convert them with"
                " mris_convert --to-scanner."
            ),
        )
    if share < USUAL_NEAR:
        text = (
            "only %.0f %% of the regions and the pial surface are within %g mm of each"
            " other: are they in one space?"
        )
        log.warning(text, 100 * share, REACH_MM)
    return by_side


def regions_from_surface(
    target: TriangleMesh, surface: TriangleMesh, regions: NDArray[np.integer]
) -> Ints:
    """Return the regions at the vertices of `target`, from another surface of the same
    hemisphere.

    Each vertex gets the region of the nearest point whose normal agrees, so not that of
    the opposite wall of a sulcus. InputError if the labels do not belong to the
    surface, or the surface is far from the target.
    """
    if len(regions) != len(surface.vertices):
        raise InputError(
            "labels do not belong to their surface",
            found=f"{len(regions)} labels",
            expected=f"{len(surface.vertices)}, the number of its vertices",
        )
    match = match_points(target.vertices, vertex_normals(target), surface)
    if match.distance_mm.mean() > MAX_MEAN_DISTANCE_MM:
        raise InputError(
            "the surface of the regions is not that of the brain",
            found=f"{match.distance_mm.mean():.1f} mm between them on average",
            expected=f"at most {MAX_MEAN_DISTANCE_MM:g} mm",
            remedy="Give it in the coordinates of the brain's own files.",
        )
    return labels_at(match, regions)
