"""Fill a closed surface with tetrahedra of given sizes, and refuse a mesh that does not
match its inside."""

import logging
from typing import Any

import igl
import numpy as np
from scipy.spatial import cKDTree

from ..errors import MeshError
from ..geometry.matching import faces_that_cross
from ..geometry.remeshing import remesh, untangle
from ..geometry.tetrahedra import (
    TetrahedralMesh,
    boundary_surface,
    grid,
    signed_volumes,
)
from ..geometry.triangles import (
    Floats,
    TriangleMesh,
    edges,
    euler_number,
    face_components,
    is_closed,
    order_along_curve,
    signed_volume,
)
from ..grouping import counted
from ..settings.terms import Mesher
from .improvement import improve_flat_elements
from .meshers import run_mesher
from .nodes import curve_edges
from .splitting import split_inner_edges

log = logging.getLogger(__name__)
TIME_LIMIT_S = 3600.0
"""After which a mesher is stopped."""
ENVELOPE_MM = 0.1
"""Largest distance of fTetWild's surface from the pial surface."""
FINE_DEPTH_EDGES = 2.5
"""Elements of fTetWild are as fine as at the surface down to so many edges of it ..."""
EDGE_GROWTH = 0.5
"""... and grow by this part of each mm below."""
OTHER_VOLUME = 0.05
"""A mesh whose volume differs by more than this part is that of another shape; nearer
ones are left to the gates."""
REGULAR_VOLUME = 1 / (6 * np.sqrt(2))
"""Volume of the regular tetrahedron, in edges cubed."""


def _edge_length_at(
    depth: Floats,
    surface_edge_mm: float,
    core_edge_mm: float,
    order: int = 1,
) -> Floats:
    """Return edge lengths in mm of elements at depths in mm; deep down, nodes of both
    orders have the same distance."""
    below = np.maximum(depth - FINE_DEPTH_EDGES / order * surface_edge_mm, 0.0)
    return np.minimum(surface_edge_mm + order * EDGE_GROWTH * below, core_edge_mm)


def _background_mesh(
    surface: TriangleMesh,
    surface_edge_mm: float,
    core_edge_mm: float,
    order: int = 1,
) -> tuple[TetrahedralMesh, Floats]:
    """Return a regular tetrahedral grid over the inside of the surface and the edge
    lengths in mm at its vertices.

    fTetWild also fills the box around it with elements as long as those of the core,
    which are removed in the end.
    """
    spacing = max(2 * surface_edge_mm, 1.0)
    low = surface.vertices.min(axis=0) - spacing
    high = surface.vertices.max(axis=0) + spacing
    ticks = []
    for start, end in zip(low, high, strict=True):
        count = int(np.ceil((end - start) / spacing)) + 1
        ticks.append(start + spacing * np.arange(count))
    background = grid(ticks)
    places = background.vertices
    depth, _ = cKDTree(surface.vertices).query(places)
    winding = igl.fast_winding_number(surface.vertices, surface.faces, places)
    is_needed = (winding > 0.5) | (depth < spacing)
    needed = background.tets[is_needed[background.tets].any(axis=1)]
    lengths = _edge_length_at(depth, surface_edge_mm, core_edge_mm, order)
    return TetrahedralMesh(places, needed), lengths


def tetrahedralise(
    surface: TriangleMesh,
    *,
    surface_edge_mm: float,
    core_edge_mm: float,
    time_limit_s: float = TIME_LIMIT_S,
    mesher: Mesher = "pytetwild",
    order: int = 1,
) -> TetrahedralMesh:
    """Return a tetrahedral mesh of the inside of a closed, outward surface in mm, of
    one or more components.

    `surface_edge_mm` and `core_edge_mm` are distances of neighbouring nodes at the
    surface and deep inside, for linear elements (`order` 1) and quadratic ones (2),
    which are curved to follow the surface. "pytetwild" (fTetWild) makes a surface
    within `ENVELOPE_MM`, and sizes elements by depth; "tetgen" keeps the remeshed
    surface exactly, and elements grow from it as fast as their quality allows.
    MeshError where the surface is open or inside out, the mesher fails or takes longer
    than `time_limit_s`, or its mesh is not the inside of the surface.
    """
    if not is_closed(surface) or signed_volume(surface) <= 0:
        # the mesher would fill holes without a word
        raise MeshError("the surface to be filled must be closed and face outwards")
    edge = order * surface_edge_mm
    core = max(order * core_edge_mm, edge)
    arrays: dict[str, Any]
    if mesher == "tetgen":
        even = _even_surface(surface, edge)
        arrays = {
            "vertices": even.vertices,
            "faces": even.faces,
            "volume": REGULAR_VOLUME * core**3,
        }
    else:
        diagonal = np.linalg.norm(np.ptp(surface.vertices, axis=0))
        background, lengths = _background_mesh(surface, edge, core, order)
        arrays = {
            "vertices": surface.vertices,
            "faces": surface.faces,
            "bg_vertices": background.vertices,
            "bg_tets": background.tets,
            "bg_values": lengths,
            "edge": core,
            "epsilon": ENVELOPE_MM / float(diagonal),
        }
    mesh = run_mesher(mesher, arrays, time_limit_s)
    if order == 2:
        mesh = split_inner_edges(mesh)
    mesh = improve_flat_elements(mesh)
    _refuse_other_shape(mesh, surface)
    mesh = _neighbours_together(mesh)
    return curve_edges(mesh, surface) if order == 2 else mesh


def _neighbours_together(mesh: TetrahedralMesh) -> TetrahedralMesh:
    """Return a mesh with its nodes in the order of a curve, and its elements in that of
    their first nodes.

    Neighbours are near each other in memory then: surfaces of the mesh are remeshed in
    half the time.
    """
    order = order_along_curve(mesh.vertices)
    tets = np.argsort(order)[mesh.tets]
    by_node = tets.min(axis=1).argsort(kind="stable")
    return TetrahedralMesh(mesh.vertices[order], tets[by_node])


def _even_surface(surface: TriangleMesh, edge_mm: float) -> TriangleMesh:
    """Remesh a surface with even triangles, fit to bound a mesh as it is; MeshError
    where it cuts itself."""
    even = remesh(surface, edge_mm)
    crossing = len(faces_that_cross(even))
    if crossing:
        even, _, _ = untangle(even)
        crossing = len(faces_that_cross(even))
    log.info(
        "surface remeshed to %d faces, edges of %.3f mm, %d faces cross",
        len(even.faces),
        edge_mm,
        crossing,
    )
    if crossing:
        raise MeshError(
            "the surface cuts itself and cannot be kept as it is",
            found=(
                f"{crossing} faces that cross others after remeshing to edges of"
                f" {edge_mm:.2f} mm"
            ),
            expected="none",
        )
    return even


def _refuse_other_shape(mesh: TetrahedralMesh, surface: TriangleMesh) -> None:
    faults = []
    volumes = signed_volumes(mesh)
    n_inverted = int((volumes <= 0).sum())
    if n_inverted:
        faults.append(counted(n_inverted, "inverted element"))
    boundary, _ = boundary_surface(mesh)
    _, n_faces = edges(boundary)
    n_open = int((n_faces != 2).sum())
    if n_open:
        faults.append(f"{counted(n_open, 'edge')} of its surface without two faces")
    volume = volumes.sum()
    expected = signed_volume(surface)
    if abs(volume - expected) > OTHER_VOLUME * expected:
        faults.append(f"volume {volume:.0f} mm3 instead of {expected:.0f}")
    n_parts = int(face_components(boundary).max()) + 1
    expected_parts = face_components(surface).max() + 1
    if n_parts != expected_parts:
        faults.append(f"{counted(n_parts, 'part')} instead of {expected_parts}")
    euler = euler_number(boundary)
    expected_euler = euler_number(surface)
    if euler != expected_euler:
        faults.append(f"Euler number {euler} instead of {expected_euler}")
    if faults:
        raise MeshError(
            "the mesh is not the inside of the surface", found="; ".join(faults)
        )
