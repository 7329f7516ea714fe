"""The path of an atlas: its ages by size, shapes of the mesh of one of its brains in
all weeks, and brains inside it.

Stated ages of an atlas are imprecise: volume may jump between two weeks and then
stagnate. Shape goes with volume more than with the stated age, so a brain is used at
the age of its size. The path is made once, and every brain that is to grow as the atlas
does is carried by it: each vertex keeps its place in the atlas' body.
"""

import logging
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import igl
import numpy as np
import pandas as pd
from scipy.optimize import isotonic_regression

from ..geometry.alignment import align_points
from ..geometry.diffusion import vertex_sizes
from ..geometry.matching import barycentric, nearest_on
from ..geometry.tetrahedra import TetrahedralMesh, boundary_surface, linear_pieces
from ..geometry.triangles import Floats, Ints, TriangleMesh, corners, face_normals
from .curves import Curve, fitted, rate, value
from .series_shapes import SeriesShapes, sizes_of

log = logging.getLogger(__name__)

MAX_AGE_ERROR_GW = 1.0
"""Difference between stated age and age by size above which it is warned of."""
MIN_AGE_SPACING_GW = 0.1
"""Smallest time between two brains of successive weeks."""


@dataclass(frozen=True, eq=False)
class AtlasAges:
    """The stated weeks (k,) of an atlas' brains, their volumes, the curve of volume,
    and their ages by size (k,)."""

    weeks: Floats
    volumes: Floats
    curve: Curve
    ages: Floats

    def table(self) -> pd.DataFrame:
        """Return a row per brain: stated_week, age_by_size, volume_ml and curve_ml, the
        curve at the stated week."""
        columns = {
            "stated_week": self.weeks,
            "age_by_size": self.ages,
            "volume_ml": self.volumes,
            "curve_ml": value(self.curve, self.weeks),
        }
        return pd.DataFrame(columns)


def ages_by_size(
    weeks: Sequence[float],
    volumes_ml: Sequence[float],
    others: Sequence[Mapping[float, float]] = (),
) -> AtlasAges:
    """Return the ages by size of an atlas' brains with volumes in mL at two or more
    ascending weeks.

    The curve of volume is monotone and robust against single brains (`curves.fitted`).
    It has the level of the atlas. Its growth is also that of `others`, volumes in mL by
    week of populations with levels of their own, between the atlas' first and last
    week. Each brain gets the week at which the curve has its volume; ages that do not
    ascend are replaced by their nearest ascending ones (isotonic regression).
    InputError if the atlas shrinks.
    """
    stated = np.asarray(weeks, dtype=float)
    volumes = np.asarray(volumes_ml, dtype=float)
    points = [(week, volume, 0) for week, volume in zip(stated, volumes, strict=True)]
    source = 0
    for other in others:
        inside = [week for week in other if stated[0] <= week <= stated[-1]]
        if inside:
            source += 1
            points += [(week, other[week], source) for week in inside]
    all_weeks, all_volumes, sources = zip(*points, strict=True)
    fit = fitted(
        all_weeks,
        all_volumes,
        name="volume of the atlas",
        keeps_first=True,
        sources=sources,
    )
    curve = fit.curve
    logs = np.log(curve.values)
    sizes = np.log(volumes)
    # the curve is flat where brains do not grow; beyond its ends ages follow its rate
    # there, or its mean rate if higher
    ages = np.interp(
        sizes,
        logs + 1e-9 * np.arange(len(logs)),
        curve.weeks,
    )
    mean_rate = (logs[-1] - logs[0]) / (curve.weeks[-1] - curve.weeks[0])
    for end, is_beyond in ((0, sizes < logs[0]), (-1, sizes > logs[-1])):
        week = curve.weeks[end]
        end_rate = max(float(rate(curve, week)), mean_rate)
        ages[is_beyond] = week + (sizes[is_beyond] - logs[end]) / end_rate
    spacing = MIN_AGE_SPACING_GW * np.arange(len(ages))
    ages = isotonic_regression(ages - spacing).x + spacing
    for week, age in zip(stated, ages, strict=True):
        if abs(age - week) > MAX_AGE_ERROR_GW:
            log.warning(
                "the brain of the atlas at %g GW has the size of %.1f GW, and its shape"
                " is used at that age",
                week,
                age,
            )
    return AtlasAges(stated, volumes, curve, ages)


def other_volumes(
    content: Mapping[str, Any], left_out: Collection[str]
) -> list[dict[float, float]]:
    """Return the volumes in mL by week of the sources of `norms/volumes.yaml`, without
    those that are named."""
    tables = []
    for name, source in content["sources"].items():
        if name not in left_out:
            volumes = source["volume_ml"]
            tables.append({float(week): volumes[week] for week in volumes})
    return tables


@dataclass(frozen=True, eq=False)
class AtlasPath:
    """Shapes (k, n, 3) in mm of the mesh with `tets` at k ascending `weeks`, each in
    the pose of the atlas' brain.

    The atlas has no brain at the weeks that are `stops`.
    """

    tets: Ints
    shapes: SeriesShapes

    def mesh(self, week: float) -> TetrahedralMesh:
        """Return the mesh at one of the weeks."""
        number = self.shapes.weeks.index(week)
        return TetrahedralMesh(self.shapes.positions[number], self.tets)

    @property
    def observed(self) -> Ints:
        """The numbers of the weeks with a brain of the atlas."""
        return np.flatnonzero(~np.isin(self.shapes.weeks, self.shapes.stops))

    def ages(self, others: Sequence[Mapping[float, float]] = ()) -> AtlasAges:
        """Return the ages by size of the atlas' brains in all its weeks; `others` as
        for `ages_by_size`."""
        shapes = self.shapes
        weeks = [shapes.weeks[number] for number in self.observed]
        positions = shapes.positions[self.observed]
        mesh = self.mesh(weeks[0])
        sizes = sizes_of(mesh, positions)
        volumes = sizes["volume_ml"].tolist()
        return ages_by_size(weeks, volumes, others)

    def knots(self, ages: AtlasAges) -> Floats:
        """Return the age by size of each shape, stops between those of their
        neighbours."""
        return np.interp(
            self.shapes.weeks,
            ages.weeks,
            ages.ages,
        )

    def carry(self, points: Floats, week: float) -> Floats:
        """Return the (k, n, 3) places in all weeks of (n, 3) points inside the brain of
        a week or close to it.

        A point keeps its barycentric coordinates in its element. One outside keeps its
        place on the nearest face of the boundary and its offset from there, which turns
        with the face.
        """
        mesh = self.mesh(week)
        pieces = linear_pieces(mesh)
        boundary, used = boundary_surface(mesh)
        tree = igl.AABB()
        tree.init(mesh.vertices, pieces)
        points = np.ascontiguousarray(points)
        element = igl.in_element(mesh.vertices, pieces, points, tree)
        is_inside = element >= 0
        corner_nodes = pieces[element[is_inside]]
        weights = _weights_in(mesh.vertices[corner_nodes], points[is_inside])
        others = points[~is_inside]
        _, face, nearest = nearest_on(others, boundary)
        on_face = barycentric(nearest, corners(boundary)[face])
        frames = _frames(boundary, face)
        offset = np.einsum("nij,ni->nj", frames, others - nearest)
        carried = np.empty((len(self.shapes.weeks), *points.shape))
        for places, shape in zip(
            carried,
            self.shapes.positions,
            strict=True,
        ):
            surface = TriangleMesh(shape[used], boundary.faces)
            places[is_inside] = _weighted(shape[corner_nodes], weights)
            nearest = _weighted(corners(surface)[face], on_face)
            turned = np.einsum("nij,nj->ni", _frames(surface, face), offset)
            places[~is_inside] = nearest + turned
        return carried


def _weights_in(tetrahedra: Floats, points: Floats) -> Floats:
    """Return the (n, 4) barycentric coordinates of points in tetrahedra with (n, 4, 3)
    corners."""
    first = tetrahedra[:, :1]
    edges = tetrahedra[:, 1:] - first
    # point - first corner = sum of the three other weights times the edges to these
    columns = np.moveaxis(edges, 1, 2)
    offset = points - first[:, 0]
    solution = np.linalg.solve(columns, offset[..., None])
    others = solution[..., 0]
    of_first = 1 - others.sum(axis=1)
    return np.column_stack([of_first, others])


def _weighted(places: Floats, weights: Floats) -> Floats:
    """Return the (n, 3) sums of (n, k, 3) places times (n, k) weights."""
    return (weights[..., None] * places).sum(axis=1)


def _frames(surface: TriangleMesh, faces: Ints) -> Floats:
    """Return the (n, 3, 3) orthonormal axes of faces as columns: along an edge, across
    it, and the normal."""
    a, b, _ = corners(surface)[faces].transpose(1, 0, 2)
    normal = face_normals(surface)[faces]
    along = b - a
    length = np.linalg.norm(along, axis=1, keepdims=True)
    along /= np.maximum(length, 1e-12)
    across = np.cross(normal, along)
    return np.stack([along, across, normal], axis=2)


def resample_by_size(
    mesh: TetrahedralMesh,
    shapes: Floats,
    weeks: Sequence[float] | Floats,
    ages: AtlasAges,
    knots: Floats,
) -> Floats:
    """Return the (w, n, 3) positions of a mesh at w weeks, as an atlas that grows along
    its curve of volume.

    `shapes` (k, n, 3) are the mesh's positions where the atlas has the k ages `knots`.
    At each week the shape is interpolated between those of the ages around it; before
    the first and after the last age it is that of this age. Its volume is the curve's
    at that week, times the mean ratio of the mesh's volumes to the curve's over all
    ages.
    """
    sizes = vertex_sizes(mesh.vertices, linear_pieces(mesh))
    # the mesh is not quite the atlas' brain
    own_volumes = sizes_of(mesh, shapes)["volume_ml"]
    ratio = np.exp(np.mean(np.log(own_volumes / value(ages.curve, knots))))
    resampled = []
    for week, wanted in zip(
        weeks,
        value(ages.curve, weeks),
        strict=True,
    ):
        age = np.clip(
            week,
            knots[0],
            knots[-1],
        )
        shape = positions_at(age, shapes, knots, sizes)
        volume = sizes_of(mesh, [shape])["volume_ml"][0]
        scale = (ratio * wanted / volume) ** (1 / 3)
        centre = np.average(shape, axis=0, weights=sizes)
        resampled.append(centre + scale * (shape - centre))
    return np.stack(resampled)


def positions_at(
    week: float,
    atlas: Floats,
    weeks: Sequence[float] | Floats,
    sizes: Floats,
) -> Floats:
    """Interpolate the (k, n, 3) positions of an atlas in k weeks linearly to a week;
    return (n, 3) positions.

    The later week is first aligned rigidly to the earlier one, with points weighted by
    their (n,) sizes.
    """
    later = np.searchsorted(weeks, week, side="right")
    # beyond the ends along the line of the first or last two weeks
    second = min(max(int(later), 1), len(weeks) - 1)
    first = second - 1
    part = (week - weeks[first]) / (weeks[second] - weeks[first])
    aligned = align_points(atlas[second], atlas[first], sizes)
    return np.asarray((1 - part) * atlas[first] + part * aligned)
