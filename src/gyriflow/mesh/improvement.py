"""Improve the few flat elements of a mesh by moving their vertices a little."""

import logging
from dataclasses import dataclass

import numpy as np

from ..geometry.tetrahedra import (
    MIN_RADIUS_RATIO,
    TetrahedralMesh,
    boundary_surface,
    radius_ratios,
)
from ..geometry.triangles import Floats, Ints, Mask

log = logging.getLogger(__name__)

WANTED_RATIO = 1.5 * MIN_RADIUS_RATIO
"""Radius ratio that elements are improved to."""
MAX_FLAT = 200
"""Number of flat elements above which a mesh is not improved but refused as it is."""
ROUNDS = 10
STEPS = (0.3, 0.1, 0.03)
"""Lengths of the moves that are tried, as a fraction of the element's longest edge."""
MAX_SURFACE_STEP = 0.05
"""Largest move of a vertex of the surface, likewise."""


def improve_flat_elements(mesh: TetrahedralMesh) -> TetrahedralMesh:
    """Return a linear mesh whose flattest elements are improved; the mesh itself if
    none is flat.

    A vertex is moved from the opposite face or along the line between middle edges if
    that raises the least radius ratio around it; vertices of the surface move less than
    a twentieth of an edge.
    """
    ratios = radius_ratios(mesh)
    flat = np.flatnonzero(ratios < MIN_RADIUS_RATIO)
    if not 0 < len(flat) <= MAX_FLAT:
        return mesh
    vertices = mesh.vertices.copy()
    _, outer = boundary_surface(mesh)
    on_surface = np.zeros(len(vertices), dtype=bool)
    on_surface[outer] = True
    for element in flat.tolist():
        for _ in range(ROUNDS):
            if signed_ratios(vertices[mesh.tets[[element]]])[0] >= WANTED_RATIO:
                break
            best: Move | None = None
            for vertex in mesh.tets[element].tolist():
                move = _best_move(vertices, mesh.tets, element, vertex, on_surface)
                if move and (best is None or move.gain > best.gain):
                    best = move
            if best is None:
                break
            vertices[best.vertex] = best.place
    improved = TetrahedralMesh(vertices, mesh.tets)
    log.info(
        "%d flat elements improved, least radius ratio from %.4f to %.4f",
        len(flat),
        ratios[flat].min(),
        radius_ratios(improved)[flat].min(),
    )
    return improved


@dataclass(frozen=True, eq=False)
class Move:
    """A move of a vertex to a place (3,), and its gain of the least ratio around."""

    gain: float
    vertex: int
    place: Floats


def _best_move(
    vertices: Floats,
    tets: Ints,
    element: int,
    vertex: int,
    on_surface: Mask,
) -> Move | None:
    """Return the best move of a vertex of an element; None if none gains."""
    star = tets[(tets == vertex).any(axis=1)]
    corners = tets[element]
    start = vertices[vertex]
    others = vertices[corners[corners != vertex]]
    edges = start - others
    longest = float(np.linalg.norm(edges, axis=1).max())
    normal = np.cross(others[1] - others[0], others[2] - others[0])
    across = start - others.mean(axis=0)
    largest_step = MAX_SURFACE_STEP if on_surface[vertex] else np.inf
    least = signed_ratios(vertices[star]).min()
    best = None
    for direction in (normal, across, *edges):
        length = np.linalg.norm(direction)
        if length == 0:
            continue
        for step in STEPS:
            size = min(step, largest_step)
            for sign in (1.0, -1.0):
                place = start + sign * size * longest / length * direction
                trial = vertices[star]
                trial[star == vertex] = place
                gain = float(signed_ratios(trial).min() - least)
                if gain > (best.gain if best else 0.0):
                    best = Move(gain, vertex, place)
    return best


def signed_ratios(corners: Floats) -> Floats:
    """Return the (m,) radius ratios of linear elements with (m, 4, 3) corners, negative
    for inverted ones."""
    edges = corners[:, 1:] - corners[:, :1]
    signs = np.sign(np.linalg.det(edges))
    vertices = corners.reshape(-1, 3)
    tets = np.arange(len(vertices)).reshape(-1, 4)
    ratios = radius_ratios(TetrahedralMesh(vertices, tets))
    return signs * ratios
