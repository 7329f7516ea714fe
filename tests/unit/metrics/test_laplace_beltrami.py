"""Spectra that are known: sphere, rectangle, tori; none missing."""

import igl
import numpy as np
import pytest
from scipy import sparse
from scipy.sparse.linalg import eigsh
from shapes import ellipsoid

from gyriflow.errors import MeshError, SolverError
from gyriflow.geometry.triangles import TriangleMesh
from gyriflow.metrics import laplace_beltrami
from gyriflow.metrics.laplace_beltrami import laplacian, lowest_modes

AXES = (35.0, 25.0, 20.0)


def rectangle(nx: int, ny: int, width: float, height: float) -> TriangleMesh:
    vertices, faces = igl.triangulated_grid(nx, ny)
    order = np.lexsort(vertices.T[::-1])
    return TriangleMesh(
        np.column_stack([vertices[order] * [width, height], np.zeros(nx * ny)]), np.argsort(order)[faces]
    )


def flat_torus(nx: int, ny: int, width: float, height: float) -> list[sparse.csc_matrix]:
    # no flat torus fits into space; its edge lengths are those of a rectangle whose opposite sides are glued
    i, j = (index.ravel() for index in np.meshgrid(np.arange(nx), np.arange(ny), indexing="ij"))
    glue = sparse.csc_matrix((np.ones(nx * ny), (np.arange(nx * ny), i % (nx - 1) * (ny - 1) + j % (ny - 1))))
    return [sparse.csc_matrix(glue.T @ part @ glue) for part in laplacian(rectangle(nx, ny, width, height))]


def extrapolated(coarse: np.ndarray, fine: np.ndarray) -> np.ndarray:
    # linear elements: half the edge length, a quarter of the error
    return fine + (fine - coarse) / 3.0


def test_flat_torus_has_the_sums_of_two_circles() -> None:
    coarse, fine = (lowest_modes(*flat_torus(8 * n + 1, 6 * n + 1, 40.0, 30.0), 60).eigenvalues for n in (6, 12))
    k, m = np.meshgrid(np.arange(-20, 21), np.arange(-20, 21))
    exact = np.sort((4 * np.pi**2 * (k**2 / 40.0**2 + m**2 / 30.0**2)).ravel())[:60]
    np.testing.assert_allclose(extrapolated(coarse, fine), exact, rtol=0.01, atol=1e-9)


def test_open_rectangle_has_a_free_boundary() -> None:
    found = lowest_modes(*laplacian(rectangle(61, 46, 40.0, 30.0)), 40).eigenvalues
    i, j = np.meshgrid(np.arange(30), np.arange(30))
    exact = np.sort((np.pi**2 * (i**2 / 40.0**2 + j**2 / 30.0**2)).ravel())[:40]
    np.testing.assert_allclose(found, exact, rtol=0.03, atol=1e-12)


def test_slices_equal_a_single_call() -> None:
    stiffness, mass = laplacian(ellipsoid(AXES))
    modes = lowest_modes(stiffness, mass, 250)
    single = eigsh(stiffness, k=250, M=mass, sigma=-1e-3, tol=1e-12, return_eigenvectors=False)
    np.testing.assert_allclose(modes.eigenvalues[1:], np.sort(single)[1:], rtol=1e-8)
    assert abs(modes.eigenvalues[0]) < 1e-10
    identity = modes.functions.T @ (mass @ modes.functions)
    np.testing.assert_allclose(identity, np.eye(250), atol=1e-8)
    residual = stiffness @ modes.functions - (mass @ modes.functions) * modes.eigenvalues
    assert np.abs(residual).max() < 1e-8


@pytest.mark.parametrize("wrong", [-1, 1])
def test_modes_other_than_the_inertia_counts_are_an_error(monkeypatch: pytest.MonkeyPatch, wrong: int) -> None:
    stiffness, mass = laplacian(ellipsoid(AXES))
    counted = laplace_beltrami.count_below
    monkeypatch.setattr(laplace_beltrami, "count_below", lambda *arguments: counted(*arguments) + wrong)
    with pytest.raises(SolverError, match="number of modes is wrong"):
        lowest_modes(stiffness, mass, 20)


def test_vertex_without_a_face_is_refused() -> None:
    with pytest.raises(MeshError, match="without a face"):
        laplacian(TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [5, 5, 5]], [[0, 1, 2]]))


def test_more_modes_than_a_surface_has_are_refused() -> None:
    stiffness, mass = laplacian(ellipsoid(AXES, 2))
    with pytest.raises(SolverError, match="found 163; expected 1 to 162"):
        lowest_modes(stiffness, mass, 163)
