"""Charts of the validation: what is drawn is what the table says."""

import math

import numpy as np
import pandas as pd
import pytest

from gyriflow.report.validation import smoothing_chart, validation_chart


def table(runs, weeks=(22, 23, 24)):
    rows = []
    for number, run in enumerate(runs):
        for week in weeks:
            row = {"run": run, "start_week": 21, "week": week, "kind": "predicted" if week > 23 else "explained"}
            for measure in ("shape_index", "mean_curvature"):
                gain = 0.01 * (number + week - 21)
                row |= {f"r_start_{measure}": 0.5, f"r_adjacent_{measure}": 0.7, f"gain_{measure}": gain}
                row |= {f"gain_low_{measure}": gain - 0.02, f"gain_high_{measure}": gain + 0.02}
                row[f"skill_{measure}"] = gain / 0.2 if week > 22 else math.nan
            rows.append(row)
    return pd.DataFrame(rows)


def points(axes, marker):
    return sum(len(line.get_xdata()) for line in axes.lines if line.get_marker() == marker)


def test_gains_are_drawn_with_their_kind_and_the_real_week_before():
    axes = validation_chart(table(["reference", "measured"]), table(["registration"])).axes[0]
    faces = [line.get_markerfacecolor() for line in axes.lines if line.get_marker() == "o"]
    assert faces.count("white") == 2
    assert points(axes, "o") == 6
    (stars,) = (line for line in axes.lines if line.get_marker() == "*")
    np.testing.assert_allclose(stars.get_ydata(), 0.2)
    assert any(line.get_linestyle() == ":" for line in axes.lines)


def test_what_registration_gives_is_seen_with_a_single_week_too():
    axes = validation_chart(table(["measured"], [23]), table(["registration"], [23])).axes[0]
    ends = [segment[:, 0] for lines in axes.collections for segment in lines.get_segments() if np.ptp(segment[:, 0])]
    np.testing.assert_allclose(ends, [[22.75, 23.25]])


def test_gain_stands_over_its_smoothing_length_and_uniform_growth_beyond():
    lengths = {"a": 3.0, "b": 6.0, "c": math.inf}
    axes = smoothing_chart(table([*lengths]), lengths, table(["registration"])).axes[0]
    assert [label.get_text() for label in axes.get_xticklabels()] == ["3", "6", "uniform"]
    line = next(line for line in axes.lines if line.get_marker() == "o")
    np.testing.assert_allclose(line.get_ydata(), [0.01, 0.02, 0.03])
    assert line.get_xdata()[-1] == pytest.approx(1.6 * 6)
