"""What is drawn of scores is what their tables say."""

import math

import numpy as np
import pandas as pd
import pytest

from gyriflow.report.scores import calibration_chart, nearest_chart, onset_chart, prediction_chart, validation_chart

NOTHING_PUBLISHED = pd.DataFrame({"measure": [], "paper": []})
OF_THE_STUDY = {"varied": "thickness_mm", "subject": "s", "real": ["r"]}
TRIED = {"thickness_mm": [1.0, 2.0, 3.0, 2.2], "growth_rate_per_s": [1e-7, 2e-7, 3e-7, 2.2e-7]}
RUNS = pd.DataFrame(TRIED | {"round": [0, 0, 0, 1], "score": [0.5, 0.2, np.nan, 0.1]})
OPTIMUM = pd.DataFrame({"parameter": ["thickness_mm", "growth_rate_per_s"], "value": [2.1, 2.1e-7]})


def test_each_parameter_of_a_calibration_has_a_panel():
    figure = calibration_chart(RUNS, OPTIMUM, score=["size"])
    assert [axes.get_xlabel() for axes in figure.axes] == ["cortical thickness (mm)", "growth rate (s⁻¹)"]
    lines = {line.get_label(): line for line in figure.axes[0].get_lines()}
    np.testing.assert_array_equal(lines["round 0"].get_xdata(), [1.0, 2.0])
    np.testing.assert_array_equal(lines["round 1"].get_ydata(), [0.1])
    # a diverged run has no score: it stands at the worst of the others
    np.testing.assert_array_equal(lines["diverged"].get_xydata(), [[3.0, 0.5]])
    assert list(lines["optimum"].get_xdata()) == [2.1, 2.1]
    assert list(figure.axes[1].get_lines()[0].get_xdata()) == [2.1e-7, 2.1e-7]


def gains(runs, weeks=(22, 23, 24)):
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


def test_gains_are_drawn_with_their_kind_and_the_real_week_before():
    axes = validation_chart(gains(["reference", "measured"]), gains(["registration"])).axes[0]
    dots = [line for line in axes.lines if line.get_marker() == "o"]
    assert [line.get_markerfacecolor() for line in dots].count("white") == 2
    assert sum(len(line.get_xdata()) for line in dots) == 6
    (stars,) = (line for line in axes.lines if line.get_marker() == "*")
    np.testing.assert_allclose(stars.get_ydata(), 0.2)
    assert any(line.get_linestyle() == ":" for line in axes.lines)


def test_runs_and_simpler_ways_are_lines_in_the_panels_of_their_start():
    rows = [
        {"run": run, "start": start, "horizon": horizon, "model": model, "distance_mm": 0.1 * horizon}
        | {"r_shape_index": level - 0.1 * horizon + (0.02 if run == "stiff" and model == "run" else 0)}
        for start, level in (("a", 0.9), ("b", 0.8))
        for run in ("expected", "stiff")
        for model in ("run", "scaled", "new")
        for horizon in (1.0, 2.0)
    ]
    figure = prediction_chart(pd.DataFrame(rows), runs=["expected", "stiff"])
    first, away, second, _ = figure.axes
    assert [len(axes.lines) for axes in figure.axes] == [4] * 4
    full = [line.get_ydata() for line in second.lines if line.get_linestyle() == "-"]
    np.testing.assert_allclose(full, [[0.7, 0.6], [0.72, 0.62]])
    assert [line.get_linestyle() for line in first.lines].count("--") == 2
    assert all(list(line.get_ydata()) == pytest.approx([0.1, 0.2]) for line in away.lines)
    assert len({line.get_color() for line in first.lines}) == 4
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels == ["expected", "stiff", "start, scaled: no folding", "new"]


def onsets(**weeks):
    """Return onsets by run of the sulci left central, left 2 and one that is there at the start."""
    rows = [
        {"run": run, "subject": "a", "region": name, "there_at_start": name == "left calcarine", "onset_week": week}
        for run, found in weeks.items()
        for name, week in zip(("left central", "left 2", "left calcarine"), found, strict=True)
    ]
    return pd.DataFrame(rows)


def test_each_sulcus_has_a_row_with_its_weeks():
    axes = onset_chart(onsets(real=(26.0, 28.0, np.nan), measured=(26.5, np.nan, np.nan)), runs=["measured"]).axes[0]
    # the earliest on top
    assert [label.get_text() for label in axes.get_yticklabels()] == ["left 2", "left central"]
    lines = {(line.get_marker(), line.get_color()): line for line in axes.lines if len(line.get_xdata())}
    (stars,) = (line for (marker, _), line in lines.items() if marker == "*")
    assert sorted(stars.get_xdata()) == [26.0, 28.0]
    (dots,) = (line for (marker, _), line in lines.items() if marker == "o")
    assert dots.get_xdata().tolist() == [26.5]
    assert np.abs(dots.get_ydata() - 1).max() < 0.5
    (never,) = (line for (marker, _), line in lines.items() if marker == "x")
    assert never.get_xdata().tolist() == [29.0]


def distances(values: dict[float, float], flag: str = "ok", **labels: str) -> pd.DataFrame:
    table = pd.DataFrame({"thickness_mm": list(values), "distance": list(values.values())})
    table = table.assign(subject="s", real="r", unit="mm", flag=flag, resolution="ok")
    return table.assign(**({"hemisphere": "whole", "measure": "hausdorff95"} | labels))


def test_the_nearest_member_is_named_and_one_that_is_not_trusted_is_not_it():
    good = distances({0.8: 3.0, 1.5: 2.0, 2.25: 1.0})
    bad = distances({6.0: 0.1}, flag="not resolved by the mesh")
    figure = nearest_chart(pd.concat([good, bad]), NOTHING_PUBLISHED, **OF_THE_STUDY)
    (axes,) = figure.axes
    assert [text.get_text() for text in axes.texts] == ["2.25"]
    assert axes.get_xlabel() == "cortical thickness (mm)"
    assert "hausdorff95 (mm)" in axes.get_title()
    marks = [line for line in axes.lines if line.get_marker() == "o" and line.get_markersize() == 4.5]
    shown = {line.get_markerfacecolor() == "white": line.get_xdata().tolist() for line in marks}
    assert shown == {False: [0.8, 1.5, 2.25], True: [6.0]}
