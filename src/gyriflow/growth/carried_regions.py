"""Regions of the cortex: from volumes or surfaces to the vertices of a brain."""

import logging
from collections.abc import Mapping

import numpy as np
from scipy.spatial import cKDTree

from ..errors import InputError
from ..geometry.matching import labels_at, match_surface
from ..geometry.triangles import Floats, Indices, Ints, TriangleMesh
from ..grouping import counted
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
    numbers: dict[str, int] = {}
    for table in tables:
        for label in sorted(table):
            numbers.setdefault(table[label], len(numbers) + 1)
    return numbers


def renumber(
    labels: Indices,
    names: Mapping[int, str],
    numbers: Mapping[str, int],
) -> Ints:
    """Convert labels to the numbers of their regions; 0 for labels without a name."""
    regions = np.full(
        np.shape(labels),
        NO_REGION,
        dtype=np.int64,
    )
    for label, name in names.items():
        regions[labels == label] = numbers[name]
    return regions


def regions_from_volume(
    points: Mapping[str, Floats],
    regions: Indices,
    affine: Floats,
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
        voxels = inside[nearest[near]]
        by_side[side] = np.full(
            len(vertices),
            NO_REGION,
            dtype=np.int64,
        )
        by_side[side][near] = regions[tuple(voxels.T)]
    share = float(np.concatenate(reached).mean())
    if share < USUAL_NEAR:
        # with few regions most vertices have none, but the regions themselves lie along
        # the surface
        tree = cKDTree(np.concatenate(list(points.values())))
        distance, _ = tree.query(centres, distance_upper_bound=REACH_MM)
        share = max(
            share,
            float(np.isfinite(distance).mean()),
        )
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
        log.warning(
            "only %.0f %% of the regions and the pial surface are within %g mm of each"
            " other: are they in one space?",
            100 * share,
            REACH_MM,
        )
    return by_side


def regions_from_surface(
    target: TriangleMesh,
    surface: TriangleMesh,
    regions: Indices,
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
            found=counted(len(regions), "label"),
            expected=f"{len(surface.vertices)}, the number of its vertices",
        )
    match = match_surface(target, surface)
    distance_mm = match.distance_mm.mean()
    if distance_mm > MAX_MEAN_DISTANCE_MM:
        raise InputError(
            "the surface of the regions is not that of the brain",
            found=f"{distance_mm:.1f} mm between them on average",
            expected=f"at most {MAX_MEAN_DISTANCE_MM:g} mm",
            remedy="Give it in the coordinates of the brain's own files.",
        )
    return labels_at(match, regions)
