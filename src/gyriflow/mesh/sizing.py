"""Edge lengths that grow with depth below the surface, on a background mesh for the mesher."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..geometry.tetrahedra import TetrahedralMesh, grid
from ..geometry.triangles import TriangleMesh

FINE_DEPTH = 2.5
"""Depth of the layer of fine elements, in surface edge lengths: just more than the cortex that they must resolve."""
GROWTH = 0.5
"""Increase of edge length per depth below the fine layer."""


def edge_length_at(depth: NDArray[np.float64], surface_edge_mm: float, core_edge_mm: float) -> NDArray[np.float64]:
    """Returns the wanted edge length in mm at depths in mm below the surface."""
    below = np.maximum(depth - FINE_DEPTH * surface_edge_mm, 0.0)
    return np.minimum(surface_edge_mm + GROWTH * below, core_edge_mm)


def background_mesh(
    surface: TriangleMesh, surface_edge_mm: float, core_edge_mm: float
) -> tuple[TetrahedralMesh, NDArray[np.float64]]:
    """Returns a regular tetrahedral grid around the surface and the wanted edge length in mm at its vertices."""
    spacing = max(2 * surface_edge_mm, 1.0)
    low = surface.vertices.min(axis=0) - spacing
    counts = np.ceil((surface.vertices.max(axis=0) + spacing - low) / spacing).astype(int) + 1
    background = grid([start + spacing * np.arange(count) for start, count in zip(low, counts, strict=True)])
    depth = cKDTree(surface.vertices).query(background.vertices)[0]
    return background, edge_length_at(depth, surface_edge_mm, core_edge_mm)
