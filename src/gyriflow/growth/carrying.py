"""Carry points, surfaces, meshes and regions from brain to brain.

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

MAX_OUTSIDE = 0.001
"""Largest share of points that may lie outside the grid of a displacement."""


def carry_over_weeks(points: Floats, deformations: Sequence[Deformation]) -> Floats:
    """Return the (w + 1, n, 3) positions of (n, 3) points: the given ones, and carried through w deformations in turn.

    InputError if points leave the grids of the deformations.
    """
    positions = [points]
    for number, deformation in enumerate(deformations):
        _require_on_grid(deformation, positions[-1], f"interval {number + 1} of {len(deformations)}")
        positions.append(carry(deformation, positions[-1]))
    return np.stack(positions)


def carry_mesh(mesh: TetrahedralMesh, later: Sequence[Correspondence], pose: Pose | None = None) -> Floats:
    """Return the (w + 1, n, 3) positions of a mesh's vertices: its own, and carried to w later weeks.

    All are in the worlds of the files, which correspondences refer to; `pose` is that of the mesh, if it is posed. With
    matched surfaces the boundary follows them and the inside is continued harmonically.
    """
    if pose is not None:
        mesh = TetrahedralMesh(transform_points(mesh.vertices, pose.inverse), mesh.tets)
    if matched := [pair for pair in later if isinstance(pair, MatchedSurfaces)]:
        return follow_inside(mesh, matched)
    return carry_over_weeks(mesh.vertices, [pair for pair in later if isinstance(pair, Deformation)])


def carry_surface(mesh: TriangleMesh, between: Sequence[Correspondence]) -> Floats:
    """Return the (n, 3) positions of a surface's vertices in the last brain; unchanged without correspondences."""
    if not between:
        return mesh.vertices
    matched = [pair for pair in between if isinstance(pair, MatchedSurfaces)]
    if matched:
        return np.asarray(follow_surfaces(mesh, matched)[-1])
    return np.asarray(carry_over_weeks(mesh.vertices, [pair for pair in between if isinstance(pair, Deformation)])[-1])


def carry_to_pose(mesh: TriangleMesh, pose: Pose, between: Sequence[Correspondence], later_pose: Pose) -> TriangleMesh:
    """Carry a brain's posed surface to a later brain, in the pose of the later brain's surface.

    Correspondences refer to the worlds of the files.
    """
    world = transformed(mesh, pose.inverse)
    return transformed(TriangleMesh(carry_surface(world, between), mesh.faces), later_pose.world)


def carry_regions(
    labels: NDArray[np.integer], source: TriangleMesh, target: TriangleMesh, between: Correspondence
) -> Ints:
    """Transfer the region labels of the (n,) vertices of `source` to those of `target`.

    The source is carried into the target's space. Each vertex of the target gets the label of the nearest point whose
    normal agrees.
    """
    if isinstance(between, Deformation):
        _require_on_grid(between, source.vertices, "the surface")
    shape = TriangleMesh(carry_surface(source, [between]), source.faces)
    return labels_at(match_points(target.vertices, vertex_normals(target), shape), labels)


def maps_on_template(
    maps: Mapping[str, NDArray], surface: TriangleMesh, template: TriangleMesh, between: Sequence[Correspondence]
) -> dict[str, NDArray]:
    """Resample maps at the vertices of a brain's surface to the (n,) vertices of a template.

    The template is carried into the brain's space. Each of its vertices gets the value at the nearest point whose
    normal agrees, interpolated linearly, or the nearest value of an integer map. `template_distance_mm` is the distance
    of that point. `between` leads from the template to the brain; empty if these are the same.
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
    outside = ((index < 0) | (index > last)).any(axis=1)
    if outside.mean() > MAX_OUTSIDE:
        distance = np.linalg.norm((index - np.clip(index, 0, last)) @ deformation.affine[:3, :3].T, axis=1)
        raise InputError(
            f"points lie outside the grid of the registration ({what})",
            found=f"{np.count_nonzero(outside)} of {len(points)} points, up to {distance.max():.3g} mm",
            expected="points inside the brain that was registered",
            remedy="The surface or mesh belongs to another brain, or is not in the pose of the registered volume.",
        )
