"""Filling a closed surface with tetrahedra of wanted sizes, and refusing a mesh that is not the inside of it."""

import logging
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..errors import MeshError
from ..geometry.matching import crossing_faces
from ..geometry.remeshing import remesh, untangle
from ..geometry.tetrahedra import PIECES_OF_ORDER, TetrahedralMesh, boundary_surface, grid, signed_volumes
from ..geometry.triangles import TriangleMesh, area, edges, euler_number, face_components, is_closed, signed_volume
from ..parameters.terms import Mesher
from .meshers import run_mesher
from .nodes import curve_edges, improve

log = logging.getLogger(__name__)
FACE_AREA = np.sqrt(3) / 4
"""Area of an equilateral triangle, in edges squared."""
NEAR = 0.02
"""A remeshed surface has the number of faces that was asked for when it differs by this part."""
ATTEMPTS = 4
OTHER_VOLUME = 0.05
"""A mesh whose volume differs by more than this part is that of another shape; nearer ones are left to the gates."""
REGULAR_VOLUME = 1 / (6 * np.sqrt(2))
"""Volume of the regular tetrahedron, in edges cubed."""


def edge_length_at(
    depth: NDArray[np.float64], surface_edge_mm: float, core_edge_mm: float, fine_depth_edges: float, growth: float
) -> NDArray[np.float64]:
    """Returns the wanted edge length in mm at depths in mm below the surface.

    It is that of the surface down to `fine_depth_edges` of them, grows by `growth` per mm from there on, and ends at
    that of the core.
    """
    below = np.maximum(depth - fine_depth_edges * surface_edge_mm, 0.0)
    return np.minimum(surface_edge_mm + growth * below, core_edge_mm)


def background_mesh(
    surface: TriangleMesh, surface_edge_mm: float, core_edge_mm: float, fine_depth_edges: float, growth: float
) -> tuple[TetrahedralMesh, NDArray[np.float64]]:
    """Returns a regular tetrahedral grid around the surface and the wanted edge length in mm at its vertices."""
    spacing = max(2 * surface_edge_mm, 1.0)
    low = surface.vertices.min(axis=0) - spacing
    counts = np.ceil((surface.vertices.max(axis=0) + spacing - low) / spacing).astype(int) + 1
    background = grid([start + spacing * np.arange(count) for start, count in zip(low, counts, strict=True)])
    depth = cKDTree(surface.vertices).query(background.vertices)[0]
    return background, edge_length_at(depth, surface_edge_mm, core_edge_mm, fine_depth_edges, growth)


def tetrahedralise(
    surface: TriangleMesh,
    *,
    surface_edge_mm: float,
    core_edge_mm: float,
    envelope_mm: float,
    time_limit_s: float,
    mesher: Mesher = "pytetwild",
    pial_faces: int | None = None,
    fine_depth_edges: float = 2.5,
    edge_growth: float = 0.5,
    order: int = 1,
) -> TetrahedralMesh:
    """Returns a tetrahedral mesh of the inside of a closed, outward surface in mm, of one or more components.

    `surface_edge_mm` and `core_edge_mm` are distances of neighbouring nodes at the surface and deep inside: the edge
    length of linear elements (`order` 1), half of that of quadratic ones (2), which are curved to follow the surface.
    So both orders have about as many nodes. With `pial_faces`, about so many triangles between nodes make the surface,
    and `surface_edge_mm` follows. The mesher is stopped after `time_limit_s`.

    "pytetwild" (fTetWild) makes a surface of its own within `envelope_mm`, and sizes elements by their depth: down to
    `fine_depth_edges` surface edges they are as fine as at the surface, below they grow by `edge_growth` of each mm.
    "tetgen" keeps its surface exactly, which is the given one remeshed; elements grow from it inwards as fast as their
    quality allows, and the poor ones are improved.

    MeshError where the surface is open or inside out, the mesher fails or takes too long, or its mesh is not the inside
    of the surface: other components or handles, inverted elements, a volume that differs by more than 5 %.
    """
    if not is_closed(surface) or signed_volume(surface) <= 0:
        # the mesher would fill holes without a word
        raise MeshError("the surface to be filled must be closed and face outwards", remedy="Repair it first.")
    faces = pial_faces // PIECES_OF_ORDER[order] if pial_faces else None
    edge = float(np.sqrt(area(surface) / (FACE_AREA * faces))) if faces else order * surface_edge_mm
    core = max(order * core_edge_mm, edge)
    if mesher == "tetgen":
        even = even_surface(surface, edge, faces)
        arrays: dict[str, Any] = {"vertices": even.vertices, "faces": even.faces, "volume": REGULAR_VOLUME * core**3}
    else:
        background, lengths = background_mesh(surface, edge, core, fine_depth_edges / order, order * edge_growth)
        arrays = {
            "vertices": surface.vertices,
            "faces": surface.faces,
            "bg_vertices": background.vertices,
            "bg_tets": background.tets,
            "bg_values": lengths,
            "edge": core,
            "epsilon": envelope_mm / float(np.linalg.norm(np.ptp(surface.vertices, axis=0))),
        }
    mesh = run_mesher(mesher, arrays, time_limit_s)
    _refuse_other_shape(mesh, surface)
    # fTetWild has optimised its elements itself
    mesh = improve(mesh) if mesher == "tetgen" else mesh
    return curve_edges(mesh, surface) if order == 2 else mesh


def even_surface(surface: TriangleMesh, edge_mm: float, faces: int | None) -> TriangleMesh:
    """Returns a surface remeshed with even triangles, fit to be the boundary of a mesh as it is.

    Its edges are `edge_mm` long, or such that it has about the given number of faces. MeshError where it cuts itself.
    """
    even = remesh(surface, edge_mm)
    for _ in range(ATTEMPTS if faces else 0):
        if abs(len(even.faces) - faces) <= NEAR * faces:  # type: ignore[operator]
            break
        edge_mm *= float(np.sqrt(len(even.faces) / faces))  # type: ignore[operator]
        even = remesh(surface, edge_mm)
    if crossing_faces(even):
        even = untangle(even)
    crossing = crossing_faces(even)
    log.info("surface remeshed to %d faces, edges of %.3f mm, %d faces cross", len(even.faces), edge_mm, crossing)
    if crossing:
        raise MeshError(
            "the surface cuts itself and cannot be kept as it is",
            found=f"{crossing} faces that cross others after remeshing to edges of {edge_mm:.2f} mm",
            expected="none",
            remedy="Use mesh.mesher: pytetwild, or shorter edges, or repair or smooth the surface.",
        )
    return even


def _refuse_other_shape(mesh: TetrahedralMesh, surface: TriangleMesh) -> None:
    volumes = signed_volumes(mesh)
    boundary, _ = boundary_surface(mesh)
    open_edges = int((edges(boundary)[1] != 2).sum())
    wanted = signed_volume(surface)
    changed = abs(volumes.sum() - wanted) > OTHER_VOLUME * wanted
    parts = [face_components(s).max() + 1 for s in (boundary, surface)]
    euler = [euler_number(s) for s in (boundary, surface)]
    problems = {
        f"{int((volumes <= 0).sum())} inverted elements": (volumes <= 0).any(),
        f"{open_edges} edges of its surface without two faces": open_edges > 0,
        f"volume {volumes.sum():.0f} mm3 instead of {wanted:.0f}": changed,
        f"{parts[0]} parts instead of {parts[1]}": parts[0] != parts[1],
        f"Euler number {euler[0]} instead of {euler[1]}": euler[0] != euler[1],
    }
    found = [text for text, wrong in problems.items() if wrong]
    if found:
        raise MeshError(
            "the mesh is not the inside of the surface",
            found="; ".join(found),
            remedy="Mesh with a smaller mesh.envelope_mm, or smooth the surface more.",
        )
