"""Carry points, surfaces, meshes and regions from brain to brain.

Brains correspond by registration, which carries any point, or by surfaces that have the
same vertices in every week, such as those of a surface atlas, which carry surfaces and
meshes.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..geometry.alignment import angle_deg, rigid_fit
from ..geometry.deformations import (
    Correspondence,
    Deformation,
    MatchedSurfaces,
    carry,
    transform_points,
)
from ..geometry.matching import labels_at, match_surface, values_at
from ..geometry.triangles import (
    Floats,
    Indices,
    Ints,
    TriangleMesh,
    outward,
    vertex_areas,
)

MAX_DISTANCE_MM = 2.0
"""Largest mean distance of a mesh's surface from the matched surface that it
follows."""
MAX_TURN_DEG = 30.0
"""Largest rotation between the matched vertices of two posed brains."""
MAX_SCATTER = 0.3
"""Largest root mean square distance of matched vertices after alignment and scaling, as
a share of the size."""
MAX_OUTSIDE = 0.001
"""Largest share of points that may lie outside the grid of a displacement."""


def match_surfaces(
    first: TriangleMesh, second: TriangleMesh
) -> tuple[MatchedSurfaces, dict[str, float]]:
    """Match the surfaces of two posed brains by vertex number; return the match and
    measures of its quality.

    Triangles may be in any order and orientation. The measures are vertices, turn_deg,
    scatter (root mean square distance of the vertices after a similarity transform, as
    a share of the root mean square radius) and area_ratio.

    InputError if vertices or triangles differ, or if vertices with the same number are
    different places: equal triangles alone do not imply correspondence.
    """
    has_same_number = len(first.vertices) == len(second.vertices)
    if not has_same_number or not np.array_equal(
        _triangles(first),
        _triangles(second),
    ):
        raise InputError(
            "the surfaces have different vertices or triangles",
            found=f"{len(second.vertices)} vertices and {len(second.faces)} triangles",
            expected=(
                f"the same {len(first.vertices)} vertices and {len(first.faces)}"
                " triangles in both"
            ),
            remedy=(
                "Set growth.matched_surfaces to false, or leave out the brain that"
                " differs."
            ),
        )
    first = outward(first)
    weights = vertex_areas(first)
    later_areas = vertex_areas(TriangleMesh(second.vertices, first.faces))
    motion = rigid_fit(first.vertices, second.vertices, weights)
    rotation = motion[:3, :3]
    turned = _from_centre(first.vertices, weights) @ rotation.T
    target = _from_centre(second.vertices, weights)
    scaled = turned / _radius(turned, weights)
    scaled_target = target / _radius(target, weights)
    turn_deg = angle_deg(rotation)
    scatter = _radius(scaled - scaled_target, weights)
    if turn_deg > MAX_TURN_DEG or scatter > MAX_SCATTER:
        raise InputError(
            "the surfaces have the same triangles, but their vertices do not"
            " correspond",
            found=(
                f"a rotation of {turn_deg:.0f}° between them, and a scatter of"
                f" {scatter:.2f}"
            ),
            expected=(
                f"at most {MAX_TURN_DEG:g}° between posed brains, and {MAX_SCATTER:g}"
                " of the size"
            ),
            remedy=(
                "Set growth.matched_surfaces to false, or give surfaces whose vertices"
                " are matched."
            ),
        )
    numbers = {
        "vertices": float(len(first.vertices)),
        "turn_deg": turn_deg,
        "scatter": scatter,
        "area_ratio": float(later_areas.sum() / weights.sum()),
    }
    return MatchedSurfaces(first, second.vertices), numbers


def _triangles(mesh: TriangleMesh) -> Ints:
    """Return the triangles in one order, whatever their orientation."""
    return np.unique(
        np.sort(mesh.faces, axis=1),
        axis=0,
    )


def _from_centre(points: Floats, weights: Floats) -> Floats:
    return points - np.average(points, axis=0, weights=weights)


def _radius(points: Floats, weights: Floats) -> float:
    """Return the root mean square distance of (n, 3) points from the origin."""
    squares = (points**2).sum(axis=1)
    return float(np.sqrt(np.average(squares, weights=weights)))


def follow_surfaces(mesh: TriangleMesh, chain: Sequence[MatchedSurfaces]) -> Floats:
    """Return the (w + 1, n, 3) positions of a surface's vertices that follow w pairs of
    matched surfaces.

    Each vertex keeps its offset from the nearest point of the first matched surface
    with an agreeing normal; offsets rotate with the whole surface. The surface is that
    of the same brain in the first week, with other triangles. InputError if it is far
    from the first matched surface.
    """
    start = chain[0].first
    match = match_surface(mesh, start)
    if match.distance_mm.mean() > MAX_DISTANCE_MM:
        raise InputError(
            "the surface does not belong to the first matched surface",
            found=(
                f"{match.distance_mm.mean():.2f} mm from it on average,"
                f" {match.distance_mm.max():.2f} mm at most"
            ),
            expected=f"at most {MAX_DISTANCE_MM:g} mm on average",
            remedy="Both must have the same pose and week.",
        )
    offsets = mesh.vertices - values_at(match, start.vertices)
    weights = vertex_areas(start)
    positions = []
    for surface in (start.vertices, *(pair.second for pair in chain)):
        turn = rigid_fit(start.vertices, surface, weights)[:3, :3]
        positions.append(values_at(match, surface) + offsets @ turn.T)
    return np.stack(positions)


def carry_over_weeks(points: Floats, deformations: Sequence[Deformation]) -> Floats:
    """Return the (w + 1, n, 3) positions of (n, 3) points: the given ones, and carried
    through w deformations in turn.

    InputError if points leave the grids of the deformations.
    """
    positions = [points]
    count = len(deformations)
    for number, deformation in enumerate(deformations, start=1):
        interval = f"interval {number} of {count}"
        _require_on_grid(deformation, points, interval)
        points = carry(deformation, points)
        positions.append(points)
    return np.stack(positions)


def carry_surface(mesh: TriangleMesh, between: Sequence[Correspondence]) -> Floats:
    """Return the (n, 3) positions of a surface's vertices in the last brain; unchanged
    without correspondences."""
    if not between:
        return mesh.vertices
    matched = [pair for pair in between if isinstance(pair, MatchedSurfaces)]
    if matched:
        return follow_surfaces(mesh, matched)[-1]
    registered = [pair for pair in between if isinstance(pair, Deformation)]
    return carry_over_weeks(mesh.vertices, registered)[-1]


def carry_regions(
    labels: Indices,
    source: TriangleMesh,
    target: TriangleMesh,
    between: Correspondence,
) -> Ints:
    """Transfer the region labels of the (n,) vertices of `source` to those of `target`.

    The source is carried into the target's space. Each vertex of the target gets the
    label of the nearest point whose normal agrees.
    """
    if isinstance(between, Deformation):
        _require_on_grid(between, source.vertices, "the surface")
    shape = TriangleMesh(carry_surface(source, [between]), source.faces)
    return labels_at(match_surface(target, shape), labels)


def maps_on_template(
    maps: Mapping[str, NDArray],
    surface: TriangleMesh,
    template: TriangleMesh,
    between: Sequence[Correspondence],
) -> dict[str, NDArray]:
    """Resample maps at the vertices of a brain's surface to the (n,) vertices of a
    template.

    The template is carried into the brain's space. Each of its vertices gets the value
    at the nearest point whose normal agrees, interpolated linearly, or the nearest
    value of an integer map. `template_distance_mm` is the distance of that point.
    `between` leads from the template to the brain; empty if these are the same.
    """
    for pair in between:
        if isinstance(pair, Deformation):
            _require_on_grid(pair, template.vertices, "the template")
    shape = TriangleMesh(carry_surface(template, between), template.faces)
    match = match_surface(shape, surface)
    at_template: dict[str, NDArray] = {}
    for name, values in maps.items():
        is_integer = (values == np.round(values)).all()
        resample = labels_at if is_integer else values_at
        at_template[name] = resample(match, values)
    return {**at_template, "template_distance_mm": match.distance_mm}


def _require_on_grid(
    deformation: Deformation,
    points: Floats,
    what: str,
) -> None:
    """Raise InputError if more than a few of (n, 3) points in mm lie outside the grid;
    `what` is said of them."""
    index = transform_points(points, np.linalg.inv(deformation.affine))
    last = np.array(deformation.displacement.shape[:3]) - 1
    beyond = index - np.clip(index, 0, last)
    is_outside = beyond.any(axis=1)
    if is_outside.mean() > MAX_OUTSIDE:
        beyond_mm = beyond @ deformation.affine[:3, :3].T
        distance_mm = np.linalg.norm(beyond_mm, axis=1)
        raise InputError(
            f"points lie outside the grid of the registration ({what})",
            found=(
                f"{np.count_nonzero(is_outside)} of {len(points)} points, up to"
                f" {distance_mm.max():.3g} mm"
            ),
            expected="points inside the brain that was registered",
            remedy=(
                "The surface or mesh belongs to another brain, or is not in the pose of"
                " the registered volume."
            ),
        )
