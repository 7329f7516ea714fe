"""When a kept preconditioner has served its time."""

import pytest

from gyriflow.folding.krylov import SETUP, YARDSTICK, PreconditionerLifetime


def new_one(per_power):
    lifetime = PreconditionerLifetime()
    lifetime.renew()
    for _ in range(YARDSTICK):
        lifetime.add(3 * per_power, 1e-3)
    return lifetime


def test_one_that_serves_as_well_as_when_it_was_new_is_kept():
    lifetime = new_one(10)
    for _ in range(1000):
        lifetime.add(20, 1e-2)
        lifetime.add(5, 10**-0.5)
    assert not lifetime.over


def test_one_that_has_cost_as_many_iterations_too_many_as_a_new_one_is_over():
    lifetime, solves = new_one(10), 0
    while not lifetime.over:
        lifetime.add(27, 1e-2)
        solves += 1
    assert solves == pytest.approx(SETUP / 7, abs=1)
    lifetime.renew()
    assert not lifetime.over


def test_what_fails_is_over_at_once():
    lifetime = new_one(10)
    lifetime.end()
    assert lifetime.over
