"""Correspondence from surfaces that have the same vertices in every week, such as a surface atlas."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..geometry.diffusion import continue_harmonically
from ..geometry.matching import match_points, values_at
from ..geometry.tetrahedra import TetrahedralMesh, boundary_surface
from ..geometry.triangles import Floats, TriangleMesh, vertex_normals

AWAY_MM = 2.0
"""Largest mean distance of a surface's vertices from the first week's surface that they are to follow."""


def positions_by_week(surfaces: Mapping[float, TriangleMesh]) -> tuple[list[float], Floats]:
    """Returns the ascending weeks and the (w, n, 3) positions of vertex-matched surfaces.

    InputError where the surfaces differ in their vertices' number or in their faces.
    """
    weeks = sorted(surfaces)
    first = surfaces[weeks[0]]
    for week in weeks[1:]:
        mesh = surfaces[week]
        if mesh.vertices.shape != first.vertices.shape or not np.array_equal(mesh.faces, first.faces):
            raise InputError(
                f"the surface of week {week:g} has other vertices or faces than that of week {weeks[0]:g}",
                found=f"{len(mesh.vertices)} vertices, {len(mesh.faces)} faces",
                expected=f"the same {len(first.vertices)} vertices and {len(first.faces)} faces in every week",
                remedy="Such surfaces are not matched: use the registration of volumes.",
            )
    return weeks, np.stack([surfaces[week].vertices for week in weeks])


def follow_surfaces(mesh: TriangleMesh, surfaces: Floats, faces: NDArray[np.integer]) -> Floats:
    """Returns the (w, n, 3) positions of a surface's vertices that go along with matched surfaces near it.

    Each vertex keeps its distance from the point of the first week's surface that is nearest with an agreeing normal,
    and moves as that point does.

    Parameters
    ----------
    mesh
        A surface of the first week: of the same brain, with other triangles.
    surfaces, faces
        (w, k, 3) positions of the matched surfaces' vertices, and their triangles.

    InputError where the surface lies elsewhere.
    """
    match = match_points(mesh.vertices, vertex_normals(mesh), TriangleMesh(surfaces[0], faces.astype(np.int64)))
    if match.distance_mm.mean() > AWAY_MM:
        raise InputError(
            "the surface is not that of the matched surfaces' first week",
            found=f"{match.distance_mm.mean():.2f} mm from it on average, {match.distance_mm.max():.2f} mm at most",
            expected=f"at most {AWAY_MM:g} mm on average",
            remedy="Both must be in one pose and of one week.",
        )
    start = values_at(match, surfaces[0])
    return np.stack([mesh.vertices + values_at(match, week) - start for week in surfaces])


def follow_inside(mesh: TetrahedralMesh, surfaces: Floats, faces: NDArray[np.integer]) -> Floats:
    """Returns the (w, n, 3) positions of a tetrahedral mesh's vertices that go along with matched surfaces.

    Its boundary follows them; the displacement inside is harmonic, as smooth as the boundary allows.
    """
    boundary, used = boundary_surface(mesh)
    along = follow_surfaces(boundary, surfaces, faces)
    moves = (along - along[0]).transpose(1, 0, 2).reshape(len(used), -1)
    inside = continue_harmonically(mesh.vertices, mesh.tets, used, moves)
    return mesh.vertices + inside.reshape(len(mesh.vertices), len(surfaces), 3).transpose(1, 0, 2)
