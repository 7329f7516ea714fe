"""What is drawn of scores is what their tables say."""

import math

import numpy as np
import pandas as pd
import pytest

from gyriflow.errors import InputError
from gyriflow.parameters.terms import SIDES
from gyriflow.report.scores import (
    calibration_chart,
    influence_spectra,
    nearest_chart,
    onset_chart,
    prediction_chart,
    validation_chart,
)

NOTHING_PUBLISHED = pd.DataFrame({"measure": [], "paper": []})
OF_THE_STUDY = {"varied": "thickness_mm", "subject": "s", "real": ["r"]}
NAMES = ["thickness_mm", "growth_rate_per_s"]
RUNS = pd.DataFrame(
    {
        "thickness_mm": [1.0, 2.0, 3.0, 2.2],
        "growth_rate_per_s": [1e-7, 2e-7, 3e-7, 2.2e-7],
        "round": [0, 0, 0, 1],
        "score": [0.5, 0.2, np.nan, 0.1],
    }
)
OPTIMUM = pd.DataFrame({"parameter": NAMES, "value": [2.1, 2.1e-7]})


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


def points(axes, marker):
    return sum(len(line.get_xdata()) for line in axes.lines if line.get_marker() == marker)


def test_gains_are_drawn_with_their_kind_and_the_real_week_before():
    axes = validation_chart(gains(["reference", "measured"]), gains(["registration"])).axes[0]
    faces = [line.get_markerfacecolor() for line in axes.lines if line.get_marker() == "o"]
    assert faces.count("white") == 2
    assert points(axes, "o") == 6
    (stars,) = (line for line in axes.lines if line.get_marker() == "*")
    np.testing.assert_allclose(stars.get_ydata(), 0.2)
    assert any(line.get_linestyle() == ":" for line in axes.lines)


def test_what_registration_gives_is_seen_with_a_single_week_too():
    axes = validation_chart(gains(["measured"], [23]), gains(["registration"], [23])).axes[0]
    ends = [segment[:, 0] for lines in axes.collections for segment in lines.get_segments() if np.ptp(segment[:, 0])]
    np.testing.assert_allclose(ends, [[22.75, 23.25]])


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
    """Returns onsets by run of the sulci left central, left 2 and one that is there at the start."""
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


def test_starts_are_told_apart_and_nothing_is_drawn_of_nothing():
    both = pd.concat([onsets(real=(26.0, 28.0, np.nan)), onsets(real=(27.0, 28.5, np.nan)).assign(subject="b")])
    names = [label.get_text() for label in onset_chart(both).axes[0].get_yticklabels()]
    assert set(names) == {f"{sulcus} · {start}" for sulcus in ("left central", "left 2") for start in "ab"}
    nothing = onsets(real=(26.0, 28.0, np.nan)).assign(there_at_start=True)
    assert "No sulcus begins" in (empty := onset_chart(nothing)).texts[0].get_text()
    assert not empty.axes


def spectrum(run: str, power: float) -> pd.DataFrame:
    shares = {"band": [4, 5, 6], "relative_power": [power, power / 2, power / 4]}
    sides = [pd.DataFrame({"subject": "s", "run": run, "week": 28.0, **shares, "hemisphere": side}) for side in SIDES]
    return pd.concat(sides).assign(complete=True, denominator_complete=True, resolved=True)


def distances(values: dict[float, float], flag: str = "ok", **labels: str) -> pd.DataFrame:
    table = pd.DataFrame({"thickness_mm": list(values), "distance": list(values.values())})
    table = table.assign(subject="s", real="r", unit="mm", flag=flag, resolution="ok")
    return table.assign(**({"hemisphere": "whole", "measure": "hausdorff95"} | labels))


def test_spectra_of_a_study_stand_in_its_order_from_pale_to_dark():
    values = {run: {"thickness_mm": value} for run, value in (("a", 0.8), ("b", 1.5), ("c", 6.0))}
    members = {"c": spectrum("c", 0.3), "a": spectrum("a", 0.1), "b": spectrum("b", 0.2)}
    figure = influence_spectra(members, [spectrum("real", 0.15)], values=values, week=28.0)
    left = figure.axes[0]
    assert [bar.get_height() for bar in left.patches[::3]] == pytest.approx([0.1, 0.2, 0.3])
    brightness = [sum(bar.get_facecolor()[:3]) for bar in left.patches[::3]]
    assert brightness == sorted(brightness, reverse=True)
    assert [text.get_text() for text in figure.legends[0].get_texts()][:3] == ["0.8 mm", "1.5 mm", "6 mm"]


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


def test_hemispheres_are_drawn_apart_and_the_published_value_is_a_line():
    of_side = {"left": 1.0, "right": 3.0}
    table = pd.concat([distances({1.0: 2.0, 2.0: v}, hemisphere=s, measure="B4") for s, v in of_side.items()])
    figure = nearest_chart(table, pd.DataFrame({"measure": ["B4", "B4"], "paper": [2.25, 2.25]}), **OF_THE_STUDY)
    (axes,) = figure.axes
    assert sorted(text.get_text() for text in axes.texts) == ["1", "2"]
    assert [line.get_xdata()[0] for line in axes.lines if line.get_linestyle() == "--"] == [2.25]


def test_a_study_without_distances_is_refused():
    with pytest.raises(InputError, match="no distance"):
        nearest_chart(distances({1.0: np.nan}), NOTHING_PUBLISHED, **OF_THE_STUDY)
