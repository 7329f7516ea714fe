"""What is carried from brain to brain: points over the weeks, regions to another brain's surface.

Brains correspond by registration, which carries any point, or by surfaces with matched vertices, which carry surfaces
and meshes.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..geometry.deformations import Correspondence, Deformation, MatchedSurfaces, carry, transform_points
from ..geometry.matching import labels_at, match_points, values_at
from ..geometry.poses import Pose
from ..geometry.tetrahedra import TetrahedralMesh
from ..geometry.triangles import Floats, Ints, TriangleMesh, transformed, vertex_normals
from .matched_surfaces import follow_inside, follow_surfaces

OUTSIDE = 0.001
"""Largest share of points that may lie beyond the grid that a displacement is known on."""


def carry_over_weeks(points: Floats, deformations: Sequence[Deformation]) -> Floats:
    """Return the (w + 1, n, 3) positions of (n, 3) points, the first as given, carried through w deformations in turn.

    InputError where points leave the grids that the deformations are known on.
    """
    positions = [points]
    for number, deformation in enumerate(deformations):
        _require_on_grid(deformation, positions[-1], f"interval {number + 1} of {len(deformations)}")
        positions.append(carry(deformation, positions[-1]))
    return np.stack(positions)


def carry_mesh(mesh: TetrahedralMesh, later: Sequence[Correspondence]) -> Floats:
    """Return the (w + 1, n, 3) positions of a mesh's vertices: as given, and carried to the later weeks.

    Along matched surfaces its boundary follows them, and the inside harmonically.
    """
    if matched := [pair for pair in later if isinstance(pair, MatchedSurfaces)]:
        return follow_inside(mesh, matched)
    return carry_over_weeks(mesh.vertices, [pair for pair in later if isinstance(pair, Deformation)])


def carry_surface(mesh: TriangleMesh, between: Sequence[Correspondence]) -> Floats:
    """Return the (n, 3) positions of a surface's vertices in the last brain, those given where there is no other."""
    if not between:
        return mesh.vertices
    matched = [pair for pair in between if isinstance(pair, MatchedSurfaces)]
    if matched:
        return np.asarray(follow_surfaces(mesh, matched)[-1])
    return np.asarray(carry_over_weeks(mesh.vertices, [pair for pair in between if isinstance(pair, Deformation)])[-1])


def carry_to_pose(mesh: TriangleMesh, pose: Pose, between: Sequence[Correspondence], later_pose: Pose) -> TriangleMesh:
    """Carry a brain's posed surface to a later brain, into the pose of that one's surface.

    Brains correspond in the worlds of their files.
    """
    world = transformed(mesh, pose.inverse)
    return transformed(TriangleMesh(carry_surface(world, between), mesh.faces), later_pose.world)


def carry_regions(
    labels: NDArray[np.integer], source: TriangleMesh, target: TriangleMesh, between: Correspondence
) -> Ints:
    """Return the region labels of the (n,) vertices of `source` at those of `target`.

    The source is carried into the target's space; each vertex of the target takes the label of the nearest point whose
    normal agrees.
    """
    if isinstance(between, Deformation):
        _require_on_grid(between, source.vertices, "the surface")
    shape = TriangleMesh(carry_surface(source, [between]), source.faces)
    return labels_at(match_points(target.vertices, vertex_normals(target), shape), labels)


def maps_on_template(
    maps: Mapping[str, NDArray], surface: TriangleMesh, template: TriangleMesh, between: Sequence[Correspondence]
) -> dict[str, NDArray]:
    """Return maps at the vertices of a brain's surface at the (n,) places of the vertices of a template.

    The template is carried into the brain's space; each of its vertices takes the value at the nearest point whose
    normal agrees, linear in between, and the nearest one of a map of whole numbers. `template_distance_mm` is how far
    away that point is. `between` leads from the template to the brain; nothing where these are one.
    """
    for pair in between:
        if isinstance(pair, Deformation):
            _require_on_grid(pair, template.vertices, "the template")
    shape = TriangleMesh(carry_surface(template, between), template.faces)
    match = match_points(shape.vertices, vertex_normals(shape), surface)
    at_template: dict[str, NDArray] = {
        name: labels_at(match, values) if (values == np.round(values)).all() else values_at(match, values)
        for name, values in maps.items()
    }
    return {**at_template, "template_distance_mm": match.distance_mm}


def _require_on_grid(deformation: Deformation, points: Floats, what: str) -> None:
    index = transform_points(points, np.linalg.inv(deformation.affine))
    last = np.array(deformation.displacement.shape[:3]) - 1
    beyond = ((index < 0) | (index > last)).any(axis=1)
    if beyond.mean() > OUTSIDE:
        away = np.linalg.norm((index - np.clip(index, 0, last)) @ deformation.affine[:3, :3].T, axis=1)
        raise InputError(
            f"points lie beyond the grid that the registration knows ({what})",
            found=f"{np.count_nonzero(beyond)} of {len(points)} points, up to {away.max():.3g} mm",
            expected="points inside the brain that was registered",
            remedy="The surface or mesh is not in the pose of the volume that was registered, or of another brain.",
        )
