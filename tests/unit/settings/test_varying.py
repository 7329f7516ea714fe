"""Parameters as numbers, curves, maps and their products."""

import numpy as np
import pytest
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


def test_a_curve_is_linear_between_its_weeks_and_constant_beyond():
    assert value_at(value("2e-3"), 33.0, {}) == 2e-3
    curve = value({"weeks": {25: 3.0, "21": 1.0}})
    assert [value_at(curve, week, {}) for week in (20.0, 21.0, 22.0, 25.0, 40.0)] == [
        1.0,
        1.0,
        1.5,
        3.0,
        3.0,
    ]


def test_a_map_is_multiplied_with_the_curve():
    both = value({"weeks": {21: 1.0, 31: 2.0}, "map": "thickness_mm"})
    np.testing.assert_allclose(value_at(both, 26.0, MAP), [1.5, 3.0, 6.0])
    assert value_range(both, MAP, 21.0, 40.0) == (1.0, 8.0)
    assert value_range(both, MAP, 21.0, 26.0) == (1.0, 6.0)
    np.testing.assert_allclose(
        value_at(value({"map": "thickness_mm"}), 26.0, MAP), MAP["thickness_mm"]
    )


def test_the_range_of_a_curve_has_its_ends_and_all_between():
    curve = value({"weeks": {21: 1.0, 25: 5.0, 28: 0.5, 31: 2.0}})
    assert value_range(curve, {}, 21.0, 31.0) == (0.5, 5.0)
    assert value_range(curve, {}, 22.0, 24.0) == (2.0, 4.0)
    assert value_range(curve, {}, 26.0, 30.0) == (0.5, 3.5)
    assert value_range(curve, {}, 22.0, 27.0) == (2.0, 5.0)
    assert mean_of_curve(curve) == pytest.approx(8.5 / 4)
    both = value({"weeks": {21: 2.0, 31: 4.0}, "map": "thickness_mm"})
    assert mean_of_curve(both) == 3.0
    assert mean_of_curve(value({"map": "thickness_mm"})) == 1.0


@pytest.mark.parametrize(
    "given",
    [
        "thick",
        True,
        {},
        {"weeks": {}},
        {"weeks": [1, 2]},
        {"weeks": {21: 1, "21.0": 2, 31: 3}},
        {"week": {21: 1}},
        None,
        "estimated",
    ],
)
def test_what_is_no_number_curve_or_map_is_refused(given):
    with pytest.raises(InputError, match="thickness_mm"):
        value(given)


def test_values_are_checked_over_all_weeks_and_places():
    with pytest.raises(InputError, check=Facts("growth_rate_per_s:", 0, -1e-7)):
        parameters_from(RUN | {"growth_rate_per_s": {"weeks": {21: 1e-7, 30: -1e-7}}})
    rates = parameters_from(RUN | {"growth_rate_per_s": {"map": "rate"}})
    with pytest.raises(InputError, check=Facts("growth_rate_per_s:", 0, -1e-8)):
        require_maps(rates, {"rate": np.array([1e-7, -1e-8])}, 2)
    mapped = parameters_from(RUN | {"thickness_mm": {"map": "thickness_mm"}})
    require_maps(mapped, MAP, 3)
    with pytest.raises(InputError, check=Facts("thickness_mm:", 0, "mm")):
        require_maps(mapped, {"thickness_mm": np.array([1.0, 0.0, 1.0])}, 3)


def test_a_missing_or_unfitting_map_is_refused():
    mapped = parameters_from(RUN | {"thickness_mm": {"map": "thickness_mm"}})
    with pytest.raises(InputError, check=Facts("thickness_mm", "--maps")):
        require_maps(mapped, {}, 3)
    with pytest.raises(InputError, check=Facts("thickness_mm", 3, 4)):
        require_maps(mapped, MAP, 4)
    for bad in (np.nan, np.inf, -np.inf):
        with pytest.raises(InputError, check=Facts("thickness_mm", 2, 3)):
            require_maps(mapped, {"thickness_mm": np.array([1.0, bad, bad])}, 3)
