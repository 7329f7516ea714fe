"""Estimators of the principal curvatures of a triangle surface: gyriflow's and well-known others."""

import contextlib
import os
from collections.abc import Callable, Iterator

import igl
import numpy as np
import pyvista as pv

from gyriflow.geometry.meshlab import pymeshlab
from gyriflow.geometry.remeshing import in_meshlab
from gyriflow.geometry.triangles import Floats, TriangleMesh, mean_edge_length
from gyriflow.metrics.curvature import curvature
from gyriflow.parameters.metrics import CURVATURE_RADIUS_MM

HARD_BALL_MM = 2.5
"""Radius of a ball with constant weights whose error on clean surfaces is that of gyriflow's default."""

Pair = tuple[Floats, Floats]
Estimator = Callable[[TriangleMesh], Pair]


def gyriflow(mesh: TriangleMesh) -> Pair:
    found = curvature(mesh)
    return found.maximum, found.minimum


def libigl(mesh: TriangleMesh, size: int, rings: bool) -> Pair:
    _, _, first, second, _ = igl.principal_curvature(mesh.vertices, mesh.faces, size, rings)
    return np.maximum(first, second), np.minimum(first, second)


def as_many_edges(mesh: TriangleMesh) -> int:
    """Returns the whole number of mean edges nearest to the radius of a hard ball, at least two."""
    return max(2, round(HARD_BALL_MM / mean_edge_length(mesh)))


def principal(mean: Floats, gaussian: Floats) -> Pair:
    half_difference = np.sqrt(np.maximum(mean**2 - gaussian, 0.0))
    return mean + half_difference, mean - half_difference


@contextlib.contextmanager
def muted() -> Iterator[None]:
    """Keeps out what MeshLab prints from its own C++; also as a decorator."""
    kept, nowhere = os.dup(1), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 1)
        yield
    finally:
        os.dup2(kept, 1)
        os.close(nowhere)
        os.close(kept)


@muted()
def meshlab_fit(mesh: TriangleMesh, method: str) -> Pair:
    values = []
    for kind in ("Mean Curvature", "Gaussian Curvature"):
        document = in_meshlab(mesh)
        document.compute_curvature_principal_directions_per_vertex(
            method=method, curvcolormethod=kind, scale=pymeshlab.PureValue(HARD_BALL_MM), autoclean=False
        )
        values.append(document.current_mesh().vertex_scalar_array())
    return principal(*values)


@muted()
def meshlab_discrete(mesh: TriangleMesh) -> Pair:
    values = []
    for kind in ("Mean Curvature", "Gaussian Curvature"):
        document = in_meshlab(mesh)
        document.compute_scalar_by_discrete_curvature_per_vertex(curvaturetype=kind)
        values.append(document.current_mesh().vertex_scalar_array())
    return principal(*values)


def vtk_discrete(mesh: TriangleMesh) -> Pair:
    surface = pv.PolyData.from_regular_faces(np.array(mesh.vertices), np.array(mesh.faces, dtype=int))
    return principal(surface.curvature("mean"), surface.curvature("gaussian"))


ESTIMATORS: dict[str, Estimator] = {
    f"**gyriflow, {CURVATURE_RADIUS_MM:g} mm**": gyriflow,
    "libigl, 3 rings": lambda mesh: libigl(mesh, 3, True),
    f"libigl, rings nearest to {HARD_BALL_MM:g} mm": lambda mesh: libigl(mesh, as_many_edges(mesh), True),
    f"libigl, ball nearest to {HARD_BALL_MM:g} mm": lambda mesh: libigl(mesh, as_many_edges(mesh), False),
    f"MeshLab, scale-dependent quadric, {HARD_BALL_MM:g} mm": lambda mesh: meshlab_fit(
        mesh, "Scale Dependent Quadric Fitting"
    ),
    "MeshLab, quadric of one ring": lambda mesh: meshlab_fit(mesh, "Quadric Fitting"),
    "MeshLab, Taubin": lambda mesh: meshlab_fit(mesh, "Taubin approximation"),
    "MeshLab, cotangents and angle defects": meshlab_discrete,
    "VTK, dihedral angles and angle defects": vtk_discrete,
}
