"""Steps of second order in time: their order, how they meet contact, and runs that are resumed or spread otherwise."""

import sys
from dataclasses import replace
from pathlib import Path

import igl.predicates
import numpy as np
import pytest
from boxes import COMM, distorted_box, zones_of
from contact_bodies import after_steps, closing_sulcus
from shapes import ellipsoid_mesh

from gyriflow.errors import InputError
from gyriflow.folding.checkpoint import State, read_checkpoint, write_checkpoint
from gyriflow.folding.simulation import Folding
from gyriflow.folding.zones import zones_of_run
from gyriflow.parameters.reading import parameters_from
from gyriflow.units import M_PER_MM, MM_PER_M

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
from verification_cases.modes import Slab, amplifications
from verification_cases.slab import Waved, amplified

SECOND_ORDER = ("adams-bashforth", "midpoint")
RUN = {"start_week": 21.0, "end_week": 30.0, "output_weeks": [21.0, 30.0], "fissure_x_mm": 0.0}


def folding_of(mesh, zones=None, **changes):
    p = parameters_from(RUN | {"contact": {"kind": "none"}, "no_growth": {"kind": "none"}} | changes)
    folding = Folding(COMM, mesh, zones_of_run(mesh, p) if zones is None else zones, p)
    return folding, State.at_start(mesh.vertices * M_PER_MM, p.step_s)


@pytest.mark.parametrize(("scheme", "order"), [("implicit", 1), ("adams-bashforth", 2), ("midpoint", 2)])
def test_waves_on_a_slab_grow_with_an_error_of_the_schemes_order(scheme, order):
    slab, k, growth = Slab(5.0, depth=12.0, finest=0.05), 2 * np.pi / np.array([4.0, 7.0]), 0.24
    exact = np.log(amplifications(slab, k, growth / 64, 64, "midpoint")[-1])
    errors = [np.log(amplifications(slab, k, growth / n, n, scheme)[-1]) / exact - 1 for n in (8, 16)]
    assert np.log2(np.abs(errors[0] / errors[1])) == pytest.approx([order, order], abs=0.3)


@pytest.mark.parametrize("scheme", SECOND_ORDER)
def test_the_solver_takes_the_steps_of_the_theory(scheme):
    # long steps, in which the error of an implicit step is a tenth, and what the coarse mesh adds less than a hundredth
    growth, steps = 0.24, 8
    solved = {
        name: np.log(amplified(Waved(5.0, growth / n, n, scheme=name), 2)[-1][:6])
        for name, n in (("implicit", steps), (scheme, steps), ("fine", 0))
        if n
    }
    fine = np.log(amplified(Waved(5.0, growth / 24, 24, scheme="midpoint"), 2)[-1][:6])
    error = {name: np.abs(values / fine - 1).mean() for name, values in solved.items()}
    assert error["implicit"] > 0.03
    assert error[scheme] < 0.3 * error["implicit"]


def with_frozen_tissue(**changes):
    """Returns a folding whose elements keep growth, normals and stiffness: nothing changes at once, as nearest do."""
    mesh = distorted_box()
    zones = zones_of(mesh, lambda centre: centre[:, 2] < -2.99)
    tight = {"solver": {"newton_tolerance": 1e-10, "krylov_tolerance": 1e-8}}
    folding, state = folding_of(mesh, zones, **tight, **changes)
    x, cells = folding.domain.local(folding.domain.positions), folding.domain.cells
    normals = x[cells].mean(axis=1) - [0.0, 0.0, -6e-3]
    normals /= np.linalg.norm(normals, axis=1)[:, None]

    def set_tissue(time_s, step_s):
        # growth that depends on time, too
        growth = 4e-7 * step_s * (1 + 1e-6 * time_s) * (1 + x[:, 2] / 3e-3)
        folding.problem.set_layers(500.0 + 1e5 * (x[:, 2] + 3e-3), growth, 0.2 * growth, normals)

    folding._set_tissue = set_tissue
    return folding, state


@pytest.mark.parametrize(("scheme", "order"), [("implicit", 1), ("adams-bashforth", 2), ("midpoint", 2)])
@pytest.mark.parametrize("pattern", [(1.0, 1.0, 1.0, 1.0), (1.0, 0.5, 1.5, 1.0)])
def test_the_places_of_smoothly_changing_tissue_have_an_error_of_the_schemes_order(scheme, order, pattern):
    def end(name, parts):
        folding, state = with_frozen_tissue(time_scheme=name)
        for part in parts:
            state = folding.step(state, part * 86400)
        return state.positions

    exact = end("midpoint", (1 / 16,) * 64)
    halves, quarters = (tuple(part / n for part in pattern for _ in range(n)) for n in (2, 4))
    errors = [np.abs(end(scheme, parts) - exact).max() for parts in (pattern, halves, quarters)]
    assert np.log2(errors[1] / errors[2]) == pytest.approx(order, abs=0.3)


def test_a_velocity_is_the_limit_of_short_implicit_steps():
    mesh = distorted_box()
    zones = zones_of(mesh, lambda centre: centre[:, 2] < -2.99)
    tight = {"solver": {"newton_tolerance": 1e-10, "krylov_tolerance": 1e-8}, "thickness_mm": 2.0}
    folding, state = folding_of(mesh, zones, time_scheme="adams-bashforth", step_s=43200, **tight)
    rate = folding.step(state, 43200.0).rate
    errors = []
    for step_s in (4000.0, 2000.0):
        folding, state = folding_of(mesh, zones, step_s=step_s, **tight)
        errors.append(np.abs(folding.step(state, step_s).last / step_s - rate).max() / np.abs(rate).max())
    assert errors[1] < 1e-3
    assert errors[0] / errors[1] == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("scheme", SECOND_ORDER)
def test_a_sulcus_closes_without_crossing(scheme):
    folding, state = closing_sulcus("global", time_scheme=scheme)
    state = after_steps(folding, state, 12)
    _, crossing, _ = igl.predicates.find_self_intersections(state.positions * MM_PER_M, folding.zones.facets)
    assert len(crossing) == 0
    row = state.rows[-1]
    assert row["contact_pairs"] > 0
    assert all(row["converged"] for row in state.rows)
    # beside the implicit steps, which the same contact stops
    implicit = after_steps(*closing_sulcus("global"), 12)
    assert row["min_distance_mm"] == pytest.approx(implicit.rows[-1]["min_distance_mm"], rel=0.3)
    moved = np.abs(implicit.positions - folding._start).max()
    assert np.abs(state.positions - implicit.positions).max() < 0.1 * moved


@pytest.mark.parametrize("scheme", SECOND_ORDER)
def test_a_run_goes_on_from_its_checkpoint_exactly_where_it_was(scheme, tmp_path_factory):
    tight = {"solver": {"newton_tolerance": 1e-11, "krylov_tolerance": 1e-8}, "time_scheme": scheme}
    folding, state = closing_sulcus("global", **tight)
    middle = after_steps(folding, state, 9)
    path = COMM.bcast(tmp_path_factory.mktemp("run")) / "state.h5"
    if COMM.rank == 0:
        write_checkpoint(path, "a", middle)
    COMM.barrier()
    read, _ = read_checkpoint(path, "a")
    assert (read.rate == middle.rate).all()
    ended = after_steps(folding, middle, 2)
    anew = after_steps(closing_sulcus("global", **tight)[0], read, 2)
    moved = np.abs(ended.positions - middle.positions).max()
    assert np.abs(anew.positions - ended.positions).max() <= 1e-8 * moved
    # without the velocity of the step before, it would not be
    without = after_steps(closing_sulcus("global", **tight)[0], replace(read, rate=None, before_rate=None), 2)
    if scheme == "adams-bashforth":
        assert np.abs(without.positions - ended.positions).max() > 1e-6 * moved


def test_what_does_not_grow_does_not_move():
    folding, state = folding_of(distorted_box(), time_scheme="adams-bashforth", growth_rate_per_s=0.0, support="free")
    assert (after_steps(folding, state, 2).positions == state.positions).all()


def test_a_free_body_does_not_drift():
    mesh = distorted_box()
    zones = replace(zones_of(mesh), free=True)
    folding, state = folding_of(mesh, zones, time_scheme="adams-bashforth", thickness_mm=2.0, support="free")
    folding._growth = (folding.domain.local(folding.domain.positions)[:, 0] > 0).astype(float)
    for _ in range(4):
        state = folding.step(state, 43200.0)
        assert np.abs(state.last.mean(axis=0)).max() <= 1e-9 * np.abs(state.last).max()


def test_the_stress_of_a_velocity_is_that_of_a_short_implicit_step():
    found = []
    for scheme in ("adams-bashforth", "implicit"):
        settings = {"thickness_mm": 2.5, "fields": ["stress", "strain"], "step_s": 1000, "time_scheme": scheme}
        folding, state = folding_of(ellipsoid_mesh(2, (12.0, 16.0, 10.0)), **settings)
        folding.step(state, state.step_s)
        found.append(folding.element_fields(["stress"])["pressure_pa_per_gw"])
    assert np.median(np.abs(found[0] - found[1])) < 0.005 * np.median(np.abs(found[1]))


@pytest.mark.parametrize("changes", [{"stress_memory_gw": 1.0}, {"contact": {"kind": "planes"}}])
def test_velocities_need_a_model_that_forgets_and_no_planes(changes):
    with pytest.raises(InputError, match="time_scheme"):
        parameters_from(RUN | {"time_scheme": "midpoint"} | changes)
