"""The steps of a simulation: their lengths, how stiff contact is from one to the next,
and what is told of the mesh."""

from types import SimpleNamespace

import numpy as np
import pytest
from facts import Facts
from mpi4py import MPI

from gyriflow.errors import SolverError
from gyriflow.folding.checkpoint import State
from gyriflow.folding.checks import stiffness_warning
from gyriflow.folding.linear_solver import NotConvergedError
from gyriflow.folding.predicted_memory import predicted_memory_mib
from gyriflow.folding.run import (
    _report_flat_elements,
    _report_step,
)
from gyriflow.folding.simulation import (
    STEPS_BEFORE_DOUBLING,
    advance,
)
from gyriflow.geometry.tetrahedra import TetrahedralMesh
from gyriflow.settings.folding import parameters_from
from gyriflow.units import SECONDS_PER_GW

RUN = {"start_week": 21.0, "end_week": 22.0, "fissure_x_mm": 0.0}


class Stepper:
    """A folding whose steps fail where they are too long for the time; the cortex is as
    many elements thick as in `through`, step by step."""

    def __init__(
        self,
        longest=lambda time_s: 1e9,
        through=(2.5,),
        order=1,
        converged=True,
        **changes,
    ):
        self.parameters = parameters_from(
            RUN | {"output_weeks": [21.0, 22.0]} | changes
        )
        self.domain = SimpleNamespace(comm=MPI.COMM_SELF, order=order)
        self.longest, self.solver = longest, None
        self.through, self.converged = through, converged

    def step(self, state, step_s):
        if step_s > self.longest(state.time_s):
            raise NotConvergedError("too long")
        number = len(state.rows)
        row = {
            "step": number + 1,
            "dt_s": step_s,
            "residual": 3e-6,
            "converged": self.converged,
            "elements_through_cortex": self.through[number % len(self.through)],
            "week": 21.0 + number,
        }
        return state.after(np.zeros((1, 3)), step_s, row)


def steps_to(stepper, until_s):
    state = State.at_start(np.zeros((1, 3)), stepper.parameters.step_s)
    while state.time_s < until_s * (1 - 1e-12):
        state = advance(stepper, state, until_s)
    assert state.time_s == pytest.approx(until_s, rel=1e-12)
    return [row["dt_s"] for row in state.rows]


def test_a_failing_step_is_halved_and_grows_back():
    # nothing longer than 11 000 s works before 60 000 s
    stepper = Stepper(lambda time_s: 11_000.0 if time_s < 60_000 else 1e9)
    lengths = steps_to(stepper, 604_800.0)
    assert lengths[0] == 10_800
    assert max(lengths) == 43_200
    first = lengths.index(21_600)
    assert first >= STEPS_BEFORE_DOUBLING
    assert lengths[first + STEPS_BEFORE_DOUBLING] == 43_200


def test_the_last_step_to_an_output_week_takes_what_is_left():
    lengths = steps_to(Stepper(), 100_000.0)
    assert lengths == pytest.approx([43_200.0, 43_200.0, 13_600.0])


def test_where_the_smallest_step_fails_the_place_is_named():
    stepper = Stepper(lambda time_s: 1.0, max_halvings=2)
    stepper.solver = SimpleNamespace(worst_places=lambda: "at [1.0, 2.0, 3.0] mm")
    with pytest.raises(SolverError, check=Facts("10800 s", "[1.0, 2.0, 3.0] mm")):
        steps_to(stepper, 604_800.0)


def test_a_short_remainder_is_halved_as_often_as_a_whole_step():
    # 43 200 s and 800 s: what is left over is far below the smallest part of a whole
    # step
    stepper = Stepper(lambda time_s: 1e9 if time_s < 43_000 else 300.0, max_halvings=3)
    lengths = steps_to(stepper, 44_000.0)
    assert lengths == pytest.approx([43_200.0] + [200.0] * 4)


@pytest.mark.parametrize(
    ("order", "through", "facts"),
    [
        (1, [2.3, 2.1, 1.9, 1.8], ("GW 23.00", 2)),
        (1, [1.5], ("start", 2)),
        # the default mesh at its start
        (2, [0.81], None),
        (2, [1.2, 0.79], ("GW 22.00", 0.8)),
        # counts are judged as they are shown, with two digits
        (1, [2.3, 1.96], None),
        (2, [0.796], None),
        # no element lies in the cortex at all
        (1, [np.nan], (2,)),
    ],
)
def test_a_cortex_that_outgrows_its_elements_gives_one_warning(
    order, through, facts, caplog
):
    steps_to(Stepper(through=through, order=order), 43_200.0 * len(through))
    assert caplog.messages == ([Facts(*facts)] if facts else [])


def test_growth_without_layers_is_not_warned_of_a_coarse_cortex(caplog):
    sizes = {"area_cm2": {21: 90, 22: 99}, "volume_ml": {21: 40, 22: 46}}
    growth = {"model": "shapes", "of": "self"} | sizes
    targets = {22.0: "target_22"}
    steps_to(Stepper(through=[1.0], growth=growth, targets=targets), 86_400.0)
    assert caplog.messages == []


def test_a_step_above_its_tolerance_gives_a_warning(caplog):
    steps_to(Stepper(converged=False), 43_200.0)
    assert caplog.messages == [Facts(1, "3.0e-06")]


def test_nearly_incompressible_tissue_gives_a_warning():
    assert stiffness_warning(0.45) == stiffness_warning(0.46) == ""
    assert stiffness_warning(0.48) == Facts(0.48)


@pytest.mark.parametrize(("n_flat", "is_warning"), [(0, False), (2, False), (3, True)])
def test_more_than_a_thousandth_of_flat_elements_give_a_warning(
    n_flat, is_warning, caplog, capsys
):
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    apart = 2.0 * np.arange(2000)[:, None, None] * [1.0, 0.0, 0.0]
    tets = np.arange(8000).reshape(-1, 4)
    mesh = TetrahedralMesh((corners + apart).reshape(-1, 3), tets)
    positions = mesh.vertices.copy()
    positions[tets[:n_flat, 3], 2] = 0.001
    _report_flat_elements(mesh, positions, 23.5)
    # elements that were as flat at the start are no news
    _report_flat_elements(TetrahedralMesh(positions, tets), positions, 23.5)
    printed = capsys.readouterr().out.splitlines()
    facts = [Facts("GW 23.5", f"{n_flat} of 2000")] if n_flat else []
    assert (caplog.messages, printed) == ((facts, []) if is_warning else ([], facts))


@pytest.mark.parametrize(
    ("order", "tets", "ranks", "contact", "measured"),
    [
        (1, 182_779, 1, "planes", 564),
        (1, 448_597, 1, "global", 1001),
        (1, 499_373, 2, "global", 1580),
        (2, 23_910, 2, "none", 838),
        (2, 34_684, 1, "global", 784),
    ],
)
def test_predicted_memory_is_what_runs_have_taken(
    order, tets, ranks, contact, measured
):
    found = predicted_memory_mib(tets, ranks, contact, order)
    assert found == pytest.approx(measured, rel=0.155)


def test_the_time_that_is_left_is_that_of_the_steps_to_the_end(capsys):
    step_s = SECONDS_PER_GW / 14
    row = {"step": 7, "week": 21.5, "newton": 3, "krylov": 40, "seconds": 2.5}
    row |= {"max_u_mm": 0.7, "min_J": 0.85}
    start = State.at_start(np.zeros((1, 3)), step_s)
    state = start.after(np.zeros((1, 3)), step_s, row)
    # 21 steps of 5 s
    _report_step(state, 23.0, 5.0)
    assert capsys.readouterr().out == Facts("GW 21.500/23", "1:45", "0.700 mm", 0.85)
