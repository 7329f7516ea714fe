"""Gestational ages as people write them, in weeks and days, as decimals and in
days."""

from configurations import cases
from facts import Facts

from gyriflow.settings.weeks import read_week


@cases(
    ("text", "unit", "notation", "week"),
    """
    "24" | weeks | null | 24.0
    "24.3" | weeks | null | 24.3
    "24,5 GW" | weeks | null | 24.5
    "24.3" | weeks | decimal | 24.3
    "24.3" | weeks | days | 24.43
    "24" | weeks | days | 24.0
    "24+2" | weeks | decimal | 24.29
    24w2d | weeks | null | 24.29
    24 weeks, 6 days | weeks | null | 24.86
    24 5/7 | weeks | null | 24.71
    "171" | days | null | 24.43
    "170.5" | days | days | 24.36
    "15" | weeks | null | 15.0
    "45" | weeks | null | 45.0
    """,
)
def test_an_age_is_read_in_its_notation_and_unit(text, unit, notation, week):
    assert read_week(text, unit, notation) == (week, "")


@cases(
    ("text", "unit", "notation", "facts"),
    """
    "14.9" | weeks | null | [14.9, weeks, 15, 45]
    "45.1" | weeks | null | [45.1, 15, 45]
    "24" | days | null | [24 in days, 15, 45]
    "24.7" | weeks | days | [24.7, 0 to 6 days]
    "24.35" | weeks | days | [24.35, 0 to 6 days]
    24+7 | weeks | null | [24+7, 24w2d]
    "" | weeks | null | [n/a]
    """,
)
def test_what_is_no_age_is_named_with_what_is_expected(text, unit, notation, facts):
    week, problem = read_week(text, unit, notation)
    assert week is None
    assert problem == Facts(*facts)
