"""Correspondence from surfaces that have the same vertices in every week, such as a surface atlas."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..geometry.alignment import angle_deg, rigid_fit
from ..geometry.deformations import MatchedSurfaces
from ..geometry.diffusion import harmonic_continuation
from ..geometry.matching import match_points, values_at
from ..geometry.tetrahedra import TetrahedralMesh, boundary_surface, linear_pieces
from ..geometry.triangles import Floats, TriangleMesh, flipped, signed_volume, vertex_areas, vertex_normals

MAX_DISTANCE_MM = 2.0
"""Largest mean distance of a mesh's surface from the matched surface that it follows."""
MAX_TURN_DEG = 30.0
"""Largest rotation between the matched vertices of two posed brains."""
MAX_SCATTER = 0.3
"""Largest root mean square distance of matched vertices after alignment and scaling, as a share of the size."""


def outward(mesh: TriangleMesh) -> TriangleMesh:
    """Return a surface with its triangles oriented outward."""
    return flipped(mesh) if signed_volume(mesh) < 0 else mesh


def match_surfaces(first: TriangleMesh, second: TriangleMesh) -> tuple[MatchedSurfaces, dict[str, float]]:
    """Match the surfaces of two posed brains by vertex number; return the match and measures of its quality.

    Triangles may be in any order and orientation. The measures are vertices, turn_deg, scatter (root mean square
    distance of the vertices after a similarity transform, as a share of the root mean square radius) and area_ratio.

    InputError if vertices or triangles differ, or if vertices with the same number are different places: equal
    triangles alone do not imply correspondence.
    """
    if len(first.vertices) != len(second.vertices) or not np.array_equal(_triangles(first), _triangles(second)):
        raise InputError(
            "the surfaces have different vertices or triangles",
            found=f"{len(second.vertices)} vertices and {len(second.faces)} triangles",
            expected=f"the same {len(first.vertices)} vertices and {len(first.faces)} triangles in both",
            remedy="Set growth.matched_surfaces to false, or leave out the brain that differs.",
        )
    first = outward(first)
    weights = vertex_areas(first)
    motion = rigid_fit(first.vertices, second.vertices, weights)
    aligned = (first.vertices - np.average(first.vertices, axis=0, weights=weights)) @ motion[:3, :3].T
    target = second.vertices - np.average(second.vertices, axis=0, weights=weights)
    sizes = [np.sqrt(np.average((places**2).sum(axis=1), weights=weights)) for places in (aligned, target)]
    variance = np.average(((aligned / sizes[0] - target / sizes[1]) ** 2).sum(axis=1), weights=weights)
    numbers = {
        "vertices": float(len(first.vertices)),
        "turn_deg": angle_deg(motion[:3, :3]),
        "scatter": float(np.sqrt(variance)),
        "area_ratio": float(vertex_areas(TriangleMesh(second.vertices, first.faces)).sum() / weights.sum()),
    }
    if numbers["turn_deg"] > MAX_TURN_DEG or numbers["scatter"] > MAX_SCATTER:
        raise InputError(
            "the surfaces have the same triangles, but their vertices do not correspond",
            found=f"a rotation of {numbers['turn_deg']:.0f}° between them, and a scatter of {numbers['scatter']:.2f}",
            expected=f"at most {MAX_TURN_DEG:g}° between posed brains, and {MAX_SCATTER:g} of the size",
            remedy="Set growth.matched_surfaces to false, or give surfaces whose vertices are matched.",
        )
    return MatchedSurfaces(first, second.vertices), numbers


def follow_surfaces(mesh: TriangleMesh, chain: Sequence[MatchedSurfaces]) -> Floats:
    """Return the (w + 1, n, 3) positions of a surface's vertices that follow w pairs of matched surfaces.

    Each vertex keeps its offset from the nearest point of the first matched surface with an agreeing normal; offsets
    rotate with the whole surface. The surface is that of the same brain in the first week, with other triangles.
    InputError if it is far from the first matched surface.
    """
    faces = chain[0].first.faces
    surfaces = np.stack([chain[0].first.vertices, *(pair.second for pair in chain)])
    start = TriangleMesh(surfaces[0], faces)
    match = match_points(mesh.vertices, vertex_normals(mesh), start)
    if match.distance_mm.mean() > MAX_DISTANCE_MM:
        raise InputError(
            "the surface does not belong to the first matched surface",
            found=f"{match.distance_mm.mean():.2f} mm from it on average, {match.distance_mm.max():.2f} mm at most",
            expected=f"at most {MAX_DISTANCE_MM:g} mm on average",
            remedy="Both must have the same pose and week.",
        )
    offsets, weights = mesh.vertices - values_at(match, start.vertices), vertex_areas(start)
    turns = [rigid_fit(start.vertices, surface, weights)[:3, :3] for surface in surfaces]
    return np.stack(
        [values_at(match, surface) + offsets @ turn.T for surface, turn in zip(surfaces, turns, strict=True)]
    )


def follow_inside(mesh: TetrahedralMesh, chain: Sequence[MatchedSurfaces]) -> Floats:
    """Return the (w + 1, n, 3) positions of a tetrahedral mesh's vertices that follow matched surfaces.

    The boundary follows them, and the displacement inside is harmonic.
    """
    boundary, used = boundary_surface(mesh)
    followed = follow_surfaces(boundary, chain)
    moves = (followed - boundary.vertices).transpose(1, 0, 2).reshape(len(used), -1)
    inside = harmonic_continuation(mesh.vertices, linear_pieces(mesh), used)(moves)
    return np.asarray(mesh.vertices + inside.reshape(len(mesh.vertices), len(followed), 3).transpose(1, 0, 2))


def _triangles(mesh: TriangleMesh) -> NDArray[np.integer]:
    return np.unique(np.sort(mesh.faces, axis=1), axis=0)
