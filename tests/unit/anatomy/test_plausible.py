"""Brains of a series that do not fit each other, and shares of the medial wall by
week."""

import pytest
from facts import Facts

from gyriflow.anatomy.plausible import max_cut_share, thickness_jumps


@pytest.mark.parametrize(
    ("series", "told"),
    [
        ([(25, 1.22), (27, 2.32)], [("25", "1.22 mm", "27", "2.32 mm")]),
        # thinner, in the order of the weeks, over a brain whose thickness is not known
        (
            [(29, 1.0), (24.5, 2.0), (26, float("nan"))],
            [("24.5", "2.00 mm", "29", "1.00 mm")],
        ),
        ([(21, 1.6), (22, 1.95), (25, 2.6), (35, 3.0)], []),
        ([(24, 2.0), (24.2, 2.45)], []),
        ([(24, 2.0), (24.2, 2.6)], [("24.2", "2.60 mm")]),
    ],
)
def test_thickness_that_jumps_between_two_weeks_is_told(series, told):
    found = thickness_jumps((f"brain-{week}", week, mm) for week, mm in series)
    assert found == [Facts(*facts) for facts in told]


def test_the_usual_share_of_a_cut_is_between_those_of_the_weeks_beside():
    assert max_cut_share(24.0) == pytest.approx(2.0 * (0.25 * 0.15 + 0.75 * 0.17))
