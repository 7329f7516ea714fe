"""The path of an atlas: its ages by size, shapes of the mesh of one of its brains in
all weeks, and brains inside it.

Stated ages of an atlas are imprecise: volume may jump between two weeks and then
stagnate. Shape goes with volume more than with the stated age, so a brain is used at
the age of its size. The path is made once, and every brain that is to grow as the atlas
does is carried by it: each vertex keeps its place in the atlas' body.
"""

import logging
from collections.abc import Sequence
from dataclasses import dataclass

import igl
import numpy as np
import pandas as pd
from scipy.optimize import isotonic_regression

from ..geometry.alignment import rigid_fit
from ..geometry.deformations import transform_points
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

    def volume(self, week: float) -> float:
        """Return the volume of the atlas at a week, in the unit of its brains'
        volumes."""
        return float(value(self.curve, week))

    def table(self) -> pd.DataFrame:
        """Return a row per brain: stated_week, age_by_size, volume_ml and curve_ml, the
        curve at the stated week."""
        curve = value(self.curve, self.weeks)
        return pd.DataFrame(
            {
                "stated_week": self.weeks,
                "age_by_size": self.ages,
                "volume_ml": self.volumes,
                "curve_ml": curve,
            }
        )


def ages_by_size(
    weeks: Sequence[float],
    volumes_ml: Sequence[float],
    norm_ml: Sequence[float] | Floats = (),
) -> AtlasAges:
    """Return the ages by size of an atlas' brains with volumes in mL at two or more
    ascending weeks.

    The curve of volume is monotone and robust against single brains (`curves.fitted`).
    It is fitted to the atlas' volumes and, with the same weight, to the medians of a
    norm at these weeks, `norm_ml`, NaN where it has none. Each brain gets the week at
    which the curve has its volume; ages that do not ascend are replaced by their
    nearest ascending ones (isotonic regression). InputError if the atlas shrinks.
    """
    stated = np.asarray(weeks, dtype=float)
    volumes = np.asarray(volumes_ml, dtype=float)
    points = pd.DataFrame({"week": stated, "volume": volumes})
    if len(norm_ml):
        points = pd.concat(
            [points, points.assign(volume=norm_ml).dropna()]
        ).sort_values("week", kind="stable")
    curve = fitted(
        points["week"].tolist(),
        points["volume"].tolist(),
        name="volume of the atlas",
        keeps_first=True,
    ).curve
    logs, sizes = np.log(curve.values), np.log(volumes)
    # the curve is flat where brains do not grow; beyond its ends ages follow its rate
    # there, or its mean rate if higher
    inside = np.interp(sizes, logs + 1e-9 * np.arange(len(logs)), curve.weeks)
    mean_rate = (logs[-1] - logs[0]) / (curve.weeks[-1] - curve.weeks[0])
    end_rates = [
        max(float(rate(curve, curve.weeks[end])), mean_rate) for end in (0, -1)
    ]
    ages = np.where(
        sizes < logs[0], curve.weeks[0] + (sizes - logs[0]) / end_rates[0], inside
    )
    ages = np.where(
        sizes > logs[-1], curve.weeks[-1] + (sizes - logs[-1]) / end_rates[1], ages
    )
    spacing = MIN_AGE_SPACING_GW * np.arange(len(ages))
    ages = isotonic_regression(ages - spacing).x + spacing
    for number in np.flatnonzero(np.abs(ages - stated) > MAX_AGE_ERROR_GW):
        text = (
            "the brain of the atlas at %g GW has the size of %.1f GW, and its shape is"
            " used at that age"
        )
        log.warning(text, stated[number], ages[number])
    return AtlasAges(stated, volumes, curve, ages)


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
        return TetrahedralMesh(
            self.shapes.positions[self.shapes.weeks.index(week)], self.tets
        )

    @property
    def observed(self) -> Ints:
        """The numbers of the weeks with a brain of the atlas."""
        return np.flatnonzero(~np.isin(self.shapes.weeks, self.shapes.stops))

    def ages(self, norm_ml: Sequence[float] | Floats = ()) -> AtlasAges:
        """Return the ages by size of the atlas' brains in all its weeks; `norm_ml` as
        for `ages_by_size`."""
        positions = self.shapes.positions[self.observed]
        sizes = sizes_of(TetrahedralMesh(positions[0], self.tets), positions)
        return ages_by_size(
            [self.shapes.weeks[number] for number in self.observed],
            list(sizes["volume_ml"]),
            norm_ml,
        )

    def knots(self, ages: AtlasAges) -> Floats:
        """Return the age by size of each shape, stops between those of their
        neighbours."""
        return np.interp(self.shapes.weeks, ages.weeks, ages.ages)

    def carry(self, points: Floats, week: float) -> Floats:
        """Return the (k, n, 3) places in all weeks of (n, 3) points inside the brain of
        a week or close to it.

        A point keeps its barycentric coordinates in its element. One outside keeps its
        place on the nearest face of the boundary and its offset from there, which turns
        with the face.
        """
        mesh = self.mesh(week)
        pieces, (boundary, used) = linear_pieces(mesh), boundary_surface(mesh)
        tree = igl.AABB()
        tree.init(mesh.vertices, pieces)
        element = igl.in_element(
            mesh.vertices, pieces, np.ascontiguousarray(points), tree
        )
        inside = element >= 0
        at_corners = mesh.vertices[pieces[element[inside]]]
        edges = np.moveaxis(at_corners[:, 1:] - at_corners[:, :1], 1, 2)
        offsets = points[inside] - at_corners[:, 0]
        weights = np.linalg.solve(edges, offsets[..., None])[..., 0]
        weights = np.column_stack([1 - weights.sum(axis=1), weights])
        _, face, on = nearest_on(points[~inside], boundary)
        on_face = barycentric(on, corners(boundary)[face])
        offset = np.einsum("nij,ni->nj", _frames(boundary, face), points[~inside] - on)
        carried = np.empty((len(self.shapes.weeks), *points.shape))
        for places, shape in zip(carried, self.shapes.positions, strict=True):
            surface = TriangleMesh(shape[used], boundary.faces)
            places[inside] = (weights[..., None] * shape[pieces[element[inside]]]).sum(
                axis=1
            )
            places[~inside] = (on_face[..., None] * corners(surface)[face]).sum(axis=1)
            places[~inside] += np.einsum("nij,nj->ni", _frames(surface, face), offset)
        return carried


def _frames(surface: TriangleMesh, faces: Ints) -> Floats:
    """Return the (n, 3, 3) orthonormal axes of faces as columns: along an edge, across
    it, and the normal."""
    at = corners(surface)[faces]
    normal = face_normals(surface)[faces]
    along = at[:, 1] - at[:, 0]
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)
    return np.stack([along, np.cross(normal, along), normal], axis=2)


def resample_by_size(
    mesh: TetrahedralMesh,
    atlas: Floats,
    weeks: Sequence[float] | Floats,
    ages: AtlasAges,
    knots: Floats,
) -> Floats:
    """Return the (w, n, 3) positions of a mesh at w weeks, as an atlas that grows along
    its curve of volume.

    `atlas` (k, n, 3) are the mesh's positions where the atlas has the k ages `knots`.
    At each week the shape is that between the shapes whose ages are around it. Its
    volume is that of the curve, as a multiple of the curve's at the age of the first
    shape.
    """
    sizes = vertex_sizes(mesh.vertices, linear_pieces(mesh))
    shapes = np.stack(
        [
            positions_at(week, atlas, knots, sizes)
            for week in np.clip(weeks, *knots[[0, -1]])
        ]
    )
    volumes = sizes_of(mesh, shapes)["volume_ml"]
    own = sizes_of(mesh, atlas)["volume_ml"]
    # a mesh that is not quite the atlas' has another volume: the mean ratio over all
    # its weeks
    ratio = np.exp(np.mean(np.log(own / np.array([ages.volume(age) for age in knots]))))
    scales = [
        (ratio * ages.volume(week) / volume) ** (1 / 3)
        for week, volume in zip(weeks, volumes, strict=True)
    ]
    centres = np.average(shapes, axis=1, weights=sizes)[:, None]
    return centres + np.array(scales)[:, None, None] * (shapes - centres)


def positions_at(
    week: float, atlas: Floats, weeks: Sequence[float] | Floats, sizes: Floats
) -> Floats:
    """Interpolate the (k, n, 3) positions of an atlas in k weeks linearly to a week;
    return (n, 3) positions.

    The later week is first aligned rigidly to the earlier one, with points weighted by
    their (n,) sizes.
    """
    first = int(
        np.clip(
            np.searchsorted(np.asarray(weeks), week, side="right") - 1,
            0,
            len(weeks) - 2,
        )
    )
    part = (week - weeks[first]) / (weeks[first + 1] - weeks[first])
    motion = rigid_fit(atlas[first + 1], atlas[first], sizes)
    return np.asarray(
        (1 - part) * atlas[first] + part * transform_points(atlas[first + 1], motion)
    )
