"""Parameters as numbers, curves, maps and their products."""

import numpy as np
import pytest
from configurations import cases
from facts import Facts

from gyriflow.errors import InputError
from gyriflow.settings.folding import parameters_from, require_maps
from gyriflow.settings.varying import mean_of_curve, value_at, value_range

RUN = {
    "start_week": 21.0,
    "end_week": 31.0,
    "fissure_x_mm": 0.0,
    "output_weeks": [21.0, 31.0],
}
MAP = {"thickness_mm": np.array([1.0, 2.0, 4.0])}


def value(given):
    """Return a parameter as a run has it."""
    return parameters_from(RUN | {"thickness_mm": given}).thickness_mm


@cases(
    ("given", "weeks", "values"),
    """
    2.0e-3 | [33] | [2.0e-3]
    {weeks: {25: 3.0, "21": 1.0}} | [20, 21, 22, 25, 40] | [1, 1, 1.5, 3, 3]
    {weeks: {21: 1.0, 31: 2.0}, map: thickness_mm} | [26] | [[1.5, 3, 6]]
    {map: thickness_mm} | [26] | [[1, 2, 4]]
    """,
)
def test_a_curve_is_linear_and_constant_beyond_and_multiplied_with_a_map(
    given, weeks, values
):
    for week, expected in zip(weeks, values, strict=True):
        np.testing.assert_allclose(value_at(value(given), week, MAP), expected)


@cases(
    ("given", "weeks", "ends"),
    """
    {weeks: {21: 1.0, 25: 5.0, 28: 0.5, 31: 2.0}} | [21, 31] | [0.5, 5]
    {weeks: {21: 1.0, 25: 5.0, 28: 0.5, 31: 2.0}} | [22, 24] | [2, 4]
    {weeks: {21: 1.0, 25: 5.0, 28: 0.5, 31: 2.0}} | [26, 30] | [0.5, 3.5]
    {weeks: {21: 1.0, 25: 5.0, 28: 0.5, 31: 2.0}} | [22, 27] | [2, 5]
    {weeks: {21: 1.0, 31: 2.0}, map: thickness_mm} | [21, 40] | [1, 8]
    {weeks: {21: 1.0, 31: 2.0}, map: thickness_mm} | [21, 26] | [1, 6]
    """,
)
def test_the_range_of_a_curve_has_its_ends_and_all_between(given, weeks, ends):
    assert value_range(value(given), MAP, *weeks) == tuple(ends)


@cases(
    ("given", "mean"),
    """
    {weeks: {21: 1.0, 25: 5.0, 28: 0.5, 31: 2.0}} | 2.125
    {weeks: {21: 2.0, 31: 4.0}, map: thickness_mm} | 3
    {map: thickness_mm} | 1
    """,
)
def test_the_mean_of_a_curve_is_that_of_its_values(given, mean):
    assert mean_of_curve(value(given)) == mean


@cases(
    ("given",),
    """
    thick
    true
    {}
    {weeks: {}}
    {weeks: [1, 2]}
    {weeks: {21: 1, "21.0": 2, 31: 3}}
    {week: {21: 1}}
    null
    """,
)
def test_what_is_no_number_curve_or_map_is_refused(given):
    with pytest.raises(InputError, match="thickness_mm"):
        value(given)


def test_values_of_a_curve_are_checked_over_all_weeks():
    with pytest.raises(InputError, check=Facts("growth_rate_per_s:", 0, -1e-7)):
        parameters_from(RUN | {"growth_rate_per_s": {"weeks": {21: 1e-7, 30: -1e-7}}})


@pytest.mark.parametrize(
    ("name", "maps", "n_nodes", "facts"),
    [
        ("growth_rate_per_s", [1e-7, -1e-8], 2, [":", 0, -1e-8]),
        ("thickness_mm", [1.0, 0.0, 1.0], 3, [":", 0, "mm"]),
        ("thickness_mm", [1.0, 2.0, 4.0], 4, [3, 4]),
        ("thickness_mm", [1.0, np.nan, np.inf], 3, [2, 3]),
        ("thickness_mm", None, 3, ["--maps"]),
    ],
)
def test_a_map_that_is_missing_or_has_other_values_is_refused(
    name, maps, n_nodes, facts
):
    mapped = parameters_from(RUN | {name: {"map": name}})
    given = {} if maps is None else {name: np.array(maps)}
    with pytest.raises(InputError, check=Facts(name, *facts)):
        require_maps(mapped, given, n_nodes)


def test_a_map_of_allowed_values_passes():
    mapped = parameters_from(RUN | {"thickness_mm": {"map": "thickness_mm"}})
    require_maps(mapped, MAP, 3)
