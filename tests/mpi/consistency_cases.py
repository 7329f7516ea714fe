"""With layers, remembered stress, clamped facets and contact at once: forces fit the energy, stiffness the forces."""

import pytest
from boxes import COMM
from verification_cases.consistency import patch_residual, slopes_of_remainders


@pytest.mark.parametrize("order", [1, 2])
def test_taylors_remainders_fall_with_the_square_of_the_step(order):
    assert slopes_of_remainders(COMM, order) == pytest.approx(2.0, abs=0.02)


@pytest.mark.parametrize("order", [1, 2])
def test_a_uniform_body_is_in_equilibrium_under_an_affine_displacement(order):
    assert patch_residual(COMM, order) <= 1e-12
