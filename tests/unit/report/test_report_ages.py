"""The chart of ages holds what the tables say."""

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from gyriflow.errors import InputError
from gyriflow.report.ages import age_profile_chart
from gyriflow.report.style import RUN_COLOURS

COLUMNS = ["metric", "kind", "estimated_week", "low", "high", "weight", "flag"]


def brain(run: str, week: float, shift: float, flag: str = "ok") -> pd.DataFrame:
    rows = [
        ("area", "size", week + shift, week + shift - 1, week + shift + 1, 0.6, flag),
        ("gyrification_index", "size-free", week - shift, week - shift, week - shift, 0.4, "ok"),
        ("sulcal_area_share", "size-free", 25.0, 21.0, 29.0, 0.0, "no age signal"),
        ("all", "together", week + shift, week - 1, week + 2, 1.0, flag),
        ("all without size", "together", week - shift, week - 2, week + 1, 1.0, "ok"),
        ("size alone", "together", week, week, week, 1.0, "ok"),
    ]
    table = pd.DataFrame(rows, columns=COLUMNS).assign(run=run, week=week, mean_absolute_error=0.0, brains_per_week=1)
    table.loc[table["metric"] == "all", "mean_absolute_error"] = 0.37
    table.loc[table["metric"] == "all without size", "mean_absolute_error"] = 1.25
    # sides are not drawn
    return pd.concat([table.assign(hemisphere="whole"), table.assign(hemisphere="left", estimated_week=99.0)])


PROFILE = pd.concat(
    [brain("a", 22.0, 0.25), brain("a", 23.0, 0.25), brain("a", 24.0, 0.25), brain("b", 23.0, 0.5, "older than 26")]
)
CHECK = pd.concat([brain("real", week, 0.75) for week in (21.0, 22.0, 23.0, 24.0, 25.0)])

SIMILARITY = pd.DataFrame(
    [
        (run, week, side, of, 0.9 - 0.2 * abs(week - of) if side == "whole" else 0.0)
        for run in ("a", "b", "real")
        for week in (22.0, 23.0)
        for side in ("whole", "left")
        for of in (21.0, 22.0, 23.0, 24.0)
    ],
    columns=["run", "week", "hemisphere", "reference_week", "similarity"],
)


@pytest.fixture(scope="module")
def figure() -> Figure:
    return age_profile_chart(PROFILE, CHECK, SIMILARITY)


def marks(axes, colour: str, *, open_ones: bool, marker: str) -> list[tuple[float, float]]:
    """Returns the points of one look, single metrics left out."""
    return [
        (round(float(line.get_xdata()[0])), float(line.get_ydata()[0]))
        for line in axes.lines
        if line.get_marker() == marker
        and line.get_markersize() > 4
        and mpl.colors.same_color(line.get_color(), colour)
        and mpl.colors.same_color(line.get_markerfacecolor(), "white") == open_ones
    ]


def test_simulated_brains_on_the_left(figure):
    axes = figure.axes[0]
    a, b = RUN_COLOURS[:2]
    assert marks(axes, a, open_ones=False, marker="o") == [(22, 22.25), (23, 23.25), (24, 24.25)]
    assert marks(axes, a, open_ones=True, marker="o") == [(22, 21.75), (23, 22.75), (24, 23.75)]
    # outside the reference
    assert marks(axes, b, open_ones=False, marker="^") == [(23, 23.5)]
    assert marks(axes, b, open_ones=True, marker="o") == [(23, 22.5)]


def test_reference_brains_left_out_on_the_right(figure):
    axes = figure.axes[1]
    found = marks(axes, "black", open_ones=False, marker="*")
    assert found == [(week, week + 0.75) for week in range(21, 26)]
    assert "0.37 GW" in axes.get_title()
    assert "1.25 GW" in axes.get_title()


def test_both_panels_have_equal_weeks_and_the_line_of_equal_age(figure):
    for axes in figure.axes[:2]:
        assert axes.get_xlim() == axes.get_ylim()
        (line,) = [line for line in axes.lines if line.get_linestyle() == ":"]
        np.testing.assert_array_equal(line.get_xdata(), line.get_ydata())
    assert figure.axes[0].get_xlim() == figure.axes[1].get_xlim()


def test_single_metrics_at_the_last_week_of_all_runs(figure):
    axes = figure.axes[2]
    assert "at 23 GW" in axes.get_title()
    # without weight, or of both kinds together, they are no single metrics
    assert [text.get_text() for text in axes.get_yticklabels()] == ["area  60 %", "gyrification index  40 %"]
    points = {float(line.get_xdata()[0]) for line in axes.lines if line.get_marker() in ("o", "^")}
    assert points == {23.25, 22.75, 23.5, 22.5}
    ranges = {tuple(line.get_xdata()) for line in axes.lines if len(line.get_xdata()) == 2 and line.get_alpha()}
    assert (22.25, 24.25) in ranges


def test_without_a_simulated_brain_it_is_refused():
    with pytest.raises(InputError, match="no simulated brain"):
        age_profile_chart(CHECK, CHECK, SIMILARITY)


def test_one_brain_a_week_is_said_in_the_figure() -> None:
    said = [" ".join(text.get_text().split()) for text in age_profile_chart(PROFILE, CHECK, SIMILARITY).texts]
    assert any("no single fetus" in text for text in said)
    said = [text.get_text() for text in age_profile_chart(PROFILE.assign(brains_per_week=3), CHECK, SIMILARITY).texts]
    assert not any("no single fetus" in text for text in said)


def test_similarity_of_the_last_week_to_each_week_of_the_reference(figure):
    axes = figure.axes[3]
    assert "23 GW" in axes.get_title()
    curves = [line for line in axes.lines if len(line.get_xdata()) == 4]
    assert len(curves) == 2
    for line in curves:
        assert list(line.get_xdata()) == [21, 22, 23, 24]
        np.testing.assert_allclose(line.get_ydata(), [0.5, 0.7, 0.9, 0.7])


def test_an_age_whose_range_is_cut_has_a_mark_of_its_own() -> None:
    cut = PROFILE.assign(flag=PROFILE["flag"].where(PROFILE["metric"] != "all", "range cut at the end"))
    axes = age_profile_chart(cut, CHECK, SIMILARITY).axes[0]
    assert marks(axes, RUN_COLOURS[0], open_ones=False, marker="d") == [(22, 22.25), (23, 23.25), (24, 24.25)]
