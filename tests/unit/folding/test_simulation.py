"""The steps of a simulation: which are shortened, and how halved ones grow back."""

from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI

from gyriflow.errors import SolverError
from gyriflow.folding import simulation
from gyriflow.folding.checkpoint import State
from gyriflow.folding.linear_solver import NotConvergedError
from gyriflow.folding.run import shortened_steps
from gyriflow.folding.simulation import STEPS_BEFORE_GROWING, advance
from gyriflow.parameters.folding import parameters_from

RUN = {"start_week": 21.0, "end_week": 22.0, "fissure_x_mm": 0.0}


@pytest.mark.fault(30)
@pytest.mark.parametrize(
    ("step_s", "weeks", "shortened"),
    [
        (43200.0, [21.0, 22.0], ""),
        (302400.0, [21.0, 21.5, 22.0], ""),
        (43200.0, [21.0, 21.25, 22.0], "from GW 21 to 21.25"),
        (43200.0, [21.0, 21.5, 21.75, 22.0], "from GW 21.5 to 21.75"),
        (500000.0, [21.0, 22.0], "from GW 21 to 22"),
    ],
)
def test_a_step_that_does_not_divide_the_time_between_outputs_is_said(step_s, weeks, shortened):
    said = shortened_steps(parameters_from(RUN | {"step_s": step_s, "output_weeks": weeks}))
    assert bool(said) == bool(shortened)
    assert shortened in said
    assert not said or said.startswith(f"step_s {step_s:g} does not divide")


class Stepper:
    """A folding whose steps fail where they are too long for the time."""

    def __init__(self, longest, **changes):
        self.parameters = parameters_from(RUN | {"output_weeks": [21.0, 22.0]} | changes)
        self.domain = SimpleNamespace(comm=MPI.COMM_SELF, order=1)
        self.longest, self.solver = longest, None

    def step(self, state, step_s):
        if step_s > self.longest(state.time_s):
            raise NotConvergedError("too long")
        row = {"dt_s": step_s, "converged": True, "elements_through_cortex": 2.5}
        return state.after(np.zeros((1, 3)), step_s, row)


def steps_to(stepper, until_s):
    state = State.at_start(np.zeros((1, 3)), stepper.parameters.step_s)
    while state.time_s < until_s * (1 - 1e-12):
        state = advance(stepper, state, until_s)
    assert state.time_s == pytest.approx(until_s, rel=1e-12)
    return [row["dt_s"] for row in state.rows]


@pytest.mark.fault(32)
def test_a_failing_step_is_halved_and_grows_back():
    # nothing longer than 11 000 s works before 60 000 s
    lengths = steps_to(Stepper(lambda time_s: 11_000.0 if time_s < 60_000 else 1e9), 604_800.0)
    assert lengths[0] == 10_800
    assert max(lengths) == 43_200
    first = lengths.index(21_600)
    assert first >= STEPS_BEFORE_GROWING
    assert lengths[first + STEPS_BEFORE_GROWING] == 43_200


@pytest.mark.fault(32)
def test_where_the_smallest_step_fails_the_place_is_named(monkeypatch):
    monkeypatch.setattr(simulation, "worst_places", lambda _: "at [1.0, 2.0, 3.0] mm")
    stepper = Stepper(lambda time_s: 1.0, solver={"max_halvings": 2})
    with pytest.raises(SolverError, match=r"fails even with 10800 s.*at \[1.0, 2.0, 3.0\] mm"):
        steps_to(stepper, 604_800.0)


def test_a_short_remainder_is_halved_as_often_as_a_whole_step():
    # 43 200 s and 800 s: what is left over is far below the smallest part of a whole step
    stepper = Stepper(lambda time_s: 1e9 if time_s < 43_000 else 300.0, solver={"max_halvings": 3})
    assert steps_to(stepper, 44_000.0) == pytest.approx([43_200.0, 200.0, 200.0, 200.0, 200.0])
