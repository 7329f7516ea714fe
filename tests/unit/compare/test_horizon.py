"""Gain and skill by start week and horizon."""

import numpy as np
import pandas as pd
import pytest

from gyriflow.compare.validation import horizon_table
from gyriflow.report.scores import horizon_chart

MODELS = {"known": "known", "late": "known", "other": "other"}
UNTIL = {"known": None, "late": 26.0, "other": None}


def rows(run: str, start: float, gains: dict[float, float], kind: str, seed: int = 0) -> list[dict]:
    found = []
    for week, gain in gains.items():
        row = {"run": run, "kind": kind, "start_week": start, "week": week, "horizon": week - start, "seed": seed}
        for measure in ("shape_index", "mean_curvature"):
            row |= {f"gain_{measure}": gain, f"gain_low_{measure}": gain - 0.1, f"gain_high_{measure}": gain + 0.1}
            row[f"skill_{measure}"] = 2 * gain if week - start > 1 else np.nan
        found.append(row)
    return found


VALIDATION = pd.DataFrame(
    [
        *rows("known", 25.0, {26.0: 0.1, 27.0: 0.2}, "explained"),
        *rows("known", 26.0, {27.0: 0.3}, "explained"),
        *rows("known", 26.0, {27.0: 0.5}, "explained", seed=1),
        *rows("late", 26.0, {27.0: -0.1, 28.0: -0.2}, "predicted"),
        *rows("other", 25.0, {26.0: 0.0}, "predicted"),
    ]
)
MOVES = pd.DataFrame(
    [
        {"run": "known", "start_week": 25.0, "seed": 0, "from_week": 26.0, "to_week": 27.0, "displacement_r": 0.9}
        | {"displacement_slope": 0.8, "displacement_r_scaling": 0.7}
    ]
)


@pytest.fixture(scope="module")
def table() -> pd.DataFrame:
    return horizon_table(VALIDATION, MOVES, MODELS, UNTIL)


def test_each_start_and_horizon_has_a_row_and_kinds_are_apart(table):
    keys = ["model", "kind", "start_week", "horizon"]
    assert table[keys].to_numpy().tolist() == [
        ["known", "explained", 25.0, 1.0],
        ["known", "explained", 25.0, 2.0],
        ["known", "explained", 26.0, 1.0],
        ["known", "predicted", 26.0, 1.0],
        ["known", "predicted", 26.0, 2.0],
        ["other", "predicted", 25.0, 1.0],
    ]
    assert table["week"].tolist() == [26, 27, 27, 27, 28, 26]
    # seeds are averaged, starts and kinds are not
    assert table["gain_shape_index"].tolist() == pytest.approx([0.1, 0.2, 0.4, -0.1, -0.2, 0.0])
    assert table["runs"].tolist() == [1, 1, 2, 1, 1, 1]
    # growth of the late run is known up to its start
    assert table["known_gw"].tolist() == pytest.approx([np.nan, np.nan, np.nan, 0, 0, np.nan], nan_ok=True)
    assert table["skill_mean_curvature"].tolist() == pytest.approx(
        [np.nan, 0.4, np.nan, np.nan, -0.4, np.nan], nan_ok=True
    )
    assert table["displacement_r"].tolist() == pytest.approx([np.nan, 0.9, *[np.nan] * 4], nan_ok=True)
    assert horizon_table(VALIDATION, pd.DataFrame(), MODELS, UNTIL)["displacement_r"].isna().all()


def test_the_chart_has_a_line_for_each_start_and_panels_for_each_kind(table):
    axes = horizon_chart(table, runs=["known", "late", "other"]).axes
    assert len(axes) == 4
    texts = [[note.get_text() for note in panel.texts if note.get_text().isdigit()] for panel in axes]
    assert texts == [["25", "26"], ["25", "26"], ["26", "25"], ["26", "25"]]
    lines = [line for line in axes[2].lines if line.get_marker() == "o"]
    assert {line.get_markerfacecolor() for line in lines} == {"white"}
    assert [float(value) for value in lines[0].get_ydata()] == pytest.approx([-0.1, -0.2])
    assert len(horizon_chart(table[table["kind"] == "explained"]).axes) == 2
