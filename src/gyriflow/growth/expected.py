"""Predict a brain's later shapes: carry its mesh through an atlas and keep its individual differences."""

import logging
from collections.abc import Callable, Iterator, Sequence
from itertools import groupby
from typing import Protocol

import numpy as np

from ..errors import InputError
from ..geometry.alignment import rigid_fit
from ..geometry.deformations import Correspondence, Deformation, MatchedSurfaces, carry, transform_points
from ..geometry.diffusion import cell_sizes, diffuse, harmonic_continuation, vertex_sizes
from ..geometry.matching import match_layers, match_points, match_surface, nearest_on, surface_distance, values_at
from ..geometry.tetrahedra import TetrahedralMesh, boundary_surface, linear_pieces
from ..geometry.triangles import Floats, TriangleMesh, area_cm2, vertex_areas, vertex_normals, volume_ml
from ..settings.growth import BEFORE_GW
from .atlas_ages import MIN_SPACING_GW, AtlasAges, ages_by_size
from .carrying import carry_over_weeks
from .matched_surfaces import follow_surfaces

log = logging.getLogger(__name__)

INNER_MM = 2.0
"""Depth below a surface of the tissue that distinguishes the banks of a sulcus: about that of the cortex."""
PULL_MM = (4.0, 2.5, 1.5, 1.0)
"""Smoothing (SD, mm) of the pull towards a surface, round by round."""
PULL_TOL = 1e-3
"""Relative tolerance of that smoothing; the next round makes up for the error."""
FINAL_PULL_MM, OPENING_PULL_MM = (0.5,), (0.6,)
"""The same for the last draw of a body, and for the draws before it with open sulci."""
MAX_OPENING_DRAWS, OPENED_MM = 4, 0.06
"""Largest number of these draws; they end when the boundary is closer than this to its goals (root mean square)."""
REACH_MM, REACH_BY_TISSUE_MM = 4.0, 8.0
"""Largest distance over which a surface pulls: to points matched by normals, and by the tissue below."""
MAX_MISFIT_MM = 0.25
"""Mean distance of a body from the surface it is fitted to above which a warning is logged."""
CONTINUATION_TOL = 1e-4
"""Relative tolerance of the harmonic continuation that a body follows."""
DIFFERENCE_SMOOTHING_MM = 8.0
"""Smoothing (SD, mm) of the individual difference. Differences finer than a gyrus do not predict later folds."""
FADING_GW = 4.0
"""Time constant with which finer differences fade: of 1, 4 and 16 weeks the best for synthetic individuals
(docs/science.md)."""


Target = tuple[TriangleMesh, Floats | None]
"""A surface, and where the tissue below the vertices that are fitted to it is in its brain (n, 3), if it counts."""


class FittedBody(Protocol):
    """A mesh that is drawn to shapes, without inverted elements and crossing faces (`folding.elastic_fit`)."""

    @property
    def boundary(self) -> TriangleMesh: ...
    def follow(self, shape: Floats) -> Floats: ...
    def draw(self, goals: Floats, before: Sequence[Floats] = ()) -> Floats: ...


def fit_onto_surface(
    moving: TriangleMesh, surface: TriangleMesh, pull_mm: Sequence[float] = PULL_MM, inner: Floats | None = None
) -> Floats:
    """Deform a surface smoothly onto another one close to it; return its (n, 3) vertices in mm.

    Each round pulls the vertices to the nearest points of the other surface whose normals agree. Vertices of the other
    surface also pull their nearest points, so that the fundus of a sulcus has an effect although it is nearest to no
    vertex. The pull is smoothed along the moving surface, in each round as `pull_mm` says.

    With `inner` (n, 3), where the tissue `INNER_MM` below the vertices is in the brain of the other surface, points are
    matched by that, too (`match_layers`). So a fold without a slit opens to both banks of a sulcus.
    """
    vertices, faces = moving.vertices, moving.faces
    normals, areas, below = vertex_normals(surface), vertex_areas(surface), points_below(surface)
    reach_mm = REACH_MM if inner is None else REACH_BY_TISSUE_MM
    for spread in pull_mm:
        moved = TriangleMesh(vertices, faces)
        moved_areas, moved_normals = vertex_areas(moved), vertex_normals(moved)
        if inner is None:
            forward = match_points(vertices, moved_normals, surface)
            backward = match_points(surface.vertices, normals, moved)
        else:
            forward = match_layers(vertices, moved_normals, inner, surface, below)
            backward = match_layers(surface.vertices, normals, below, moved, inner)
        weight = moved_areas * (forward.agrees & (forward.distance_mm < reach_mm))
        pull = (values_at(forward, surface.vertices) - vertices) * weight[:, None]
        shares = backward.weights * (areas * (backward.agrees & (backward.distance_mm < reach_mm)))[:, None]
        misfit = surface.vertices - values_at(backward, vertices)
        np.add.at(weight, backward.corners, shares)
        np.add.at(pull, backward.corners, shares[..., None] * misfit[:, None])
        pulled = np.column_stack([pull, weight]) / np.maximum(moved_areas, 1e-9)[:, None]
        smooth = diffuse(vertices, faces, pulled, spread, PULL_TOL)
        move = smooth[:, :3] / np.maximum(smooth[:, 3:], 1e-3)
        # a mean of pulls is at most as long as these; near obtuse faces smoothed weights may be zero or negative
        length = np.linalg.norm(move, axis=1, keepdims=True)
        vertices = vertices + move * np.minimum(1.0, reach_mm / np.maximum(length, 1e-9))
    return np.asarray(vertices)


def points_below(surface: TriangleMesh) -> Floats:
    """Return the (n, 3) points `INNER_MM` below the vertices of a surface."""
    return surface.vertices - INNER_MM * vertex_normals(surface)


def carry_sharply(
    mesh: TetrahedralMesh,
    pairs: Sequence[Correspondence],
    surfaces: Sequence[TriangleMesh] | None,
    body: FittedBody | None = None,
    *,
    open_sulci: bool = False,
) -> Floats:
    """Carry a mesh's vertices through w brains with its boundary fitted to theirs; return (w + 1, n, 3) positions.

    Registration smooths: it carries a surface to within half a millimetre of the brain's own and flattens its folds.
    Therefore the boundary is fitted to that brain's surface week by week, and the inside is continued harmonically.
    Matched surfaces need no fit: the boundary keeps its place relative to them.

    Such a shape may have inverted elements and a boundary that crosses itself. A `body` of this mesh follows it week by
    week to a shape without these, and is fitted to the surface once more from there; the next week starts from it.

    With `open_sulci` the surfaces have slits that registration by labels does not show. Then points are matched by the
    tissue below them, too, and a body is drawn to its surface several times.

    The mesh belongs to the first brain, `pairs` lead from each brain to the next, and `surfaces` are the pial surfaces
    of the later brains, all in the spaces of these correspondences. Without surfaces nothing is fitted.

    InputError if points leave the grid of a registration, or if the boundary is far from matched surfaces.
    """
    boundary, used = boundary_surface(mesh)
    pieces = linear_pieces(mesh)
    extend = harmonic_continuation(mesh.vertices, pieces, used)
    positions = [mesh.vertices]

    def fitted(moving: TriangleMesh, target: Target | None, pull_mm: Sequence[float] = PULL_MM) -> Floats:
        # a surface that is matched by its vertices is the goal itself
        return moving.vertices if target is None else fit_onto_surface(moving, target[0], pull_mm, target[1])

    def draw_near(body: FittedBody, target: Target) -> None:
        """Draw a body towards a surface until it is close or stays as it is."""
        for _ in range(MAX_OPENING_DRAWS):
            before = body.boundary.vertices
            goals = fitted(body.boundary, target, OPENING_PULL_MM)
            if np.sqrt(3 * np.mean((goals - before) ** 2)) < OPENED_MM:
                return
            body.draw(goals)
            if np.allclose(body.boundary.vertices, before, atol=1e-6):
                return

    def tissue_below(number: int, pair: Deformation) -> Floats:
        """Return the (n, 3) places, after a pair, of the tissue below the boundary before it."""
        before = TriangleMesh(positions[-1][used], boundary.faces)
        # below the observed surface: with the body's normals its roughness would add up from week to week
        observed = surfaces[number - 1] if number and surfaces else before
        return carry(pair, values_at(match_surface(before, observed), points_below(observed)))

    def carried(numbered: Sequence[tuple[int, Correspondence]]) -> Iterator[tuple[Floats, Floats, Target | None]]:
        """Yield (n, 3) places after each pair of one kind, the boundary's there, and what it is fitted to."""
        if matched := [pair for _, pair in numbered if isinstance(pair, MatchedSurfaces)]:
            for moved in follow_surfaces(TriangleMesh(positions[-1][used], boundary.faces), matched)[1:]:
                yield positions[-1], moved, None
        for number, pair in numbered:
            if isinstance(pair, Deformation):
                places = carry_over_weeks(positions[-1], [pair])[-1]
                inner = tissue_below(number, pair) if open_sulci else None
                yield places, places[used], None if surfaces is None else (surfaces[number], inner)

    for _, group in groupby(enumerate(pairs), lambda numbered: type(numbered[1])):
        for places, moved, target in carried(list(group)):
            moved = fitted(TriangleMesh(moved, boundary.faces), target)
            if body is not None:
                # on the shape of the week before, which has no inverted elements
                extend = harmonic_continuation(positions[-1], pieces, used, CONTINUATION_TOL)
            shape = places + extend(moved - places[used])
            if body is not None:
                body.follow(shape)
                if target is not None and open_sulci:
                    draw_near(body, target)
                goals = moved if target is None else fitted(body.boundary, target, FINAL_PULL_MM)
                shape = body.draw(goals, before=positions[-2:])
                if target is not None:
                    _warn_of_misfit(body.boundary, target[0], len(positions))
            positions.append(shape)
    return np.stack(positions)


def _warn_of_misfit(boundary: TriangleMesh, surface: TriangleMesh, number: int) -> None:
    ways = ((boundary, surface), (surface, boundary))
    mean, far = surface_distance((nearest_on(first.vertices, second)[0], vertex_areas(first)) for first, second in ways)
    log.info("shape %d: %.3f mm from the observed surface on average, 95 %% below %.2f mm", number, mean, far)
    if mean > MAX_MISFIT_MM:
        log.warning(
            "shape %d stays %.2f mm from the observed surface on average (95 %% below %.2f mm): the body cannot reach "
            "all of it without inverted elements or crossing folds",
            number,
            mean,
            far,
        )


def positions_at(week: float, atlas: Floats, weeks: Sequence[float] | Floats, sizes: Floats) -> Floats:
    """Interpolate the (k, n, 3) positions of an atlas in k weeks linearly to a week; return (n, 3) positions.

    The later week is first aligned rigidly to the earlier one, with points weighted by their (n,) sizes.
    """
    first = int(np.clip(np.searchsorted(np.asarray(weeks), week, side="right") - 1, 0, len(weeks) - 2))
    part = (week - weeks[first]) / (weeks[first + 1] - weeks[first])
    motion = rigid_fit(atlas[first + 1], atlas[first], sizes)
    return np.asarray((1 - part) * atlas[first] + part * transform_points(atlas[first + 1], motion))


def resample_by_size(
    mesh: TetrahedralMesh, atlas: Floats, weeks: Sequence[float], norm_ml: Sequence[float] = ()
) -> tuple[Floats, AtlasAges]:
    """Return the (k, n, 3) positions of an atlas at its k weeks, resampled along its curve of volume, and the ages.

    `norm_ml` are volumes of a norm at these weeks, which the curve follows as well (`ages_by_size`).

    At each week the shape is that between the brains whose ages by size are around it, and the volume that of the
    curve through all brains.
    """
    sizes = vertex_sizes(mesh.vertices, linear_pieces(mesh))
    ages = ages_by_size(weeks, list(sizes_of(mesh, atlas)["volume_ml"]), norm_ml)
    shapes = np.stack([positions_at(week, atlas, ages.ages, sizes) for week in np.clip(weeks, *ages.ages[[0, -1]])])
    volumes = sizes_of(mesh, shapes)["volume_ml"]
    scales = [(ages.volume(week) / volume) ** (1 / 3) for week, volume in zip(weeks, volumes, strict=True)]
    centres = np.average(shapes, axis=1, weights=sizes)[:, None]
    return centres + np.array(scales)[:, None, None] * (shapes - centres), ages


def expected_positions(
    mesh: TetrahedralMesh,
    start_week: float,
    atlas: Floats,
    weeks: Sequence[float],
    *,
    also: Sequence[float] = (),
    smoothing_mm: float = DIFFERENCE_SMOOTHING_MM,
    fading_gw: float = FADING_GW,
) -> tuple[list[float], Floats]:
    """Return the weeks from the start on, and the (w, n, 3) positions in mm that are predicted for a mesh.

    The brain moves as the atlas does from the atlas' shape at the start week. Its individual difference from the atlas
    grows in proportion to the size as far as it is smooth (SD `smoothing_mm`; all of it with 0); finer differences fade
    with the time constant `fading_gw`.

    `mesh` is that of the start brain in mm, `atlas` (k, n, 3) the positions of its vertices in the atlas' k ascending
    `weeks`; `also` are further weeks.

    InputError if the start is long before the first week, or not before the last one.
    """
    if len(weeks) < 2 or not weeks[0] - BEFORE_GW <= start_week < weeks[-1]:
        raise InputError(
            "the atlas does not cover the growth of a brain of this week",
            found=f"a start at {start_week:g} GW and an atlas of {weeks[0]:g} to {weeks[-1]:g} GW",
            expected=f"two weeks or more, and a start from {weeks[0] - BEFORE_GW:g} GW to before {weeks[-1]:g} GW",
        )
    pieces = linear_pieces(mesh)
    sizes = vertex_sizes(mesh.vertices, pieces)

    def aligned(places: Floats, onto: Floats) -> Floats:
        return transform_points(places, rigid_fit(places, onto, sizes))

    start = aligned(positions_at(start_week, atlas, weeks, sizes), mesh.vertices)
    difference = mesh.vertices - start
    smooth = diffuse(mesh.vertices, pieces, difference, smoothing_mm)
    size = cell_sizes(start, pieces).sum()
    by_week = {start_week: mesh.vertices}
    # the path through shapes at almost the same time would be rough
    apart = [week for week in weeks if all(abs(week - other) >= MIN_SPACING_GW for other in (start_week, *also))]
    for week in sorted({*apart, *also}):
        if week > start_week + 1e-6:
            places = positions_at(week, atlas, weeks, sizes)
            scale = (cell_sizes(places, pieces).sum() / size) ** (1 / 3)
            fading = np.exp((start_week - week) / fading_gw)
            by_week[float(week)] = aligned(places, start) + scale * (smooth + fading * (difference - smooth))
    return list(by_week), np.stack(list(by_week.values()))


def predict_shapes(
    mesh: TetrahedralMesh,
    start_week: float,
    pairs: Sequence[Correspondence],
    surfaces: Sequence[TriangleMesh],
    weeks: Sequence[float],
    also: Sequence[float] = (),
    *,
    make_body: Callable[[TetrahedralMesh], FittedBody] | None = None,
    by_size: bool = True,
    norm_ml: Sequence[float] = (),
    smoothing_mm: float = DIFFERENCE_SMOOTHING_MM,
    fading_gw: float = FADING_GW,
    open_sulci: bool = False,
) -> tuple[list[float], Floats, dict[str, list[Floats]], AtlasAges | None]:
    """Return the weeks from the start on, the (w, n, 3) predicted positions of a mesh, and baselines of its boundary.

    With `by_size` the brain moves as the atlas resampled by size (`resample_by_size`, with volumes of a norm at the
    atlas' weeks, `norm_ml`, if they are known), whose ages are returned as well;
    else as its brains at their stated weeks. The baselines are simpler predictions of the boundary's vertices: `atlas`,
    the atlas' own brain; `atlas_deformed`, that brain with the whole individual difference; and `displaced`, the start
    moved by registration alone.

    `mesh` is that of the start brain; `pairs` lead from the start to the atlas' first week, and from each of its
    `weeks` to the next. `surfaces` are the atlas' pial surfaces, in the spaces of these correspondences. `also` are
    further weeks; `smoothing_mm` and `fading_gw` are those of `expected_positions`, `open_sulci` is that of
    `carry_sharply`. `make_body` makes bodies of the mesh, which follow the atlas' shapes and the predicted ones;
    without it, elements of these may be inverted.
    """
    used, sizes = boundary_surface(mesh)[1], vertex_sizes(mesh.vertices, linear_pieces(mesh))
    carried = carry_sharply(mesh, pairs, surfaces, make_body(mesh) if make_body else None, open_sulci=open_sulci)[1:]
    grown, ages = resample_by_size(mesh, carried, weeks, norm_ml) if by_size else (carried, None)
    individual = {"smoothing_mm": smoothing_mm, "fading_gw": fading_gw}
    shape_weeks, positions = expected_positions(mesh, start_week, grown, weeks, also=also, **individual)
    if make_body:
        body = make_body(mesh)
        found = [positions[0]]
        for shape in positions[1:]:
            body.follow(shape)
            found.append(body.draw(shape[used], before=found[-2:]))
        positions = np.stack(found)
    baselines = {"atlas": [positions_at(week, carried, weeks, sizes)[used] for week in shape_weeks]}
    for name, path in (("atlas_deformed", grown), ("displaced", carry_sharply(mesh, pairs, None)[1:])):
        _, places = expected_positions(mesh, start_week, path, weeks, also=also, smoothing_mm=0)
        baselines[name] = [at[used] for at in places]
    return shape_weeks, positions, baselines, ages


def sizes_of(mesh: TetrahedralMesh, positions: Sequence[Floats] | Floats) -> dict[str, Floats]:
    """Return area_cm2 and volume_ml (w,) of a mesh's boundary at w positions (n, 3)."""
    boundary, used = boundary_surface(mesh)
    surfaces = [TriangleMesh(places[used], boundary.faces) for places in positions]
    return {"area_cm2": np.array(list(map(area_cm2, surfaces))), "volume_ml": np.array(list(map(volume_ml, surfaces)))}
