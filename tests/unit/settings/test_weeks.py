"""Gestational ages as people write them, in weeks and days, as decimals and in
days."""

import pytest
from facts import Facts

from gyriflow.settings.weeks import read_week


@pytest.mark.parametrize(
    ("text", "unit", "notation", "week"),
    [
        ("24", "weeks", None, 24.0),
        ("24.3", "weeks", None, 24.3),
        ("24,5 GW", "weeks", None, 24.5),
        ("24.3", "weeks", "decimal", 24.3),
        # weeks and days with a point between them
        ("24.3", "weeks", "days", 24.43),
        ("24", "weeks", "days", 24.0),
        ("24+2", "weeks", "decimal", 24.29),
        ("24w2d", "weeks", None, 24.29),
        ("24 weeks, 6 days", "weeks", None, 24.86),
        ("24 5/7", "weeks", None, 24.71),
        ("171", "days", None, 24.43),
        ("170.5", "days", "days", 24.36),
        ("15", "weeks", None, 15.0),
        ("45", "weeks", None, 45.0),
    ],
)
def test_an_age_is_read_in_its_notation_and_unit(text, unit, notation, week):
    assert read_week(text, unit, notation) == (week, "")


@pytest.mark.parametrize(
    ("text", "unit", "notation", "facts"),
    [
        ("14.9", "weeks", None, [14.9, "weeks", 15, 45]),
        ("45.1", "weeks", None, [45.1, 15, 45]),
        ("24", "days", None, ["24 in days", 15, 45]),
        ("24.7", "weeks", "days", [24.7, "0 to 6 days"]),
        ("24.35", "weeks", "days", [24.35, "0 to 6 days"]),
        ("24+7", "weeks", None, ["24+7", "24w2d"]),
        ("", "weeks", None, ["n/a"]),
    ],
)
def test_what_is_no_age_is_named_with_what_is_expected(text, unit, notation, facts):
    week, problem = read_week(text, unit, notation)
    assert week is None
    assert problem == Facts(*facts)
