"""What is to be expected of a brain: its mesh carried sharply through an atlas' weeks, with what sets it apart kept."""

from collections.abc import Sequence
from itertools import groupby

import numpy as np

from ..errors import InputError
from ..geometry.alignment import rigid_fit
from ..geometry.deformations import Correspondence, Deformation, MatchedSurfaces, transform_points
from ..geometry.diffusion import cell_sizes, diffuse, harmonic_continuation, vertex_sizes
from ..geometry.matching import match_points, values_at
from ..geometry.tetrahedra import TetrahedralMesh, boundary_surface, linear_pieces
from ..geometry.triangles import Floats, TriangleMesh, area_cm2, vertex_areas, vertex_normals, volume_ml
from ..settings.growth import BEFORE_GW
from .carrying import carry_over_weeks
from .matched_surfaces import follow_surfaces

PULL_MM = (4.0, 3.0, 2.0, 1.5, 1.0, 1.0, 1.0)
"""Standard deviations that the pull towards a surface is smoothed with, round by round."""
REACH_MM = 4.0
"""Largest distance over which a surface pulls."""
OWN_MM = 8.0
"""Standard deviation of the Gaussian that what sets a brain apart from the atlas is smoothed with.

What is smaller than a gyrus says nothing of folds that are still to come.
"""
FADING_GW = 4.0
"""Time in which what is smaller fades: of 1, 4 and 16 weeks the best for invented individuals, see docs/science.md."""


def fit_onto_surface(moving: TriangleMesh, surface: TriangleMesh) -> Floats:
    """Return the (n, 3) vertices of a surface moved smoothly onto another one that lies near it, in mm.

    Each round pulls the vertices to the nearest points of the other surface whose normals agree, and to those vertices
    of the other surface that find their nearest point beside them, so that the fundus of a sulcus pulls although no
    vertex is nearest to it. The pull is smoothed along the moving surface.
    """
    vertices, faces = moving.vertices, moving.faces
    normals, areas = vertex_normals(surface), vertex_areas(surface)
    for spread in PULL_MM:
        now = TriangleMesh(vertices, faces)
        areas_now = vertex_areas(now)
        there = match_points(vertices, vertex_normals(now), surface)
        weight = areas_now * (there.agrees & (there.distance_mm < REACH_MM))
        pull = (values_at(there, surface.vertices) - vertices) * weight[:, None]
        back = match_points(surface.vertices, normals, now)
        shares = back.weights * (areas * (back.agrees & (back.distance_mm < REACH_MM)))[:, None]
        missing = surface.vertices - values_at(back, vertices)
        np.add.at(weight, back.corners, shares)
        np.add.at(pull, back.corners, shares[..., None] * missing[:, None])
        smooth = diffuse(
            vertices, faces, np.column_stack([pull, weight]) / np.maximum(areas_now, 1e-9)[:, None], spread
        )
        move = smooth[:, :3] / np.maximum(smooth[:, 3:], 1e-3)
        # a mean of pulls is no longer than these; beside obtuse faces, smoothed weights may come out as zero or less
        length = np.linalg.norm(move, axis=1, keepdims=True)
        vertices = vertices + move * np.minimum(1.0, REACH_MM / np.maximum(length, 1e-9))
    return np.asarray(vertices)


def carry_sharply(
    mesh: TetrahedralMesh, pairs: Sequence[Correspondence], surfaces: Sequence[TriangleMesh] | None
) -> Floats:
    """Return the (w + 1, n, 3) positions of a mesh's vertices carried through w brains, its boundary on theirs.

    Registration smooths: it carries a surface to within half a millimetre of the brain's own and flattens its folds. So
    the boundary is fitted onto that brain's surface week by week, and the inside goes along harmonically. Matched
    surfaces need no fit: a run of them is followed from where the boundary lies on the first.

    The mesh is of the first brain, `pairs` lead from each brain to the next, and `surfaces` are the pial ones of the
    others, all in the spaces that these correspond in. Without surfaces nothing is fitted.

    InputError where points leave the grid of a registration, or the boundary lies beside matched surfaces.
    """
    boundary, used = boundary_surface(mesh)
    continued = harmonic_continuation(mesh.vertices, linear_pieces(mesh), used)
    positions = [mesh.vertices]

    def go(places: Floats, moved: Floats) -> None:
        positions.append(places + continued(moved - places[used]))

    for _, group in groupby(enumerate(pairs), lambda numbered: type(numbered[1])):
        numbered, before = list(group), positions[-1]
        if matched := [pair for _, pair in numbered if isinstance(pair, MatchedSurfaces)]:
            for moved in follow_surfaces(TriangleMesh(before[used], boundary.faces), matched)[1:]:
                go(before, moved)
        for number, pair in numbered:
            if isinstance(pair, Deformation):
                places = carry_over_weeks(positions[-1], [pair])[-1]
                carried = TriangleMesh(places[used], boundary.faces)
                go(places, carried.vertices if surfaces is None else fit_onto_surface(carried, surfaces[number]))
    return np.stack(positions)


def positions_at(week: float, atlas: Floats, weeks: Sequence[float], sizes: Floats) -> Floats:
    """Return the (n, 3) positions of an atlas at a week from its (k, n, 3) in k weeks, linear between two of them.

    The later one is laid onto the earlier rigidly, points counted by their (n,) sizes.
    """
    first = int(np.clip(np.searchsorted(np.asarray(weeks), week, side="right") - 1, 0, len(weeks) - 2))
    part = (week - weeks[first]) / (weeks[first + 1] - weeks[first])
    motion = rigid_fit(atlas[first + 1], atlas[first], sizes)
    return np.asarray((1 - part) * atlas[first] + part * transform_points(atlas[first + 1], motion))


def expected_positions(
    mesh: TetrahedralMesh,
    start_week: float,
    atlas: Floats,
    weeks: Sequence[float],
    *,
    also: Sequence[float] = (),
    own_mm: float = OWN_MM,
) -> tuple[list[float], Floats]:
    """Return the weeks from the start on, and the (w, n, 3) positions in which a mesh is expected then, in mm.

    A brain moves as the atlas does from where the atlas is at its week, and keeps what sets it apart from the atlas, in
    proportion to the size, as far as that is smooth (`own_mm`, with 0 all of it); what is finer fades (`FADING_GW`).

    The mesh is the start brain's, in mm, `atlas` (k, n, 3) the positions of its vertices in the atlas' k ascending
    `weeks`; `also` are further weeks that are wanted.

    InputError where the start is long before the first week or not before the last one.
    """
    if len(weeks) < 2 or not weeks[0] - BEFORE_GW <= start_week < weeks[-1]:
        raise InputError(
            "the atlas does not tell how a brain of this week grows",
            found=f"a start at {start_week:g} GW and an atlas of {weeks[0]:g} to {weeks[-1]:g} GW",
            expected=f"two weeks or more, and a start from {weeks[0] - BEFORE_GW:g} GW to before {weeks[-1]:g} GW",
        )
    pieces = linear_pieces(mesh)
    sizes = vertex_sizes(mesh.vertices, pieces)

    def laid_onto(places: Floats, onto: Floats) -> Floats:
        return transform_points(places, rigid_fit(places, onto, sizes))

    now = laid_onto(positions_at(start_week, atlas, weeks, sizes), mesh.vertices)
    apart = mesh.vertices - now
    smooth = diffuse(mesh.vertices, pieces, apart, own_mm)
    size = cell_sizes(now, pieces).sum()
    by_week = {start_week: mesh.vertices}
    for week in sorted({*weeks, *also}):
        if week > start_week + 1e-6:
            places = positions_at(week, atlas, weeks, sizes)
            scale = (cell_sizes(places, pieces).sum() / size) ** (1 / 3)
            fading = np.exp((start_week - week) / FADING_GW)
            by_week[float(week)] = laid_onto(places, now) + scale * (smooth + fading * (apart - smooth))
    return list(by_week), np.stack(list(by_week.values()))


def predict_shapes(
    mesh: TetrahedralMesh,
    start_week: float,
    pairs: Sequence[Correspondence],
    surfaces: Sequence[TriangleMesh],
    weeks: Sequence[float],
    also: Sequence[float] = (),
) -> tuple[list[float], Floats, dict[str, list[Floats]]]:
    """Return the weeks from the start on, the (w, n, 3) positions in which a mesh is expected, and its boundary's.

    The latter are where simpler ways put the boundary's vertices: `atlas`, the atlas' brain itself, `atlas_deformed`,
    this brain with all that sets the start apart from it, and `displaced`, the start moved as registration alone sees
    the atlas move.

    The mesh is the start brain's; `pairs` lead from the start to the atlas' first week, and from each of its `weeks` to
    the next. `surfaces` are the atlas' pial ones, all in the spaces that they correspond in. `also` are further weeks.
    """
    used, sizes = boundary_surface(mesh)[1], vertex_sizes(mesh.vertices, linear_pieces(mesh))
    carried = carry_sharply(mesh, pairs, surfaces)[1:]
    shape_weeks, positions = expected_positions(mesh, start_week, carried, weeks, also=also)
    others = {"atlas": [positions_at(week, carried, weeks, sizes)[used] for week in shape_weeks]}
    for name, way in (("atlas_deformed", carried), ("displaced", carry_sharply(mesh, pairs, None)[1:])):
        _, places = expected_positions(mesh, start_week, way, weeks, also=also, own_mm=0)
        others[name] = [at[used] for at in places]
    return shape_weeks, positions, others


def sizes_of(mesh: TetrahedralMesh, positions: Sequence[Floats]) -> dict[str, Floats]:
    """Return the area_cm2 and volume_ml (w,) that a mesh's boundary has and encloses at w positions (n, 3)."""
    boundary, used = boundary_surface(mesh)
    surfaces = [TriangleMesh(places[used], boundary.faces) for places in positions]
    return {
        "area_cm2": np.array(list(map(area_cm2, surfaces))),
        "volume_ml": np.array(list(map(volume_ml, surfaces))),
    }
