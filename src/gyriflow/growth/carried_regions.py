"""Regions of the cortex: from what users give to the vertices of a brain's pial surfaces, and from brain to brain."""

import logging
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..errors import InputError
from ..geometry.deformations import Deformation, carry, transform_points
from ..geometry.matching import labels_at, match_points
from ..geometry.triangles import Floats, Ints, TriangleMesh, vertex_normals
from ..settings.terms import NO_REGION
from .channels import Channels
from .diffeomorphic import register
from .registration_quality import judge, require_good

log = logging.getLogger(__name__)

PLACES_MM = 1.2
"""Grid of the registration that carries named sulci: fine enough for places, four times as fast as 0.8 mm."""
REACH_MM = 4.0
"""How far from the pial surface voxels may lie that give it their region."""
LEAST_NEAR, USUAL_NEAR = 0.5, 0.8
"""Shares of vertices near a region, or of regions near vertices, below which regions are refused, or warned of."""
ELSEWHERE_MM = 5.0
"""Mean distance beyond which a surface is not that of the brain."""


def number_regions(*tables: Mapping[int, str]) -> dict[str, int]:
    """Return a number from 1 for each name in tables of labels, in the order of the labels.

    Labels of one name, such as those of left and right, are one region.
    """
    names = dict.fromkeys(table[label] for table in tables for label in sorted(table))
    return {name: number for number, name in enumerate(names, start=1)}


def renumber(labels: NDArray[np.integer], names: Mapping[int, str], numbers: Mapping[str, int]) -> Ints:
    """Return labels as numbers of the regions that they name; 0 for those without a name."""
    values, back = np.unique(labels, return_inverse=True)
    regions = [numbers[names[int(value)]] if int(value) in names else NO_REGION for value in values]
    return np.array(regions, dtype=np.int64)[back].reshape(np.shape(labels))


def regions_from_volume(points: Mapping[str, Floats], regions: NDArray[np.integer], affine: Floats) -> dict[str, Ints]:
    """Return for vertices in mm the region of the nearest voxel that has one, 0 where none is within 4 mm.

    `points` are the (n, 3) vertices of the pial surfaces by side, `regions` (i, j, k) numbers, 0 for none, and `affine`
    (4, 4) leads from index to the points' space.

    InputError where no point of a side is near a region, or the regions lie elsewhere than the surfaces.
    """
    inside = np.argwhere(regions > 0)
    if not len(inside):
        raise InputError("no voxel has a region", expected="labels that are named")
    centres = inside @ affine[:3, :3].T + affine[:3, 3]
    tree = cKDTree(centres)
    by_side: dict[str, Ints] = {}
    reached = []
    for side, vertices in points.items():
        away, nearest = tree.query(vertices, distance_upper_bound=REACH_MM)
        near = np.isfinite(away)
        if not near.any():
            raise InputError(
                "no region is near the pial surface",
                found=f"no named voxel within {REACH_MM:g} mm of the {side} one",
                expected="regions along the cortex, in the space of the brain's labels",
            )
        reached.append(near)
        by_side[side] = np.full(len(vertices), NO_REGION, dtype=np.int64)
        by_side[side][near] = regions[tuple(inside[nearest[near]].T)]
    share = float(np.concatenate(reached).mean())
    if share < USUAL_NEAR:
        # few regions leave most vertices without one, but lie along the surface themselves
        away, _ = cKDTree(np.concatenate(list(points.values()))).query(centres, distance_upper_bound=REACH_MM)
        _require_along(max(share, float(np.isfinite(away).mean())))
    return by_side


def _require_along(share: float) -> None:
    if share < LEAST_NEAR:
        raise InputError(
            "the regions do not lie along the pial surface",
            found=f"{100 * share:.0f} % within {REACH_MM:g} mm",
            expected=f"{100 * LEAST_NEAR:.0f} % or more",
            remedy="Give them in the space of the brain's own files. Surfaces of FreeSurfer in tkr RAS lie beside "
            "volumes by C_RAS: convert them with mris_convert --to-scanner.",
        )
    if share < USUAL_NEAR:
        log.warning(
            "only %.0f %% of the regions and the pial surface lie within %g mm of each other: are they of one space?",
            100 * share,
            REACH_MM,
        )


def find_places(brain: Channels, drawn: Channels, *, threads: int = 1) -> Deformation | None:
    """Return where a brain's points lie in the one that sulci are drawn on; None, with a warning, where it fails.

    A place needs no overlap of the cortex, which is thin in early weeks: that of the cerebrum is judged, and folding.
    """
    try:
        deformation = register(brain, drawn, threads=threads).deformation
        quality = replace(judge(brain, drawn, deformation), dice_cortex=float("nan"))
        require_good(quality, pair="with the brain of the named sulci")
    except InputError as error:
        # sulci have numbers then: no reason to stop a study
        log.warning("sulci have no names: %s", error)
        return None
    return deformation


def regions_by_deformation(points: Floats, between: Deformation, regions: NDArray[np.integer], affine: Floats) -> Ints:
    """Return for (n, 3) points in mm the region of the voxel that a deformation carries them to, 0 beyond the volume.

    `regions` (i, j, k) and `affine` (4, 4) are of the brain that the deformation leads to.
    """
    index = np.rint(transform_points(carry(between, points), np.linalg.inv(affine))).astype(int)
    inside = np.all((index >= 0) & (index < regions.shape), axis=1)
    carried = np.full(len(points), NO_REGION, dtype=np.int64)
    carried[inside] = regions[tuple(index[inside].T)]
    return carried


def regions_from_surface(target: TriangleMesh, surface: TriangleMesh, regions: NDArray[np.integer]) -> Ints:
    """Return for the vertices of `target` the regions of the nearest points of another surface of the same hemisphere.

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
