"""Fit one surface onto another one close to it, smoothly."""

from collections.abc import Sequence

import numpy as np

from ..geometry.diffusion import diffuse
from ..geometry.matching import match_layers, match_points, values_at
from ..geometry.triangles import Floats, TriangleMesh, vertex_areas, vertex_normals

INNER_MM = 2.0
"""Depth below a surface of the tissue that distinguishes the banks of a sulcus: about that of the cortex."""
PULL_MM = (4.0, 2.5, 1.5, 1.0)
"""Smoothing (SD, mm) of the pull towards a surface, round by round."""
PULL_TOL = 1e-3
"""Relative tolerance of that smoothing; the next round makes up for the error."""
REACH_MM, REACH_BY_TISSUE_MM = 4.0, 8.0
"""Largest distance over which a surface pulls: to points matched by normals, and by the tissue below."""


def fit_onto_surface(
    moving: TriangleMesh, surface: TriangleMesh, pull_mm: Sequence[float] = PULL_MM, inner: Floats | None = None
) -> Floats:
    """Deform a surface smoothly onto another one close to it; return its (n, 3) vertices in mm.

    Each round pulls the vertices to the nearest points of the other surface whose normals agree. Vertices of the other
    surface also pull their nearest points, so that the fundus of a sulcus has an effect although it is nearest to no
    vertex. The pull is smoothed along the moving surface, in each round over `pull_mm`.

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
