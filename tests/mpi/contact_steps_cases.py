"""Steps of folding with contact: a closing sulcus, mirrored hemispheres, free
blocks."""

from dataclasses import replace

import igl.predicates
import numpy as np
import pytest
from boxes import COMM, zones_of
from contact_bodies import (
    RUN,
    after_steps,
    at_start,
    closing_sulcus,
    in_a_tube,
    two_blocks,
    vertices_pulled_near,
)
from mpi4py import MPI
from verification_cases.mirrored import block, folded, hemisphere, rounded

from gyriflow.settings.folding import parameters_from


def closed_sulcus(kind):
    folding, state = closing_sulcus(kind)
    state = after_steps(folding, state, 12)
    return state, crosses(folding, state)


def crosses(folding, state):
    """Return whether the surface crosses itself."""
    facets = folding.zones.facets
    _, pairs, _ = igl.predicates.find_self_intersections(state.positions, facets)
    return len(pairs) > 0


@pytest.mark.one_rank
def test_a_sulcus_closes_without_crossing_where_it_crosses_without_contact():
    _, has_crossed = closed_sulcus("none")
    assert has_crossed
    state, has_crossed = closed_sulcus("global")
    assert not has_crossed
    row = state.rows[-1]
    assert row["contact_pairs"] > 0
    assert 0 < row["min_distance_mm"] < 0.2
    assert min(row["min_J"] for row in state.rows) > 0
    assert (COMM.bcast(state.positions) == state.positions).all()


@pytest.mark.slow
@pytest.mark.one_rank
def test_a_resumed_run_in_contact_equals_one_without_interruption():
    tight = {"newton_tolerance": 1e-11}
    folding, state = closing_sulcus("global", **tight)
    middle = after_steps(folding, state, 9)
    assert middle.rows[-1]["contact_pairs"] > 0
    ended = after_steps(folding, middle, 2)
    anew = after_steps(closing_sulcus("global", **tight)[0], middle, 2)
    moved = np.abs(ended.positions - middle.positions).max()
    assert np.abs(anew.positions - ended.positions).max() <= 1e-8 * moved


@pytest.mark.parametrize("support", ["free", "box"])
def test_blocks_near_each_other_that_do_not_grow_do_not_move(support):
    # the gap is two thirds of the distance that contact would begin at with this mesh
    mesh = two_blocks(gap=0.1)
    zones = in_a_tube(mesh) if support == "box" else replace(zones_of(mesh), free=True)
    p = parameters_from(RUN | {"growth_rate_per_s": 0.0})
    folding, state = at_start(mesh, zones, p)
    assert folding.contact.distance_mm < 0.1
    after = folding.step(state, state.step_s)
    assert (after.positions == state.positions).all()
    assert after.rows[-1]["newton"] == 0


def test_parts_that_touch_move_as_one():
    # one part grows towards the other, which has to give way: only the whole has no
    # motion of its own
    mesh = two_blocks(gap=0.02)
    low = mesh.vertices[:, 2] < 0
    zones = replace(zones_of(mesh), free=True, growing=low.astype(float))
    rates = {"growth_rate_per_s": 1e-6, "core_growth_rate_per_s": 1e-6}
    folding, state = at_start(mesh, zones, parameters_from(RUN | rates))
    # in the first step they come to touch
    after = after_steps(folding, state, 2)
    u = after.last
    assert np.abs(u.mean(axis=0)).max() <= 1e-12 * np.abs(u).max()
    # by parts, the one that does not grow would keep its place; nothing resists its
    # motion, so it ends where contact begins, and rounding decides if a pair is left
    assert u[~low, 2].mean() > 0.1 * np.abs(u).max()


@pytest.mark.parametrize("support", ["free", "box"])
def test_each_guess_is_swept_for_crossings_from_rest(support, monkeypatch):
    folding, state = closing_sulcus("global", support=support)
    folding.begin(state, state.step_s)
    problem, x = folding.problem, folding.domain.local(state.positions)
    # the groove's walls are pushed through each other
    push = np.sin(np.pi * x[:, 0] / 12e-3) * np.exp(-((x[:, 0] / 3e-3) ** 2)) * x[:, 2]
    guesses = [-size * push[:, None] * [1.0, 0.0, 0.0] for size in (0.8, 1.0)]
    tried, residual = [], problem.residual
    monkeypatch.setattr(problem, "residual", lambda u: tried.append(u) or residual(u))
    folding.solver.solve(*guesses)
    for guess, u in zip(guesses, tried[1:], strict=False):
        guess = problem.without_rigid_motion(guess)
        part = problem.max_step(problem.rest(), guess)
        assert 0.3 < part < 0.9
        assert u == pytest.approx(part * guess, rel=1e-9, abs=1e-12)


@pytest.mark.slow
def test_a_closing_sulcus_is_the_same_on_all_ranks_and_on_one():
    tight = {"newton_tolerance": 1e-11}
    state = after_steps(*closing_sulcus("global", **tight), 10)
    assert state.rows[-1]["contact_pairs"] > 0
    # the first rank and the last one
    if COMM.size > 1 and COMM.rank in (0, COMM.size - 1):
        folding, start = closing_sulcus("global", comm=MPI.COMM_SELF, **tight)
        single = after_steps(folding, start, 10)
        moved = np.abs(single.positions - start.positions).max()
        assert np.abs(single.positions - state.positions).max() <= 1e-6 * moved
        assert single.rows[-1]["contact_pairs"] == state.rows[-1]["contact_pairs"]
    COMM.barrier()


@pytest.mark.parametrize(
    ("half", "steps", "changes"),
    [
        (hemisphere(5), 5, {}),
        (hemisphere(5), 5, {"stress_memory_gw": 1.0}),
        (rounded(hemisphere(4)), 4, {"stress_memory_gw": 1.0}),
    ],
    ids=["forgetting", "remembering", "quadratic"],
)
def test_hemispheres_pressed_against_the_planes_stay_mirror_images(
    half, steps, changes
):
    state, found = folded(half, steps, COMM, **changes)
    # contact acts, and what is compared is large
    assert found.penetration_mm > 0.01
    assert found.displacement_mm > 0.5
    assert found.relative <= 1e-9
    assert (COMM.bcast(state.positions) == state.positions).all()


def test_hemispheres_that_press_on_each_other_stay_mirror_images():
    # growth as it is there: pressed harder, vertices that meet exactly would rather
    # slide aside
    growth = {"core_growth_rate_per_s": 2e-7, "contact": "global"}
    state, found = folded(hemisphere(6), 5, COMM, **growth)
    assert state.rows[-1]["contact_pairs"] > 0
    assert found.relative <= 1e-8


def test_equal_distances_to_several_pial_vertices_do_not_break_the_symmetry():
    _, found = folded(block(6), 4, COMM)
    assert found.displacement_mm > 0.1
    assert found.relative <= 1e-9


@pytest.mark.parametrize("count", [1, 2])
@pytest.mark.parametrize(("gap", "distance_mm"), [(0.5, 0.14), (0.12, 0.03)])
def test_a_few_vertices_that_nearly_touch_are_pressed_apart_and_set_no_contact_distance(
    count, gap, distance_mm
):
    folding, state = vertices_pulled_near(gap, count)
    # that of the edges, or a quarter of the gap of the rest
    assert folding.contact.distance_mm == pytest.approx(distance_mm, rel=0.1)
    after = folding.step(state, state.step_s)
    assert after.rows[-1]["min_distance_mm"] > 0.5 * distance_mm
    assert after.rows[-1]["min_J"] > 0.9
    moved = np.linalg.norm(after.positions - state.positions, axis=1)
    assert np.median(moved) < 0.1 * moved.max()


def test_where_few_vertices_start_at_a_hundredth_of_a_mm_nothing_crosses_as_it_grows():
    folding, state = vertices_pulled_near(0.24, 2, growth_rate_per_s=2e-7)
    for _ in range(4):
        state = folding.step(state, state.step_s)
        assert not crosses(folding, state)
    assert min(row["min_distance_mm"] for row in state.rows) > 0.02


def test_a_small_gap_of_all_sets_the_contact_distance_and_nothing_moves():
    folding, state = vertices_pulled_near(0.03, 2)
    assert folding.contact.distance_mm == pytest.approx(0.01, rel=0.01)
    after = folding.step(state, state.step_s)
    assert (after.positions == state.positions).all()
