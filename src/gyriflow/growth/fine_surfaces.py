"""Surfaces of predicted brains with the resolution of observed ones.

A mesh is coarser than the surfaces on which brains are measured. So an observed
surface is moved by the body's map: that of the atlas' brain of the week, or the start
brain's own as long as more than MIN_OWN_SHARE of its finer differences is kept.
"""

import logging
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.spatial import cKDTree

from ..geometry.alignment import rigid_fit
from ..geometry.deformations import transform_points
from ..geometry.matching import faces_that_cross
from ..geometry.triangles import Floats, TriangleMesh, signed_volume, vertex_areas

log = logging.getLogger(__name__)

SPREADS_MM = (1.0, 2.0, 4.0, 8.0)
"""Widths (SD) of the mean of displacements; the first without crossing faces counts."""
N_NEIGHBOURS = 100
"""Vertices of the mesh whose displacements are averaged at most."""
MIN_OWN_SHARE = 0.6
"""Share of the finer individual differences that a prediction keeps, above which its
surface is the start brain's own."""


@dataclass(frozen=True, eq=False)
class ObservedSurface:
    """An observed closed `surface` in mm, and the (m, 3) places on it of the vertices
    of a mesh's boundary."""

    surface: TriangleMesh
    places: Floats


def nearest_in_age(
    ages: pd.DataFrame,
    weeks: Sequence[float],
    week: float,
) -> int:
    """Return the number of that of an atlas' stated `weeks` whose brain has the age by
    size closest to a week.

    `ages` is the table of `AtlasAges`.
    """
    by_week = ages.set_index("stated_week")["age_by_size"]
    distances = (by_week.loc[list(weeks)] - week).abs()
    return int(distances.argmin())


def finer_share(
    kept: pd.DataFrame,
    start_week: float,
    week: float,
) -> float:
    """Return the share of the finer individual differences at a week, interpolated
    between those of `Expectation.kept`, 1 at the start."""
    weeks = [start_week, *kept["week"]]
    shares = [1.0, *kept["finer_share"]]
    return float(np.interp(week, weeks, shares))


def moved_surface(observed: ObservedSurface, boundary: TriangleMesh) -> TriangleMesh:
    """Move an observed surface as its places on the boundary of a mesh move to the
    boundary's shape.

    The surface is scaled and aligned with the boundary. The remaining displacements of
    the boundary's vertices are averaged around each vertex of the surface, with
    Gaussian weights in space, so that both banks of a sulcus move alike and do not
    cross. The surface then gets the volume of the boundary, which, being coarser, may
    have had another one on the observed brain.

    Where faces cross that do not in the observed surface, the average is wider; if that
    does not help, the boundary itself is returned and a warning is logged.
    """
    before = TriangleMesh(observed.places, boundary.faces)
    areas = vertex_areas(before)
    centre = np.average(before.vertices, axis=0, weights=areas)
    volume = signed_volume(boundary)
    scale = np.cbrt(volume / signed_volume(before))
    motion = rigid_fit(before.vertices, boundary.vertices, areas)
    places, surface = (
        transform_points(centre + scale * (points - centre), motion)
        for points in (before.vertices, observed.surface.vertices)
    )
    displacements = boundary.vertices - places
    n_neighbours = min(N_NEIGHBOURS, len(places))
    distances, neighbours = cKDTree(places).query(surface, n_neighbours)
    n_allowed = len(faces_that_cross(observed.surface))
    for spread_mm in SPREADS_MM:
        nearness = np.exp(-0.5 * (distances / spread_mm) ** 2)
        weights = areas[neighbours] * nearness
        weights /= weights.sum(axis=1, keepdims=True)
        # n: vertex of the surface, k: neighbour of it, j: axis
        move = np.einsum("nk,nkj->nj", weights, displacements[neighbours])
        moved = TriangleMesh(surface + move, observed.surface.faces)
        n_crossing = len(faces_that_cross(moved))
        if n_crossing <= n_allowed:
            return _scaled_to_volume(moved, volume)
    log.warning(
        "an observed surface that is moved to the predicted shape crosses itself in %d"
        " faces: the coarser surface of the mesh is used",
        n_crossing,
    )
    return boundary


def _scaled_to_volume(surface: TriangleMesh, volume_mm3: float) -> TriangleMesh:
    """Scale a closed surface about its centre to a volume."""
    areas = vertex_areas(surface)
    vertices = surface.vertices
    centre = np.average(vertices, axis=0, weights=areas)
    ratio = volume_mm3 / signed_volume(surface)
    scaled = centre + np.cbrt(ratio) * (vertices - centre)
    return TriangleMesh(scaled, surface.faces)
