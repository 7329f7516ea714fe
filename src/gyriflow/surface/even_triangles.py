"""Smoothing, even triangles and removal of self-intersections, as the surface stage does them."""

from typing import Any

from ..geometry.remeshing import from_meshlab, in_meshlab, remesh, self_intersecting_faces, untangle
from ..geometry.triangles import TriangleMesh


def smooth_taubin(mesh: TriangleMesh, iterations: int) -> TriangleMesh:
    """Returns the surface after Taubin smoothing, which keeps volume (Taubin 1995, λ = 0.5, μ = −0.53)."""
    if iterations == 0:
        return mesh
    document = in_meshlab(mesh)
    document.apply_coord_taubin_smoothing(stepsmoothnum=iterations)
    return from_meshlab(document)


def make_even(
    mesh: TriangleMesh, smoothing_iterations: int, edge_length_mm: float
) -> tuple[TriangleMesh, dict[str, Any]]:
    """Returns the surface smoothed, remeshed and untangled, and the number of cutting faces before and after."""
    even = remesh(smooth_taubin(mesh, smoothing_iterations), edge_length_mm)
    before = int(self_intersecting_faces(even).sum())
    if before:
        even = untangle(even)
    after = int(self_intersecting_faces(even).sum()) if before else 0
    return even, {
        "smoothing_iterations": smoothing_iterations,
        "edge_length_mm": edge_length_mm,
        "self_intersections_before": before,
        "self_intersections_after": after,
    }
