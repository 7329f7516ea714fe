"""Deformation, stress and strain of elements whose answers are known in closed form, or from the model's own energy."""

import numpy as np
import pytest
import ufl
from shapes import box_mesh

from gyriflow.folding.stress import (
    areal_stretch,
    cauchy_stress,
    deformation_gradients,
    elastic_part,
    green_lagrange_maximum,
    hencky_equivalent,
    pressure,
    principal_stretches,
    strain_fields,
    stress_fields,
    volume_ratio_fields,
    von_mises,
)
from gyriflow.mechanics.growth_tensor import inverse_growth_tensor
from gyriflow.mechanics.neo_hookean import bulk_to_shear_ratio, strain_energy_density

MU, K = 300.0, 300.0 * bulk_to_shear_ratio(0.45)
RNG = np.random.default_rng(3)
# far from the identity, det > 0, no symmetry
SOME = np.array([np.eye(3) + 0.25 * RNG.standard_normal((3, 3)) for _ in range(6)])
NO_MEMORY = np.eye(3)


def moduli(count):
    return np.full(count, MU), np.full(count, K)


def stress_of(*gradients):
    return cauchy_stress(np.array(gradients, dtype=float), *moduli(len(gradients)))


def rotation(axis, angle):
    x, y, z = np.array(axis) / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def energy(Fe):
    """Returns the energy density that the solver minimises, from its own UFL expression."""
    return float(strain_energy_density(ufl.as_matrix(Fe.tolist()), MU, K)(()))


def test_every_element_of_an_affine_motion_has_its_gradient():
    mesh = box_mesh((2, 3, 2), (2.0, 3.0, 1.0))
    moved = mesh.vertices @ SOME[0].T + [5.0, -1.0, 2.0]
    F = deformation_gradients(mesh.vertices, moved, mesh.tets)
    np.testing.assert_allclose(F, np.broadcast_to(SOME[0], (len(mesh.tets), 3, 3)), atol=1e-12)


def test_the_elastic_part_is_what_growth_and_old_stretch_leave():
    normal = np.array([2.0, -1.0, 2.0]) / 3
    V_old = SOME[1] @ SOME[1].T
    inverse = inverse_growth_tensor(0.3, 0.1, ufl.as_vector(normal.tolist()))
    expected = SOME[0] @ V_old @ np.array([[float(inverse[i, j](())) for j in range(3)] for i in range(3)])
    Fe = elastic_part(SOME[:1], V_old[None], np.array([0.3]), np.array([0.1]), normal[None])
    np.testing.assert_allclose(Fe[0], expected, atol=1e-12)


@pytest.mark.parametrize("dr", [0.2, 0.0])
def test_a_free_body_that_grows_as_it_likes_has_no_stress(dr):
    # grown by Fg and turned: no elastic deformation, though the volume has changed
    normal = np.array([0.0, 0.6, 0.8])
    Fg = 1.2 * np.eye(3) + (dr - 0.2) * np.outer(normal, normal)
    F = (rotation([1, 2, 3], 0.7) @ Fg)[None]
    Fe = elastic_part(F, NO_MEMORY, np.array([0.2]), np.array([dr]), normal[None])
    fields = stress_fields(Fe, *moduli(1)) | strain_fields(Fe, F, normal[None]) | volume_ratio_fields(F, F)
    for name in ("von_mises_pa", "pressure_pa", "elastic_strain", "elastic_volume_strain"):
        assert fields[name] == pytest.approx(0, abs=1e-12 * K), name
    assert fields["volume_ratio"] == pytest.approx(1.44 * (1 + dr))
    assert fields["area_stretch"] == pytest.approx(1.44)


def test_stress_is_the_derivative_of_the_solvers_energy():
    step = 1e-5
    for Fe, stress in zip(SOME, stress_of(*SOME), strict=True):
        P = np.empty((3, 3))
        for i, j in np.ndindex(3, 3):
            change = np.zeros((3, 3))
            change[i, j] = step
            P[i, j] = (energy(Fe + change) - energy(Fe - change)) / (2 * step)
        np.testing.assert_allclose(stress, P @ Fe.T / np.linalg.det(Fe), atol=1e-6 * np.abs(P).max())


def test_stress_turns_with_the_body_and_does_not_see_turns_before():
    Q = rotation([1, -2, 0.5], 1.1)
    stress = stress_of(*SOME)
    np.testing.assert_allclose(stress_of(*(Q @ SOME)), Q @ stress @ Q.T, atol=1e-9 * K)
    np.testing.assert_allclose(stress_of(*(SOME @ Q)), stress, atol=1e-9 * K)
    np.testing.assert_allclose(von_mises(stress_of(*(Q @ SOME))), von_mises(stress))
    np.testing.assert_allclose(principal_stretches(Q @ SOME), principal_stretches(SOME))


def test_a_pressed_body_has_pressure_only():
    # all lengths by 0.9: Je = 0.729, p = K (1 − Je)
    stress = stress_of(0.9 * np.eye(3))
    assert pressure(stress) == pytest.approx(K * 0.271)
    assert von_mises(stress) == pytest.approx(0, abs=1e-12 * K)


def test_a_bar_drawn_out_at_constant_volume():
    # stretches λ, λ^(−1/2), λ^(−1/2): dev(b) has 2/3 (λ² − 1/λ) along the bar, −1/3 of it across
    stretch = 1.5
    stress = stress_of(np.diag([stretch**-0.5, stretch, stretch**-0.5]))
    difference = MU * (stretch**2 - 1 / stretch)
    np.testing.assert_allclose(np.diag(stress[0]), difference * np.array([-1, 2, -1]) / 3)
    assert von_mises(stress) == pytest.approx(difference)
    assert pressure(stress) == pytest.approx(0, abs=1e-12 * K)


def test_simple_shear():
    # x = X + γY: b = [[1 + γ², γ], [γ, 1]], Je = 1
    gamma = 0.4
    F = np.eye(3)
    F[0, 1] = gamma
    (stress,) = stress_of(F)
    assert stress[0, 1] == stress[1, 0] == pytest.approx(MU * gamma)
    assert stress[0, 0] - stress[1, 1] == pytest.approx(MU * gamma**2)
    assert pressure(stress[None]) == pytest.approx(0, abs=1e-12 * K)
    assert von_mises(stress[None]) == pytest.approx(MU * gamma * np.sqrt(gamma**2 + 3))
    # the plane of the shear keeps its area, one across it does not
    np.testing.assert_allclose(areal_stretch(np.array([F, F]), np.eye(3)[[1, 0]]), [1, np.sqrt(1 + gamma**2)])


def test_strain_of_known_stretches():
    bar = np.array([[2.0**-0.5, 2.0**-0.5, 2.0]])
    assert hencky_equivalent(bar) == pytest.approx(np.log(2))
    # a change of volume alone is no change of shape
    assert hencky_equivalent(1.7 * bar) == pytest.approx(np.log(2))
    assert green_lagrange_maximum(bar) == pytest.approx(1.5)
    F = np.array([rotation([1, 1, 0], 0.3) @ np.diag([1.1, 1.3, 0.8]) @ rotation([0, 1, 2], 0.9)])
    np.testing.assert_allclose(principal_stretches(F), [[0.8, 1.1, 1.3]])
    E = (F[0].T @ F[0] - np.eye(3)) / 2
    assert green_lagrange_maximum(principal_stretches(F)) == pytest.approx(np.linalg.eigvalsh(E)[-1])


def test_fields_tell_elastic_from_total_deformation():
    # grown to twice the area of its layer, held at 1.5 times: pressed along the layer, the rest is growth
    layer, grown = np.sqrt(1.5), np.sqrt(2.0)
    total = np.diag([layer, layer, 1.2])[None]
    normal = np.array([[0.0, 0.0, 1.0]])
    Fe = elastic_part(total, NO_MEMORY, np.array([grown - 1]), np.array([0.0]), normal)
    fields = strain_fields(Fe, total, normal) | volume_ratio_fields(np.diag([1.0, 1.0, 1.1])[None], total)
    assert fields["elastic_volume_strain"] == pytest.approx(np.log(0.75 * 1.2))
    assert fields["elastic_strain"] == pytest.approx(2 / 3 * (np.log(1.2) - np.log(layer / grown)))
    assert fields["total_strain"] == pytest.approx((1.5 - 1) / 2)
    assert fields["area_stretch"] == pytest.approx(1.5)
    assert fields["volume_ratio"] == pytest.approx(1.8)
    assert fields["volume_ratio_step"] == pytest.approx(1.1)
