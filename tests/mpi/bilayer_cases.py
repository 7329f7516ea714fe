"""The solver against closed answers: waves on a growing slab, whose theory is tried in
its limits, and made-up ones."""

import numpy as np
import pytest
from boxes import COMM
from verification_cases.closed_forms import BIOT_STRETCH, short_wave_rate, thin_film
from verification_cases.manufactured import CASES, rates, solved
from verification_cases.modes import Slab, critical_growth, growth_rates
from verification_cases.slab import Waved, amplified, rate_error

pytestmark = [pytest.mark.slow, pytest.mark.one_rank]

LONG = slice(0, 3)
"""The longest waves, which coarse meshes resolve."""
ORDER = 1.5
"""About the order in which errors fall on such meshes (benchmarks/verification.py)."""


@pytest.mark.parametrize("poisson_ratio", [0.0, 0.45])
def test_on_cortex_alone_all_waves_grow_at_the_rate_in_closed_form(poisson_ratio):
    slab = Slab(1.0, poisson_ratio, depth=8.0, thickness=np.inf)
    rates = growth_rates(slab, 2 * np.pi / np.array([0.5, 1.0, 2.0]))
    np.testing.assert_allclose(rates, short_wave_rate(poisson_ratio), rtol=2e-6)


@pytest.mark.parametrize("steepness", [10.0, np.inf])
def test_on_a_stiff_film_the_theory_is_that_of_thin_plates(steepness):
    slab = Slab(1e3, steepness=steepness, depth=200.0)
    film = thin_film(slab)
    length = film.wavelength * np.array([0.97, 0.985, 1.0, 1.015, 1.03])
    rates = growth_rates(slab, 2 * np.pi / length)
    assert rates.argmax() == 2
    assert rates.max() == pytest.approx(film.growth_rate, rel=0.04)


def test_where_stress_is_kept_a_stiff_film_wrinkles_at_the_critical_growth():
    slab = Slab(1e3, memory=np.inf, depth=150.0, finest=0.04)
    film = thin_film(slab)
    lengths = film.wavelength * np.array([0.6, 1.0, 1.6])
    critical = film.critical_growth
    found = critical_growth(slab, 2 * np.pi / lengths, critical / 25, 2 * critical)
    assert found.argmin() == 1
    assert found[1] == pytest.approx(critical, rel=0.07)


def test_where_stress_is_kept_a_half_space_wrinkles_at_biots_stretch():
    slab = Slab(1.0, 0.4999, depth=6.0, memory=np.inf, thickness=np.inf, finest=0.05)
    found = critical_growth(slab, 2 * np.pi / np.array([1.0, 2.0]), 0.02, 1.0)
    np.testing.assert_allclose(1 / (1 + found), BIOT_STRETCH, rtol=0.01)


def test_one_quadratic_element_through_the_cortex_does_what_two_linear_ones_do_not():
    linear, quadratic = (
        Waved(contrast=5.0, growth=1e-3, steps=1, order=order) for order in (1, 2)
    )
    assert -0.36 < rate_error(linear, 2, COMM) < -0.25
    assert abs(rate_error(quadratic, 1, COMM)) < 0.06


@pytest.mark.parametrize("memory", [0.0, np.inf])
def test_waves_grow_as_in_theory_with_quadratic_elements(memory):
    case = Waved(contrast=20.0, growth=0.01, steps=2, memory=memory, order=2)
    exact = np.log(case.expected()[-1])
    coarse, fine = (np.log(amplified(case, cells, COMM)[-1]) for cells in (1, 2))
    assert (np.abs(fine - exact)[LONG] <= 0.5 * np.abs(coarse - exact)[LONG]).all()
    np.testing.assert_allclose(fine[LONG], exact[LONG], rtol=0.02)
    np.testing.assert_allclose(fine, exact, rtol=0.1)


@pytest.mark.parametrize("memory", [0.0, 0.03, np.inf])
def test_waves_grow_as_in_theory(memory):
    case = Waved(contrast=20.0, growth=0.01, steps=3, memory=memory)
    exact = np.log(case.expected()[-1])
    coarse, fine = (np.log(amplified(case, cells, COMM)[-1]) for cells in (2, 4))
    assert (np.abs(fine - exact) <= 0.6 * np.abs(coarse - exact)).all()
    # what is left on ever finer meshes: memory changes the long waves by 8 to 28 %,
    # turning normals the short ones
    limit = fine + (fine - coarse) / (2**ORDER - 1)
    np.testing.assert_allclose(limit[LONG], exact[LONG], rtol=0.03)
    np.testing.assert_allclose(limit, exact, rtol=0.2)


@pytest.mark.parametrize(
    ("order", "cells", "fall", "gradient_falls", "left"),
    # left of a displacement with gradients up to 0.4
    [(1, (5, 10, 20), 1.8, (0.9, 1.2), 0.015), (2, (3, 5, 10), 2.7, (1.8, 2.4), 0.003)],
    ids=["linear", "quadratic"],
)
@pytest.mark.parametrize("case", CASES)
def test_errors_fall_with_one_power_more_than_those_of_gradients(
    case, order, cells, fall, gradient_falls, left
):
    errors = [solved(case, number, order=order) for number in cells]
    displacement, gradient = rates(errors).T
    assert displacement[-1] >= fall
    assert order == 2 or displacement[-1] > displacement[0]
    assert gradient_falls[0] <= gradient[-1] <= gradient_falls[1]
    assert errors[-1].displacement < left
