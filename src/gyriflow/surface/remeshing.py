"""Smoothing, even triangles and removal of self-intersections, by MeshLab's filters."""

from typing import Any

import numpy as np
import pymeshlab
from numpy.typing import NDArray

from gyriflow.geometry.triangles import TriangleMesh

REMESHING_ROUNDS = 5
UNTANGLING_ROUNDS = 10


def self_intersecting_faces(mesh: TriangleMesh) -> NDArray[np.bool_]:
    """Returns the (m,) mask of the faces that cut other faces."""
    document = _document(mesh)
    document.compute_selection_by_self_intersections_per_face()
    return np.asarray(document.current_mesh().face_selection_array(), dtype=bool)


def smoothed(mesh: TriangleMesh, iterations: int) -> TriangleMesh:
    """Returns the surface after Taubin smoothing, which keeps volume (Taubin 1995, λ = 0.5, μ = −0.53)."""
    if iterations == 0:
        return mesh
    document = _document(mesh)
    document.apply_coord_taubin_smoothing(stepsmoothnum=iterations)
    return _current(document)


def remeshed(mesh: TriangleMesh, edge_length_mm: float) -> TriangleMesh:
    """Returns the surface with triangles close to equilateral, edges of about `edge_length_mm`."""
    document = _document(mesh)
    document.meshing_isotropic_explicit_remeshing(
        iterations=REMESHING_ROUNDS, targetlen=pymeshlab.PureValue(edge_length_mm), checksurfdist=False
    )
    return _current(document)


def untangled(mesh: TriangleMesh) -> TriangleMesh:
    """Returns the surface with places that cut each other relaxed (Laplacian smoothing of these places alone).

    The number of vertices and the topology stay; each round takes in a wider neighbourhood.
    """
    for round_ in range(UNTANGLING_ROUNDS):
        cutting = self_intersecting_faces(mesh)
        if not cutting.any():
            break
        document = _document(mesh)
        document.compute_selection_by_self_intersections_per_face()
        for _ in range(1 + round_ // 2):
            document.apply_selection_dilatation()
        document.compute_selection_transfer_face_to_vertex()
        document.apply_coord_laplacian_smoothing(stepsmoothnum=2, cotangentweight=False, selected=True)
        mesh = _current(document)
    return mesh


def evened(mesh: TriangleMesh, smoothing_iterations: int, edge_length_mm: float) -> tuple[TriangleMesh, dict[str, Any]]:
    """Returns the surface smoothed, remeshed and untangled, and the number of cutting faces before and after."""
    even = remeshed(smoothed(mesh, smoothing_iterations), edge_length_mm)
    before = int(self_intersecting_faces(even).sum())
    if before:
        even = untangled(even)
    after = int(self_intersecting_faces(even).sum()) if before else 0
    return even, {
        "smoothing_iterations": smoothing_iterations,
        "edge_length_mm": edge_length_mm,
        "self_intersections_before": before,
        "self_intersections_after": after,
    }


def _document(mesh: TriangleMesh) -> pymeshlab.MeshSet:
    document = pymeshlab.MeshSet(verbose=False)
    document.add_mesh(pymeshlab.Mesh(mesh.vertices, mesh.faces))
    return document


def _current(document: pymeshlab.MeshSet) -> TriangleMesh:
    mesh = document.current_mesh()
    return TriangleMesh(mesh.vertex_matrix(), mesh.face_matrix())
