"""Edge lengths: at the surface from a number of faces, below it growing with depth, on a background mesh."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..geometry.tetrahedra import TetrahedralMesh, grid
from ..geometry.triangles import TriangleMesh, area

FACE_AREA = np.sqrt(3) / 4
"""Area of an equilateral triangle, in edges squared."""


def edge_length_for(surface: TriangleMesh, faces: int) -> float:
    """Returns the edge length in mm of equilateral triangles that cover a surface in a given number."""
    return float(np.sqrt(area(surface) / (FACE_AREA * faces)))


def finer(settings: Mapping[str, Any], stretch: float) -> dict[str, Any]:
    """Returns the settings of a mesh whose nodes are as far apart as wanted once it is stretched.

    Parameters
    ----------
    settings
        With surface_edge_mm, core_edge_mm and pial_faces.
    stretch
        Of lengths, 1 or more.
    """
    faces = settings["pial_faces"]
    return {
        **settings,
        "surface_edge_mm": settings["surface_edge_mm"] / stretch,
        "core_edge_mm": settings["core_edge_mm"] / stretch,
        "pial_faces": None if faces is None else round(faces * stretch**2),
    }


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
