"""Shapes of a mesh through the weeks of its own series: carried from brain to brain,
and fitted to each surface."""

import logging
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..geometry.deformations import Correspondence, Deformation, MatchedSurfaces, carry
from ..geometry.diffusion import diffuse, harmonic_continuation
from ..geometry.matching import (
    Match,
    match_layers,
    match_surface,
    nearest_on,
    surface_distance,
    values_at,
)
from ..geometry.tetrahedra import TetrahedralMesh, boundary_surface, linear_pieces
from ..geometry.triangles import (
    Floats,
    Ints,
    Mask,
    TriangleMesh,
    area_cm2,
    rms_length,
    vertex_areas,
    vertex_normals,
    volume_ml,
)
from .carrying import carry_over_weeks, follow_surfaces

log = logging.getLogger(__name__)

INNER_MM = 2.0
"""Depth below a surface of the tissue that distinguishes the banks of a sulcus: about
that of the cortex."""
PULL_MM = (4.0, 2.5, 1.5, 1.0)
"""Smoothing (SD, mm) of the pull towards a surface, round by round."""
PULL_TOL = 1e-3
"""Relative tolerance of that smoothing; the next round makes up for the error."""
REACH_MM, REACH_BY_TISSUE_MM = 4.0, 8.0
"""Largest distance over which a surface pulls: to points matched by normals, and by the
tissue below."""
FINAL_PULL_MM, OPENING_PULL_MM = 0.5, 0.6
"""Smoothing (SD, mm) of the pull for the last draw of a body, and for the draws before
it with open sulci."""
MAX_OPENING_DRAWS, OPENED_MM, MAX_GAP_LEFT = 6, 0.06, 0.9
"""Largest number of these draws; they end when the boundary is closer than this to its
goals (root mean square), or where more than this fraction of the distance was left by
the last one."""
MAX_MISFIT_MM = 0.25
"""Distance of a body from the surface (mean) or the shape (root mean square) that it is
fitted to above which a warning is logged."""
CONTINUATION_TOL = 1e-4
"""Relative tolerance of the harmonic continuation that a body follows."""
Target = tuple[TriangleMesh, Floats | None]
"""A surface, and where the tissue below the vertices that are fitted to it is in its
brain (n, 3), if it counts."""


def fit_onto_surface(
    moving: TriangleMesh,
    surface: TriangleMesh,
    pull_mm: Sequence[float] = PULL_MM,
    inner: Floats | None = None,
) -> Floats:
    """Deform a surface smoothly onto another one close to it; return its (n, 3)
    vertices in mm.

    Each round pulls the vertices to the nearest points of the other surface whose
    normals agree. Vertices of the other surface also pull their nearest points, so that
    the fundus of a sulcus has an effect although it is nearest to no vertex. The pull
    is smoothed along the moving surface, in each round over `pull_mm`.

    With `inner` (n, 3), where the tissue `INNER_MM` below the vertices is in the brain
    of the other surface, points are matched by that, too (`match_layers`). So a fold
    without a slit opens to both banks of a sulcus.
    """
    vertices = moving.vertices
    for spread_mm in pull_mm:
        moved = TriangleMesh(vertices, moving.faces)
        vertices = _Pulls.of(moved, surface, inner).goals(spread_mm)
    return vertices


@dataclass(frozen=True, eq=False)
class _Pulls:
    """The pulls of a surface on the vertices of a moved one: their weighted (n, 3)
    sums, and the (n,) sums of the weights, which are areas."""

    moved: TriangleMesh
    pull: Floats
    weight: Floats
    reach_mm: float

    @classmethod
    def of(
        cls,
        moved: TriangleMesh,
        surface: TriangleMesh,
        inner: Floats | None,
    ) -> "_Pulls":
        """Return the pulls on a surface with tissue below its vertices at (n, 3) places
        `inner`, if that counts."""
        reach_mm = REACH_MM if inner is None else REACH_BY_TISSUE_MM
        pull, weight = _pulls(moved, surface, inner, reach_mm)
        return cls(moved, pull, weight, reach_mm)

    def goals(self, spread_mm: float) -> Floats:
        """Return the (n, 3) places to which the pulls move the vertices, smoothed over
        a length."""
        moved = self.moved
        areas = np.maximum(vertex_areas(moved), 1e-9)
        pulled = np.column_stack([self.pull, self.weight]) / areas[:, None]
        smooth = diffuse(moved.vertices, moved.faces, pulled, spread_mm, PULL_TOL)
        move = smooth[:, :3] / np.maximum(smooth[:, 3:], 1e-3)
        # a mean of pulls is at most as long as these; near obtuse faces smoothed
        # weights may be zero or negative
        length = np.linalg.norm(move, axis=1, keepdims=True)
        factor = np.minimum(
            1.0,
            self.reach_mm / np.maximum(length, 1e-9),
        )
        return moved.vertices + move * factor


def _pulls(
    moved: TriangleMesh,
    surface: TriangleMesh,
    inner: Floats | None,
    reach_mm: float,
) -> tuple[Floats, Floats]:
    """Return the sums of pulls and weights of `_Pulls`."""
    if inner is None:
        forward = match_surface(moved, surface)
        backward = match_surface(surface, moved)
    else:
        below = _points_below(surface)
        forward = match_layers(
            moved.vertices, vertex_normals(moved), inner, surface, below
        )
        backward = match_layers(
            surface.vertices, vertex_normals(surface), below, moved, inner
        )
    misfit = values_at(forward, surface.vertices) - moved.vertices
    weight = vertex_areas(moved) * _is_near(forward, reach_mm)
    pull = misfit * weight[:, None]
    misfit = surface.vertices - values_at(backward, moved.vertices)
    areas = vertex_areas(surface) * _is_near(backward, reach_mm)
    shares = backward.weights * areas[:, None]
    np.add.at(weight, backward.corners, shares)
    np.add.at(
        pull,
        backward.corners,
        shares[..., None] * misfit[:, None],
    )
    return pull, weight


def _is_near(match: Match, reach_mm: float) -> Mask:
    return match.agrees & (match.distance_mm < reach_mm)


def _points_below(surface: TriangleMesh) -> Floats:
    """Return the (n, 3) points `INNER_MM` below the vertices of a surface."""
    return surface.vertices - INNER_MM * vertex_normals(surface)


class FittedBody(Protocol):
    """A mesh that is drawn to shapes, without inverted elements and crossing faces
    (`folding.elastic_fit`)."""

    positions_mm: Floats

    @property
    def boundary(self) -> TriangleMesh: ...
    def follow(self, shape: Floats) -> Floats: ...
    def draw(self, goals: Floats) -> Floats: ...
    def move_to(self, shape: Floats) -> Floats: ...
    def way_from(self, before: Floats) -> list[tuple[float, Floats]]: ...


@dataclass(frozen=True, eq=False)
class WeekShape:
    """The (n, 3) positions in mm of a mesh at a week, of an observed brain or of a stop
    on the way to it."""

    week: float
    positions: Floats
    is_stop: bool = False


@dataclass(frozen=True, eq=False)
class SeriesShapes:
    """The (w, n, 3) positions in mm of a mesh at w weeks; `stops` are those of the
    weeks without an observed brain."""

    weeks: list[float]
    positions: Floats
    stops: list[float]

    @classmethod
    def of(cls, shapes: Sequence[WeekShape]) -> "SeriesShapes":
        """Return the shapes from those of ascending weeks."""
        weeks = []
        positions = []
        stops = []
        for shape in shapes:
            weeks.append(shape.week)
            positions.append(shape.positions)
            if shape.is_stop:
                stops.append(shape.week)
        return cls(weeks, np.stack(positions), stops)

    def by_week(self) -> list[WeekShape]:
        """Return the shape of each week."""
        shapes = []
        for week, positions in zip(
            self.weeks,
            self.positions,
            strict=True,
        ):
            is_stop = week in self.stops
            shapes.append(WeekShape(week, positions, is_stop))
        return shapes


def with_stops(
    before: WeekShape,
    week: float,
    body: FittedBody,
) -> list[WeekShape]:
    """Return the shape of a body at a week, after the stops on its way from the shape
    before."""
    stops = {}
    duration = week - before.week
    for fraction, positions in body.way_from(before.positions):
        stop_week = round(before.week + fraction * duration, 2)
        # a stop that rounds to one of the two weeks is that week's shape itself
        if before.week < stop_week < week:
            stops[stop_week] = WeekShape(stop_week, positions, is_stop=True)
    return [*stops.values(), WeekShape(week, body.positions_mm)]


def fit_body(
    body: FittedBody,
    shape: Floats,
    target: Target | None,
    used: Ints,
) -> None:
    """Let a body follow a shape, and fit its boundary to a target; `used` are the
    vertices of the boundary.

    A target with the tissue below has a surface with slits: to this the boundary is
    drawn several times, until it is close or hardly comes closer.
    """
    body.follow(shape)
    if target is None:
        body.draw(shape[used])
        misfit_mm = rms_length(body.boundary.vertices - shape[used])
        warn_of_distance("a body", misfit_mm)
        return
    surface, inner = target
    gap_mm = np.inf
    pulls = _Pulls.of(body.boundary, surface, inner)
    for _ in range(0 if inner is None else MAX_OPENING_DRAWS):
        goals = pulls.goals(OPENING_PULL_MM)
        last_mm = gap_mm
        gap_mm = rms_length(goals - body.boundary.vertices)
        if gap_mm < OPENED_MM or gap_mm > MAX_GAP_LEFT * last_mm:
            break
        body.draw(goals)
        pulls = _Pulls.of(body.boundary, surface, inner)
    body.draw(pulls.goals(FINAL_PULL_MM))


def warn_of_distance(body: str, misfit_mm: float) -> None:
    """Log a warning that names a body if it is far from the shape that it is fitted to
    (root mean square over the vertices, in mm)."""
    if misfit_mm > MAX_MISFIT_MM:
        log.warning(
            "%s stays %.2f mm (root mean square) from its expected shape, where"
            " elements would be inverted or folds would move through each other",
            body,
            misfit_mm,
        )


def follow_series(
    mesh: TetrahedralMesh,
    weeks: Sequence[float],
    pairs: Sequence[Correspondence],
    surfaces: Sequence[TriangleMesh],
    body: FittedBody | None = None,
    *,
    has_slits: bool = False,
    earlier: SeriesShapes | None = None,
    after_week: Callable[[SeriesShapes], None] | None = None,
) -> SeriesShapes:
    """Carry a mesh's vertices through the brains of its series with its boundary fitted
    to theirs.

    Registration smooths: it carries a surface to within half a millimetre of the
    brain's own and flattens its folds. Therefore the boundary is fitted to that brain's
    surface week by week, and the inside is continued harmonically. Matched surfaces
    need no fit: the boundary keeps its place relative to them.

    Such a shape may have inverted elements and a boundary that crosses itself. A `body`
    of this mesh follows it week by week to a shape without these, and is fitted to the
    surface once more from there; the next week starts from it.

    `has_slits`: the surfaces have slits, which registration by labels does not show.
    Then points are matched by the tissue below them, too, and a body is drawn to its
    surface several times.

    The mesh belongs to the first of the `weeks`, `pairs` lead from each brain to the
    next, all by registration or all by matched surfaces, and `surfaces` are the pial
    surfaces of the later brains, all in the spaces of these correspondences.

    `after_week` gets all shapes so far whenever one of a week is made. With such shapes
    as `earlier` an interrupted series goes on.

    InputError if points leave the grid of a registration, or if the boundary is far
    from matched surfaces.
    """
    boundary, used = boundary_surface(mesh)
    pieces = linear_pieces(mesh)
    if body is None:
        extend_at_start = harmonic_continuation(mesh.vertices, pieces, used)
    shapes = earlier.by_week() if earlier else [WeekShape(weeks[0], mesh.vertices)]
    n_later_done = sum(not shape.is_stop for shape in shapes) - 1
    if earlier:
        log.info("going on after GW %g", shapes[-1].week)
    if body is not None:
        body.positions_mm = shapes[-1].positions
    # lazy: each week is carried from the last of `shapes`, which this loop extends
    carried = _carried(boundary, used, shapes, pairs, surfaces, has_slits)
    later_weeks = weeks[n_later_done + 1 :]
    for week, (places, goals, target) in zip(later_weeks, carried, strict=True):
        before = shapes[-1]
        if target is not None:
            surface, inner = target
            moved = TriangleMesh(goals, boundary.faces)
            goals = fit_onto_surface(moved, surface, PULL_MM, inner)
        if body is None:
            shape = places + extend_at_start(goals - places[used])
            shapes.append(WeekShape(week, shape))
        else:
            # on the shape of the week before, which has no inverted elements
            extend = harmonic_continuation(
                before.positions, pieces, used, CONTINUATION_TOL
            )
            shape = places + extend(goals - places[used])
            fit_body(body, shape, target, used)
            if target is not None:
                _warn_of_misfit(body.boundary, target[0], week)
            shapes += with_stops(before, week, body)
        if after_week:
            after_week(SeriesShapes.of(shapes))
    return SeriesShapes.of(shapes)


def _carried(
    boundary: TriangleMesh,
    used: Ints,
    shapes: Sequence[WeekShape],
    pairs: Sequence[Correspondence],
    surfaces: Sequence[TriangleMesh],
    has_slits: bool,
) -> Iterator[tuple[Floats, Floats, Target | None]]:
    """Yield for each week that has no shape yet the (n, 3) places of the mesh before
    its fit, those of its boundary, and the target of the fit, None for matched
    surfaces.

    Each starts from the last of `shapes` at that time.
    """
    first = sum(not shape.is_stop for shape in shapes) - 1
    matched = [pair for pair in pairs if isinstance(pair, MatchedSurfaces)]
    if matched:
        for moved in follow_surfaces(boundary, matched)[first + 1 :]:
            yield shapes[-1].positions, moved, None
        return
    for number in range(first, len(pairs)):
        pair = pairs[number]
        now = shapes[-1].positions
        assert isinstance(pair, Deformation)
        places = carry_over_weeks(now, [pair])[-1]
        inner = None
        if has_slits:
            before = TriangleMesh(now[used], boundary.faces)
            # below the observed surface: with the body's normals its roughness would
            # add up from week to week
            observed = surfaces[number - 1] if number else before
            inner = tissue_below(before, observed, pair)
        yield places, places[used], (surfaces[number], inner)


def tissue_below(
    boundary: TriangleMesh,
    observed: TriangleMesh,
    pair: Deformation,
) -> Floats:
    """Return the (n, 3) places, after a registration, of the tissue below the vertices
    of a boundary before it."""
    match = match_surface(boundary, observed)
    return carry(pair, values_at(match, _points_below(observed)))


def misfit_mm(boundary: TriangleMesh, surface: TriangleMesh) -> tuple[float, float]:
    """Return the mean distance of a boundary and a surface, and the larger quantile at
    95 % of both ways."""
    there, _, _ = nearest_on(boundary.vertices, surface)
    back, _, _ = nearest_on(surface.vertices, boundary)
    ways = [
        (there, vertex_areas(boundary)),
        (back, vertex_areas(surface)),
    ]
    return surface_distance(ways)


def _warn_of_misfit(
    boundary: TriangleMesh,
    surface: TriangleMesh,
    week: float,
) -> None:
    """Log the distance of a body's boundary from the surface that it is fitted to, as a
    warning if it is large."""
    mean, far = misfit_mm(boundary, surface)
    log.info(
        "GW %g: %.3f mm from the observed surface on average, 95 %% below %.2f mm",
        week,
        mean,
        far,
    )
    if mean > MAX_MISFIT_MM:
        log.warning(
            "the shape at GW %g stays %.2f mm from the observed surface on average (95"
            " %% below %.2f mm): the body cannot reach all of it without inverted"
            " elements or crossing folds",
            week,
            mean,
            far,
        )


def sizes_of(
    mesh: TetrahedralMesh, positions: Sequence[Floats] | Floats
) -> dict[str, Floats]:
    """Return area_cm2 and volume_ml (w,) of a mesh's boundary at w positions (n, 3)."""
    boundary, used = boundary_surface(mesh)
    areas = []
    volumes = []
    for places in positions:
        surface = TriangleMesh(places[used], boundary.faces)
        areas.append(area_cm2(surface))
        volumes.append(volume_ml(surface))
    return {
        "area_cm2": np.array(areas),
        "volume_ml": np.array(volumes),
    }
