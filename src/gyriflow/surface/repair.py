"""Surfaces made clean: closed, manifold, outward, evenly meshed, without intersections."""

import logging

import numpy as np
import pymeshlab
from numpy.typing import NDArray

from gyriflow.errors import MeshError
from gyriflow.geometry.triangles import TriangleMesh, area, euler_number, is_closed, mean_edge_length, signed_volume

log = logging.getLogger(__name__)


def meshset(mesh: TriangleMesh) -> pymeshlab.MeshSet:
    """Returns a MeshLab document with the surface as its only mesh."""
    document = pymeshlab.MeshSet(verbose=False)
    document.add_mesh(pymeshlab.Mesh(mesh.vertices, mesh.faces))
    return document


def current(document: pymeshlab.MeshSet) -> TriangleMesh:
    """Returns the current mesh of a MeshLab document."""
    mesh = document.current_mesh()
    return TriangleMesh(mesh.vertex_matrix(), mesh.face_matrix())


def self_intersections(mesh: TriangleMesh) -> int:
    """Returns the number of faces that cut other faces."""
    document = meshset(mesh)
    document.compute_selection_by_self_intersections_per_face()
    return int(document.current_mesh().selected_face_number())


def smoothed(mesh: TriangleMesh, iterations: int) -> TriangleMesh:
    """Returns the surface after Taubin smoothing, which keeps volume (Taubin 1995, λ = 0.5, μ = −0.53)."""
    document = meshset(mesh)
    if iterations > 0:
        document.apply_coord_taubin_smoothing(stepsmoothnum=iterations)
    return current(document)


def remeshed(mesh: TriangleMesh, edge_length_mm: float) -> TriangleMesh:
    """Returns the surface with triangles close to equilateral, edges of about `edge_length_mm`."""
    document = meshset(mesh)
    document.meshing_isotropic_explicit_remeshing(
        iterations=5, targetlen=pymeshlab.PureValue(edge_length_mm), checksurfdist=False
    )
    return current(document)
