"""Charts of growth and displacement hold what their tables say."""

import numpy as np
import pandas as pd
import pytest
from pictures import words

from gyriflow.report.growth import displacement_chart, growth_chart

AREAS = pd.DataFrame(
    {"series": "volume", "week": [21.0, 23.0, 22.0], "area_cm2": [100, 130, 115], "volume_ml": [50, 70, 60]}
)
RATES = pd.DataFrame(
    {"series": "volume", "from_week": [21.0, 22.0], "to_week": [22.0, 23.0], "rate_per_s": [1.2e-7, -0.3e-7]}
)


def line_of(axes, label):
    """Return the (n, 2) data of the line whose label begins so."""
    (line,) = [line for line in axes.lines if str(line.get_label()).startswith(label)]
    return np.array(line.get_xydata())


def test_growth_bars_are_the_rates_in_units_of_1e_7_per_second():
    figure = growth_chart(AREAS, RATES, folding_rate_per_s=2e-7)
    area_axes, volume_axes, rate_axes = figure.axes
    assert {"a", "b", "c"} <= words(figure)
    assert [bar.get_height() for bar in rate_axes.patches] == pytest.approx([1.2, -0.3])
    assert "10⁻⁷ s⁻¹" in rate_axes.get_ylabel()
    assert [label.get_text() for label in rate_axes.get_xticklabels()] == ["21–22", "22–23"]
    assert line_of(rate_axes, "folding")[:, 1] == pytest.approx([2.0, 2.0])
    assert area_axes.lines[0].get_xydata().tolist() == [[21, 100], [22, 115], [23, 130]]
    assert volume_axes.lines[0].get_ydata().tolist() == [50, 60, 70]


def test_the_rates_of_many_subjects_share_a_panel():
    names = [f"sub-{number}" for number in range(9)]
    figure = growth_chart(
        pd.concat([AREAS.assign(series=name) for name in names]),
        pd.concat([RATES.assign(series=name) for name in names]),
    )
    *_, rates = figure.axes
    assert len(figure.axes) == 3
    # two intervals of each, and zero
    assert len(rates.lines) == 19
    assert rates.lines[0].get_xydata().tolist() == [[21, pytest.approx(1.2)], [22, pytest.approx(1.2)]]
    assert "sub-1" not in words(figure)


def test_a_folding_rate_that_changes_is_drawn_over_the_intervals_of_the_bars():
    curve = {21.5: 1e-7, 22.5: 2e-7, 25.0: 4.5e-7}
    figure = growth_chart(AREAS, RATES, folding_rate_per_s=curve)
    # the bars of weeks 21-22 and 22-23 stand at 0 and 1, one wide: constant up to 21.5, linear from there on
    assert line_of(figure.axes[2], "folding") == pytest.approx(
        np.array([[-0.5, 1.0], [0.0, 1.0], [0.5, 1.5], [1.0, 2.0], [1.5, 2.5]])
    )
    assert "folding" in words(figure)


def test_displacement_is_that_of_all_nodes_per_week_at_the_middle_of_the_interval():
    weeks = {"from_week": [21.0, 21.0, 25.0], "to_week": [22.0, 22.0, 27.0], "nodes": ["all", "pial", "all"]}
    norms = pd.DataFrame({"run": "thin", "subject": "s", **weeks, "max_mm": 3.0, "mean_mm": [0.57, 0.8, 0.5]})
    largest, mean = displacement_chart(norms).axes
    lines = {line.get_label(): line.get_xydata().tolist() for line in mean.lines}
    assert lines["thin"] == [[21.5, 0.57], [26.0, 0.25]]
    assert [mean for _, mean in lines["FetalFoldSim"]] == [0.42, 0.40, 0.38, 0.40]
    assert [mean for _, mean in lines["Wang et al. 2021"]] == [0.45, 0.88, 1.91, 3.03]
    assert "per week" in largest.get_ylabel()
