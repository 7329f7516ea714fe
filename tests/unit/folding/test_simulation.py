"""What a simulation says of its steps before it begins."""

import pytest

from gyriflow.folding.parameters import parameters_from
from gyriflow.folding.run import shortened_steps

RUN = {"start_week": 21.0, "end_week": 22.0, "fissure_x_mm": 0.0}


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
