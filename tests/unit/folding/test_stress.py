"""Deformation, stress and strain of elements whose answers are known in closed form, or
from the model's own energy."""

from functools import cache
from typing import get_args

import numpy as np
import pytest
import ufl
from boxes import set_layers
from mpi4py import MPI
from scipy.spatial.transform import Rotation
from shapes import box_mesh

from gyriflow.folding.domain import Domain
from gyriflow.folding.problem import NonlinearProblem
from gyriflow.folding.step_fields import (
    _areal_stretch,
    _green_lagrange_maximum,
    _hencky_equivalent,
    _pressure,
    _principal_stretches,
    _von_mises,
)
from gyriflow.folding.stretches import deformation_gradients
from gyriflow.folding.zones import Zones
from gyriflow.geometry.tetrahedra import TetrahedralMesh, boundary_faces, quadratic
from gyriflow.mechanics.materials import MATERIALS, Material, NeoHookean
from gyriflow.settings.terms import FREE, MaterialName

MU, K = 300.0, 300.0 * NeoHookean(0.45).bulk_to_shear_ratio
RNG = np.random.default_rng(3)
# far from the identity, det > 0, no symmetry
SOME = np.array([np.eye(3) + 0.25 * RNG.standard_normal((3, 3)) for _ in range(6)])
UP = np.array([0.0, 0.0, 1.0])


@cache
def problem_of(law: type[Material], order: int) -> NonlinearProblem:
    """Return a problem on a few elements that may remember stress."""
    mesh = box_mesh((1, 1, 1), (2.0, 3.0, 1.0))
    mesh = quadratic(mesh) if order == 2 else mesh
    facets, _ = boundary_faces(mesh)
    zones = Zones(
        facets,
        np.full(len(facets), FREE),
        np.ones(len(mesh.vertices)),
        0.0,
        (-1.0, 1.0),
    )
    return NonlinearProblem(Domain(MPI.COMM_SELF, mesh), zones, law(0.45))


def outcomes(F, name, law=NeoHookean, stretch=None, dg=0.0, dr=0.0, normal=UP):
    """Return the tensor that linear and quadratic elements have at all points after a
    homogeneous deformation."""
    found = []
    for order in (1, 2):
        problem = problem_of(law, order)
        x = problem.domain.local(problem.domain.positions)
        cells = len(problem.domain.cells)
        ones, points = np.ones(len(x)), len(problem.points.weights)
        V = None if stretch is None else np.tile(stretch, (cells, points, 1, 1))
        set_layers(
            problem, MU * ones, dg * ones, dr * ones, np.tile(normal, (cells, 1)), V
        )
        found.append(problem.evaluate(name, x @ (F - np.eye(3)).T).reshape(-1, 3, 3))
    tensors = np.concatenate(found)
    np.testing.assert_allclose(
        tensors, np.broadcast_to(tensors[0], tensors.shape), rtol=1e-9, atol=1e-9
    )
    return tensors[:1]


def stress_of(*gradients, law=NeoHookean):
    return np.concatenate(
        [outcomes(np.array(F, dtype=float), "stress", law) for F in gradients]
    )


def turn(angle, *axis):
    return Rotation.from_rotvec(
        angle * np.array(axis) / np.linalg.norm(axis)
    ).as_matrix()


def energy(Fe, law):
    """Return a law's energy density from its UFL expression."""
    return float(law.energy_density(ufl.as_matrix(Fe.tolist()), MU, K)(()))


@pytest.mark.parametrize("order", [1, 2])
def test_every_element_of_an_affine_motion_has_its_gradient(order):
    mesh = box_mesh((2, 3, 2), (2.0, 3.0, 1.0))
    if order == 2:  # with curved sides
        mesh = quadratic(mesh)
        mesh = TetrahedralMesh(
            mesh.vertices + RNG.uniform(-0.02, 0.02, mesh.vertices.shape), mesh.tets
        )
    points = problem_of(NeoHookean, order).points
    moved = mesh.vertices @ SOME[0].T + [5.0, -1.0, 2.0]
    F = deformation_gradients(mesh.vertices, moved, mesh.tets, points.gradients)
    assert F.shape == (len(mesh.tets), len(points.weights), 3, 3)
    np.testing.assert_allclose(F, np.broadcast_to(SOME[0], F.shape), atol=1e-12)


def test_the_elastic_part_is_what_growth_and_old_stretch_leave():
    normal = np.array([2.0, -1.0, 2.0]) / 3
    V_old = SOME[1] @ SOME[1].T
    Fg = 1.3 * np.eye(3) - 0.2 * np.outer(normal, normal)
    Fe = outcomes(SOME[0], "elastic", stretch=V_old, dg=0.3, dr=0.1, normal=normal)
    np.testing.assert_allclose(Fe[0], SOME[0] @ V_old @ np.linalg.inv(Fg), atol=1e-12)
    np.testing.assert_allclose(
        outcomes(SOME[0], "deformation", stretch=V_old, dg=0.3)[0], SOME[0], atol=1e-12
    )


@pytest.mark.parametrize("dr", [0.2, 0.0])
@pytest.mark.parametrize("law", MATERIALS.values())
def test_a_free_body_that_grows_as_it_likes_has_no_stress(law, dr):
    # grown by Fg and turned: no elastic deformation, though the volume has changed
    normal = np.array([0.0, 0.6, 0.8])
    Fg = 1.2 * np.eye(3) + (dr - 0.2) * np.outer(normal, normal)
    F = turn(0.7, 1, 2, 3) @ Fg
    growth = {"law": law, "dg": 0.2, "dr": dr, "normal": normal}
    Fe, stress = outcomes(F, "elastic", **growth), outcomes(F, "stress", **growth)
    for found in (
        _von_mises(stress),
        _pressure(stress),
        _hencky_equivalent(Fe),
        np.log(np.linalg.det(Fe)),
    ):
        assert found == pytest.approx(0, abs=1e-12 * K)
    assert _areal_stretch(F[None], normal[None]) == pytest.approx(1.44)


@pytest.mark.parametrize("law", MATERIALS.values())
def test_stress_is_the_derivative_of_the_energy(law):
    step = 1e-5
    for Fe, stress in zip(SOME, stress_of(*SOME, law=law), strict=True):
        P = np.empty((3, 3))
        for i, j in np.ndindex(3, 3):
            change = np.zeros((3, 3))
            change[i, j] = step
            P[i, j] = (energy(Fe + change, law) - energy(Fe - change, law)) / (2 * step)
        np.testing.assert_allclose(
            stress, P @ Fe.T / np.linalg.det(Fe), atol=1e-6 * np.abs(P).max()
        )


def test_simple_shear():
    # x = X + γY: b = [[1 + γ², γ], [γ, 1]], Je = 1
    gamma = 0.4
    F = np.eye(3)
    F[0, 1] = gamma
    (stress,) = stress_of(F)
    assert [stress[0, 1], stress[1, 0]] == pytest.approx([MU * gamma] * 2)
    assert stress[0, 0] - stress[1, 1] == pytest.approx(MU * gamma**2)
    assert _pressure(stress[None]) == pytest.approx(0, abs=1e-12 * K)
    assert _von_mises(stress[None]) == pytest.approx(MU * gamma * np.sqrt(gamma**2 + 3))
    # the plane of the shear keeps its area, one across it does not
    np.testing.assert_allclose(
        _areal_stretch(np.array([F, F]), np.eye(3)[[1, 0]]), [1, np.sqrt(1 + gamma**2)]
    )


def test_strain_of_known_stretches():
    bar = np.diag([2.0**-0.5, 2.0**-0.5, 2.0])[None]
    assert _hencky_equivalent(bar) == pytest.approx(np.log(2))
    # a change of volume alone is no change of shape
    assert _hencky_equivalent(1.7 * bar) == pytest.approx(np.log(2))
    assert _green_lagrange_maximum(bar) == pytest.approx(1.5)
    F = np.array([turn(0.3, 1, 1, 0) @ np.diag([1.1, 1.3, 0.8]) @ turn(0.9, 0, 1, 2)])
    np.testing.assert_allclose(_principal_stretches(F), [[0.8, 1.1, 1.3]])
    E = (F[0].T @ F[0] - np.eye(3)) / 2
    assert _green_lagrange_maximum(F) == pytest.approx(np.linalg.eigvalsh(E)[-1])


def test_every_material_that_the_configuration_names_is_a_law_and_the_reverse():
    assert get_args(MaterialName) == tuple(MATERIALS)
