"""When a kept preconditioner has served its time."""

import pytest

from gyriflow.folding.krylov import SETUP, YARDSTICK, Wear


def new_wear(per_power):
    wear = Wear()
    wear.renew()
    for _ in range(YARDSTICK):
        wear.add(3 * per_power, 1e-3)
    return wear


def test_before_the_first_there_is_none():
    assert Wear().stale


def test_one_that_serves_as_well_as_when_it_was_new_is_kept():
    wear = new_wear(10)
    for _ in range(1000):
        wear.add(20, 1e-2)
        wear.add(5, 10**-0.5)
    assert not wear.stale


def test_one_that_has_cost_as_many_iterations_too_many_as_a_new_one_is_stale():
    wear, solves = new_wear(10), 0
    while not wear.stale:
        wear.add(27, 1e-2)
        solves += 1
    assert solves == pytest.approx(SETUP / 7, abs=1)
    wear.renew()
    assert not wear.stale


def test_what_fails_is_stale_at_once():
    wear = new_wear(10)
    wear.wear_out()
    assert wear.stale
