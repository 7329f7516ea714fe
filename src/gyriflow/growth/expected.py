"""Predict a brain's later shapes: carry its mesh along an atlas' path and keep its
individual differences."""

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from ..errors import InputError
from ..geometry.alignment import align_points
from ..geometry.deformations import Deformation, carry
from ..geometry.diffusion import (
    diffuse,
    harmonic_continuation,
    vertex_sizes,
)
from ..geometry.paths import path_through
from ..geometry.tetrahedra import (
    TetrahedralMesh,
    boundary_surface,
    linear_pieces,
    volumes_between,
)
from ..geometry.triangles import Floats, TriangleMesh, rms_length, vertex_areas
from ..settings.growth import BEFORE_GW
from .atlas_path import (
    MIN_AGE_SPACING_GW,
    AtlasAges,
    AtlasPath,
    positions_at,
    resample_by_size,
)
from .series_shapes import (
    FittedBody,
    SeriesShapes,
    WeekShape,
    fit_body,
    fit_onto_surface,
    tissue_below,
    warn_of_distance,
    with_stops,
)

log = logging.getLogger(__name__)
DIFFERENCE_SMOOTHING_MM = 8.0
"""Smoothing (SD, mm) of the individual difference. Finer differences fade by FADING_GW
too."""
FADING_GW = 8.0
"""Time constant with which finer differences fade. With 8 weeks synthetic individuals
whose differences last lose little, and those whose differences fade nothing
(docs/science.md)."""
MATCH_ERROR_MM = 0.5
"""Root mean square of the individual difference that is no individual's: the
error of the match to the atlas, and of the atlas as an average. From pairs of averages
by benchmarks/persistence.py (docs/science.md)."""
MATCH_FADING_GW = 1.0
"""Time constant with which this error leaves a predicted shape, which begins as the
observed brain."""
LASTING, LASTING_GW = 0.5, 16.0
"""Share of a real individual difference that lasts, and the time constant in weeks with
which the rest is replaced. A half is a prior, not a measurement: no followed fetuses
were at hand, and it errs least in the worst case (docs/science.md)."""


@dataclass(frozen=True)
class Persistence:
    """How much of an individual difference a prediction keeps.

    Of a difference of `difference_mm` (root mean square over the boundary) the part
    beyond `match_error_mm` is real. Of this, `lasting` stays for ever, and the rest
    fades within `LASTING_GW`.
    """

    difference_mm: float
    lasting: float = LASTING
    match_error_mm: float = MATCH_ERROR_MM

    def _reliability(self) -> float:
        """Return the share of the mean square of the difference that is real, from 0 to
        1."""
        if not self.match_error_mm:
            return 1.0
        if self.difference_mm <= self.match_error_mm:
            return 0.0
        return 1 - (self.match_error_mm / self.difference_mm) ** 2

    def weight(self, weeks_ahead: float) -> float:
        """Return the weight w of the difference after some weeks, 1 at the start.

        It is the best linear predictor: persistence times the reliability of the match.
        """
        fading = np.exp(-weeks_ahead / LASTING_GW)
        persistence = self.lasting + (1 - self.lasting) * fading
        match_fading = np.exp(-weeks_ahead / MATCH_FADING_GW)
        reliability = self._reliability()
        error = (1 - reliability) * match_fading
        return float(persistence * (reliability + error))


WHOLE = Persistence(difference_mm=np.inf, lasting=1.0)
"""All of an individual difference is kept."""


@dataclass(frozen=True, eq=False)
class Expectation:
    """The positions (w + 1, n, 3) in mm of a mesh at its start and at w later weeks,
    and the table `kept`: week, smooth_share and finer_share of the individual
    difference, and its difference_mm at the start."""

    positions: Floats
    kept: pd.DataFrame


@dataclass(frozen=True, eq=False)
class Prediction:
    """The predicted shapes of a mesh at all `weeks`, and the atlas' ages by size.

    A path through the `shapes`, stops included, also gives those at the weeks
    `between`. The baselines are simpler predictions of the boundary's vertices (m, 3):
    `atlas`, the atlas' own brain, and `atlas_deformed`, that brain with the whole
    individual difference. `kept` is the table of `Expectation` for the weeks of the
    atlas, `placed` (m, 3) the boundary's vertices on the atlas' brain of each stated
    week.
    """

    weeks: list[float]
    positions: Floats
    shapes: SeriesShapes
    between: list[float]
    baselines: Mapping[str, list[Floats]]
    ages: AtlasAges
    kept: pd.DataFrame
    placed: Mapping[float, Floats]


def place_in_atlas(
    mesh: TetrahedralMesh,
    pair: Deformation,
    atlas: TetrahedralMesh,
    make_body: Callable[[TetrahedralMesh], FittedBody],
    *,
    has_slits: bool = False,
) -> Floats:
    """Return the (n, 3) places of a mesh's vertices inside the atlas' brain, with its
    boundary fitted to the atlas'.

    `pair` is the registration to that brain, whose mesh is `atlas`; `has_slits` as in
    `follow_series`. A body makes the map, so that no element is inverted.
    """
    boundary, used = boundary_surface(mesh)
    surface, _ = boundary_surface(atlas)
    inner = tissue_below(boundary, boundary, pair) if has_slits else None
    places = carry(pair, mesh.vertices)
    carried = TriangleMesh(places[used], boundary.faces)
    goals = fit_onto_surface(carried, surface, inner=inner)
    extend = harmonic_continuation(mesh.vertices, linear_pieces(mesh), used)
    shape = places + extend(goals - places[used])
    body = make_body(mesh)
    fit_body(body, shape, (surface, inner), used)
    return body.positions_mm


def expected_positions(
    mesh: TetrahedralMesh,
    start_week: float,
    atlas: Floats,
    atlas_weeks: Sequence[float] | Floats,
    weeks: Sequence[float],
    *,
    smoothing_mm: float = DIFFERENCE_SMOOTHING_MM,
    fading_gw: float = FADING_GW,
    lasting: float = LASTING,
    keep_all: bool = False,
) -> Expectation:
    """Predict the positions of a mesh for w later weeks.

    The brain moves as the atlas does from the atlas' shape at the start week. Its
    individual difference from the atlas grows in proportion to the size and is kept
    with the weight of `Persistence`, of which `lasting` is a part. Differences that are
    finer than the smooth ones (SD `smoothing_mm`; none with 0) also fade with the time
    constant `fading_gw`. `keep_all` keeps all of the smooth difference for ever.

    `mesh` is that of the start brain in mm, `atlas` (k, n, 3) the positions of its
    vertices in the atlas' k ascending `atlas_weeks`.

    InputError if the start is long before the first week of the atlas, or not before
    the last one.
    """
    first = atlas_weeks[0]
    last = atlas_weeks[-1]
    earliest = first - BEFORE_GW
    if len(atlas_weeks) < 2 or not earliest <= start_week < last:
        raise InputError(
            "the atlas does not cover the growth of a brain of this week",
            found=(
                f"a start at {start_week:g} GW and an atlas of {first:g} to {last:g} GW"
            ),
            expected=(
                f"two weeks or more, and a start from {earliest:g} GW to before"
                f" {last:g} GW"
            ),
        )
    pieces = linear_pieces(mesh)
    sizes = vertex_sizes(mesh.vertices, pieces)
    start = align_points(
        positions_at(start_week, atlas, atlas_weeks, sizes),
        mesh.vertices,
        sizes,
    )
    difference = mesh.vertices - start
    smooth = diffuse(mesh.vertices, pieces, difference, smoothing_mm)
    size = volumes_between(start, pieces).sum()
    boundary, used = boundary_surface(mesh)
    squares = (difference[used] ** 2).sum(axis=1)
    difference_mm = np.sqrt(np.average(squares, weights=vertex_areas(boundary)))
    persistence = WHOLE if keep_all else Persistence(float(difference_mm), lasting)
    positions = [mesh.vertices]
    kept = []
    for week in weeks:
        places = positions_at(week, atlas, atlas_weeks, sizes)
        scale = (volumes_between(places, pieces).sum() / size) ** (1 / 3)
        smooth_share = persistence.weight(week - start_week)
        finer_share = smooth_share * float(np.exp((start_week - week) / fading_gw))
        remaining = smooth_share * smooth + finer_share * (difference - smooth)
        positions.append(align_points(places, start, sizes) + scale * remaining)
        kept.append((week, smooth_share, finer_share, difference_mm))
    columns = ["week", "smooth_share", "finer_share", "difference_mm"]
    return Expectation(
        np.stack(positions),
        pd.DataFrame(kept, columns=columns),
    )


def predict_shapes(
    mesh: TetrahedralMesh,
    start_week: float,
    end_week: float,
    path: AtlasPath,
    inside: Floats,
    atlas_week: float,
    make_body: Callable[[TetrahedralMesh], FittedBody],
    *,
    further_weeks: Sequence[float] = (),
    age_shift_gw: float = 0.0,
    others: Sequence[Mapping[float, float]] = (),
    smoothing_mm: float = DIFFERENCE_SMOOTHING_MM,
    fading_gw: float = FADING_GW,
    lasting: float = LASTING,
) -> Prediction:
    """Predict the shapes of a mesh from its week to that of the atlas after the end
    week, and at further weeks.

    The vertices' places `inside` the atlas' brain of `atlas_week` (n, 3), of
    `place_in_atlas`, are carried along the atlas' path, whose brains count at their age
    by size (`resample_by_size`). One body follows the prediction from week to week of
    the atlas, so that no element is inverted and no faces cross. Curve, ages and the
    weeks that the body passes are those of the atlas, and the path ends two weeks of
    the atlas after the end: so a shape does not depend on what else is predicted.

    `age_shift_gw`, by which a brain of the atlas is older than stated, `smoothing_mm`,
    `fading_gw` and `lasting` vary in an ensemble; `others` as for `ages_by_size`.
    """
    carried = path.carry(inside, atlas_week)
    ages = path.ages(others)
    grown = resample_by_size(
        mesh,
        carried,
        ages.weeks,
        ages,
        path.knots(ages),
    )
    atlas_weeks = ages.weeks - age_shift_gw
    is_later = atlas_weeks > start_week + MIN_AGE_SPACING_GW
    later = [round(week, 2) for week in atlas_weeks[is_later].tolist()]
    later = later[: int(np.searchsorted(later, end_week)) + 2]
    expected = expected_positions(
        mesh,
        start_week,
        grown,
        atlas_weeks,
        later,
        smoothing_mm=smoothing_mm,
        fading_gw=fading_gw,
        lasting=lasting,
    )
    sizes = vertex_sizes(mesh.vertices, linear_pieces(mesh))
    body = make_body(mesh)
    shapes = [WeekShape(start_week, mesh.vertices)]
    _, used = boundary_surface(mesh)
    misfits_mm = {}
    for week, shape in zip(
        later,
        expected.positions[1:],
        strict=True,
    ):
        body.move_to(shape)
        shapes += with_stops(shapes[-1], week, body)
        reached = shapes[-1].positions[used]
        reached = align_points(reached, shape[used], sizes[used])
        misfit_mm = rms_length(reached - shape[used])
        log.info("GW %g: %.2f mm from the expected shape", week, misfit_mm)
        if week <= end_week:
            misfits_mm[week] = misfit_mm
    if misfits_mm:
        worst = max(misfits_mm, key=misfits_mm.__getitem__)
        warn_of_distance(f"at most, at GW {worst:g}, the brain", misfits_mm[worst])
    found = SeriesShapes.of(shapes)
    way = path_through(
        found.weeks,
        found.positions,
        mesh,
        stops=found.stops,
    )
    between = sorted({*further_weeks} - {*found.weeks})
    by_week = dict(
        zip(
            found.weeks,
            found.positions,
            strict=True,
        )
    )
    for week in between:
        by_week[week] = way(week)
    weeks = sorted(by_week)
    deformed = expected_positions(
        mesh,
        start_week,
        grown,
        atlas_weeks,
        weeks[1:],
        smoothing_mm=0,
        keep_all=True,
    ).positions
    baselines: dict[str, list[Floats]] = {"atlas": [], "atlas_deformed": []}
    for week, places in zip(weeks, deformed, strict=True):
        atlas = positions_at(week, carried, path.shapes.weeks, sizes)
        baselines["atlas"].append(atlas[used])
        baselines["atlas_deformed"].append(places[used])
    positions = np.stack([by_week[week] for week in weeks])
    placed = {}
    for number in path.observed:
        placed[float(path.shapes.weeks[number])] = carried[number][used]
    return Prediction(
        weeks, positions, found, between, baselines, ages, expected.kept, placed
    )
