"""Spectra that are known: sphere, rectangle; none missing."""

import numpy as np
import pytest
import trimesh
from scipy.sparse.linalg import eigsh

from gyriflow.errors import MeshError, SolverError
from gyriflow.geometry.triangles import TriangleMesh
from gyriflow.metrics import laplace_beltrami
from gyriflow.metrics.laplace_beltrami import count_below, laplacian, lowest_modes


def ellipsoid(subdivisions: int = 4) -> TriangleMesh:
    shape = trimesh.creation.icosphere(subdivisions=subdivisions)
    return TriangleMesh(shape.vertices * [35.0, 25.0, 20.0], shape.faces)


def rectangle(nx: int, ny: int, width: float, height: float) -> TriangleMesh:
    x, y = np.meshgrid(np.linspace(0, width, nx), np.linspace(0, height, ny), indexing="ij")
    corner = (np.arange(nx - 1)[:, None] * ny + np.arange(ny - 1)).ravel()
    faces = np.concatenate(
        [
            np.stack([corner, corner + ny, corner + ny + 1], axis=1),
            np.stack([corner, corner + ny + 1, corner + 1], axis=1),
        ]
    )
    return TriangleMesh(np.stack([x.ravel(), y.ravel(), np.zeros(nx * ny)], axis=1), faces)


def test_sphere_has_l_times_l_plus_one() -> None:
    shape = trimesh.creation.icosphere(subdivisions=4, radius=30.0)
    found = lowest_modes(*laplacian(TriangleMesh(shape.vertices, shape.faces)), 121).eigenvalues
    degree = np.repeat(np.arange(11), 2 * np.arange(11) + 1)  # 2l + 1 equal ones for each degree l
    np.testing.assert_allclose(found, degree * (degree + 1) / 30.0**2, rtol=0.045, atol=1e-12)


def test_open_rectangle_has_a_free_boundary() -> None:
    found = lowest_modes(*laplacian(rectangle(61, 46, 40.0, 30.0)), 40).eigenvalues
    i, j = np.meshgrid(np.arange(30), np.arange(30))
    exact = np.sort((np.pi**2 * (i**2 / 40.0**2 + j**2 / 30.0**2)).ravel())[:40]
    np.testing.assert_allclose(found, exact, rtol=0.03, atol=1e-12)


def test_slices_equal_a_single_call() -> None:
    stiffness, mass = laplacian(ellipsoid())
    modes = lowest_modes(stiffness, mass, 250)
    single = eigsh(stiffness, k=250, M=mass, sigma=-1e-3, tol=1e-12, return_eigenvectors=False)
    np.testing.assert_allclose(modes.eigenvalues[1:], np.sort(single)[1:], rtol=1e-8)
    assert abs(modes.eigenvalues[0]) < 1e-10
    identity = modes.functions.T @ (mass @ modes.functions)
    np.testing.assert_allclose(identity, np.eye(250), atol=1e-8)
    residual = stiffness @ modes.functions - (mass @ modes.functions) * modes.eigenvalues
    assert np.abs(residual).max() < 1e-8


def test_count_below_is_the_number_of_eigenvalues() -> None:
    stiffness, mass = laplacian(rectangle(30, 30, 10.0, 10.0))
    values = lowest_modes(stiffness, mass, 120).eigenvalues
    gaps = np.flatnonzero(np.diff(values) > 1e-4)[::10]
    for gap in gaps:
        assert count_below(stiffness, mass, 0.5 * (values[gap] + values[gap + 1])) == gap + 1


def test_small_surface_has_all_its_modes() -> None:
    stiffness, mass = laplacian(ellipsoid(2))
    modes = lowest_modes(stiffness, mass, 162)
    np.testing.assert_allclose(modes.functions.T @ (mass @ modes.functions), np.eye(162), atol=1e-10)


def test_a_mode_that_arpack_drops_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    stiffness, mass = laplacian(ellipsoid())
    expected = lowest_modes(stiffness, mass, 120).eigenvalues
    nearest = laplace_beltrami._nearest
    calls = []

    def forgetful(*arguments):
        values, functions = nearest(*arguments)
        calls.append(len(values))
        if len(calls) > 1:
            return values, functions
        kept = np.delete(np.arange(len(values)), [20, 21, 40])
        return values[kept], functions[:, kept]

    monkeypatch.setattr(laplace_beltrami, "_nearest", forgetful)
    found = lowest_modes(stiffness, mass, 120)
    np.testing.assert_allclose(found.eigenvalues[1:], expected[1:], rtol=1e-8)
    np.testing.assert_allclose(found.functions.T @ (mass @ found.functions), np.eye(120), atol=1e-8)


def test_a_mode_that_stays_missing_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    stiffness, mass = laplacian(ellipsoid())
    nearest = laplace_beltrami._nearest

    def forgetful(*arguments):
        values, functions = nearest(*arguments)
        kept = np.abs(values - values[5]) > 1e-12
        return values[kept], functions[:, kept]

    monkeypatch.setattr(laplace_beltrami, "_nearest", forgetful)
    with pytest.raises(SolverError, match="number of modes is wrong"):
        lowest_modes(stiffness, mass, 100)


def test_vertex_without_a_face_is_refused() -> None:
    with pytest.raises(MeshError, match="without a face"):
        laplacian(TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [5, 5, 5]], [[0, 1, 2]]))


def test_more_modes_than_a_surface_has_are_refused() -> None:
    stiffness, mass = laplacian(ellipsoid(2))
    with pytest.raises(SolverError, match="found 163; expected 1 to 162"):
        lowest_modes(stiffness, mass, 163)
