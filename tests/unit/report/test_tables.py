"""Tables of a study, and any table as HTML."""

import re

import numpy as np
import pandas as pd
import pytest
from facts import Facts

from gyriflow.quantities import METRICS
from gyriflow.report.labels import SIMPLER_PREDICTIONS
from gyriflow.report.tables import (
    accuracy_table,
    centile_text,
    html_table,
    kept_sentence,
    kept_table,
    mesh_quality,
    metrics_table,
    predicted_table,
    resources,
    runs_table,
)

COLUMNS = ["subject", "run", "week", "hemisphere", "metric", "value", "unit"]


def metrics(*rows):
    """Return metrics from (run, week, metric, value), of whole brains."""
    units = {"area": "cm2", "mean_curvature_q05": "1/mm"}
    table = [
        ("s", run, week, "whole", metric, value, units.get(metric, "1"))
        for run, week, metric, value in rows
    ]
    return pd.DataFrame(
        [*table, ("s", "thin", 22.0, "left", "area", 55.0, "cm2")], columns=COLUMNS
    )


def test_metrics_of_the_last_common_week_have_a_difference_from_the_measured_brain():
    table = metrics_table(
        metrics(
            ("thin", 22.0, "area", 110.0),
            ("thin", 23.0, "area", 150.0),
            ("observed", 22.0, "area", 100.0),
            ("observed", 21.0, "area", 90.0),
            ("thin", 22.0, "gyrification_index", 1.2),
            ("thin", 22.0, "mean_shape_index", -0.01),
            ("observed", 22.0, "mean_shape_index", 0.02),
            ("thin", 22.0, "mean_curvature_q05", -0.01),
            ("thin", 22.0, "crossing_faces", 0.0),
        ),
        observed_name="ellipsoid",
    )
    assert table.index.name == Facts("22 GW")
    assert list(table) == ["ellipsoid", "thin", Facts("thin", "%")]
    assert table.loc["pial area (cm²)"].tolist() == [100.0, 110.0, "+10.0"]
    # without a measured value, or where a share of what may be zero says nothing
    assert table.loc["gyrification index, hulls"].tolist()[1:] == [1.2, "–"]
    assert table.loc["mean shape index"].tolist()[-1] == "–"
    assert len(table) == 3

    # without measured brains those of the last week
    table = metrics_table(
        metrics(("thin", 22.0, "area", 110.0), ("thin", 23.0, "area", 120.0))
    )
    assert table.loc["pial area (cm²)"].tolist()[-2:] == [120.0, "–"]


def test_a_predicted_brain_is_between_its_start_and_the_atlas_brain_nearest_in_week():
    rows = [
        ("s", "observed", 22.4, "area", 100.0),
        ("s", "a", 29.9, "area", 210.0),
        ("s", "a", 22.4, "area", 101.0),
        ("atlas30", "observed", 30.0, "area", 200.0),
        ("atlas29", "observed", 29.0, "area", 190.0),
        ("s", "a", 29.9, "volume", 150.0),
        ("s", "a", 29.9, "crossing_faces", 0.0),
    ]
    units = {"area": "cm2", "volume": "mL"}
    table = [
        (brain, run, week, "whole", name, value, units.get(name, "1"))
        for brain, run, week, name, value in rows
    ]
    of = {
        "run": "a",
        "brain": "s",
        "start_week": 22.4,
        "week": 29.9,
        "atlas_brain": "atlas30",
        "atlas_week": 30,
    }
    of["tests"] = {
        "errors": {"area": "largest error in 4 tests of 2 start brains: ± 8 %"}
    }
    metrics = pd.DataFrame(table, columns=COLUMNS)
    centiles = metrics.assign(
        expected=np.nan, z=np.nan, centile=np.nan, centile_low=0.0, centile_high=0.0
    )
    found = predicted_table(metrics, of, centiles)
    assert list(found) == [
        Facts("22.4 GW"),
        Facts("29.9 GW"),
        Facts("30 GW"),
        Facts("%"),
        Facts("error", "averages"),
    ]
    assert found.loc["pial area (cm²)"].tolist() == [
        100.0,
        210.0,
        200.0,
        "+5.0",
        "largest error in 4 tests of 2 start brains: ± 8 %",
    ]
    # what a brain has not is a dash
    assert found.index.tolist() == ["pial area (cm²)", "volume, with ventricles (mL)"]
    assert found.loc["volume, with ventricles (mL)"].isna().tolist() == [
        True,
        False,
        True,
        False,
        True,
    ]
    # with a norm of individuals, and an ensemble
    is_scored = centiles["metric"] == "area"
    centiles.loc[is_scored, ["z", "centile", "centile_low", "centile_high"]] = [
        0.5,
        69.0,
        60.0,
        80.0,
    ]
    last = {
        "week": [22.4, 29.9],
        "metric": "area",
        "unit": "cm2",
        "low": [100.0, 190.0],
        "high": [100.0, 240.0],
    }
    found = predicted_table(metrics, of, centiles, pd.DataFrame(last)).loc[
        "pial area (cm²)"
    ]
    assert found.filter(like="centile").tolist() == [Facts(69, 60, 80, "+0.5")] * 3
    assert found.filter(like="interval of ensemble").tolist() == ["190 to 240"]


def test_the_accuracy_of_predictions_is_listed_by_horizon_with_the_range_of_starts():
    names = [
        "start",
        "horizon",
        "model",
        "distance_mm",
        "r_shape_index",
        "area_difference",
        "volume_difference",
    ]
    rows = [
        ("crl", 2.0, "run", 0.2, 0.8, -0.02, np.nan),
        ("wu", 2.0, "run", 0.3, 0.9, 0.01, np.nan),
        ("crl", 2.0, "atlas", 0.5, 0.4, 0, 0),
        ("wu", 2.0, "atlas", 0.7, 0.4, 0, 0),
    ]
    (row,) = accuracy_table(
        {"rows": [dict(zip(names, row, strict=True)) for row in rows]}
    ).to_dict("records")
    assert list(row.items()) == [
        (Facts("mm"), Facts("0.20", "0.30")),
        ("r", Facts("0.80", "0.90")),
        ("area (%)", Facts("−2.0", "+1.0")),
        ("volume (%)", "–"),
        (SIMPLER_PREDICTIONS["atlas"], Facts("0.50", "0.70 mm", "r", "0.40")),
    ]


def test_what_a_prediction_keeps_is_said_up_to_its_end():
    kept = pd.DataFrame(
        {
            "week": [24.0, 26.0, 28.0],
            "smooth_share": [0.8, 0.6, 0.5],
            "finer_share": [0.4, 0.2, 0.1],
            "difference_mm": 0.9,
        }
    )
    table = kept_table(kept, 25.0)
    assert table.index.tolist() == ["24 GW", "26 GW"]
    assert table.to_numpy().tolist() == [["80 %", "40 %"], ["60 %", "20 %"]]
    assert Facts("0.90 mm", "25 GW", "70 %", "30 %") == kept_sentence(kept, 25.0)
    assert "error of the match" not in kept_sentence(kept, 25.0)
    small = kept.assign(smooth_share=0.1)
    assert "error of the match" in kept_sentence(small, 25.0)


def test_runs_table_puts_what_differs_first():
    table = runs_table(
        {
            "reference": {
                "poisson_ratio": 0.45,
                "contact": {"gap_mm": 2.5},
                "thickness_mm": 1.5,
            },
            "thin": {
                "poisson_ratio": 0.45,
                "contact": {"gap_mm": 2.0},
                "thickness_mm": 1.5,
            },
        }
    )
    assert table.index.tolist() == [
        "contact gap (mm)",
        "cortical thickness (mm)",
        "Poisson's ratio",
    ]
    assert table.loc["contact gap (mm)", "thin"] == "2"


def test_an_absent_parameter_equals_one_that_is_off_and_curves_have_their_ends():
    growth = {
        "thickness_mm": None,
        "area_cm2": {"21.0": 89.9166, "23.0": 100.0, "25.25": 143.2723},
    }
    runs = {"reference": {"growth": {}}, "measured": {"growth": growth}}
    table = runs_table(
        {name: run | {"growth_rate_per_s": 2e-7} for name, run in runs.items()}
    )
    assert table.index.tolist() == ["growth area (cm²)", "growth rate (s⁻¹)"]
    assert table["measured"].tolist() == [
        Facts(89.92, "21.0 GW", 143.3, "25.25 GW"),
        "2·10⁻⁷",
    ]


def test_the_quality_of_a_mesh_is_listed_with_its_limits():
    quality = {
        "tets": 3072,
        "min_radius_ratio": 0.125,
        "surface_distance_mm": {"hausdorff99": 0.0625},
    }
    html = html_table(
        mesh_quality(
            [quality],
            starts=["a"],
            gates={"min_radius_ratio": 0.02, "max_surface_distance_mm": 0.1},
        )
    )
    rows = dict(
        re.findall(
            r"<tr><td[^>]*>[^<]*</td><td[^>]*>(.*?)</td><td[^>]*>(.*?)</td></tr>",
            html.replace("\n", ""),
        )
    )
    assert {"3072": "–", "0.125": "0.02", "0.0625": "0.1"}.items() <= rows.items()


def test_html_is_escaped_and_marks_numbers_and_verdicts():
    table = pd.DataFrame(
        {
            "verdict": ["fine"],
            "run <b>": ["a & b"],
            "value": [1 / 3],
            "none": [np.nan],
            "count": [7],
        }
    )
    html = html_table(table)
    assert "<th>run &lt;b&gt;</th>" in html
    assert re.findall('<td class="(.*?)">(.*?)</td>', html) == [
        ("verdict fine", "fine"),
        ("whole", "a &amp; b"),
        ("number", "0.3333"),
        ("number", "–"),
        ("number", "7"),
    ]
    assert "<th>brain</th>" in html_table(table.rename_axis("brain"))


def test_metrics_have_their_digits_and_signed_metrics_have_no_difference_in_percent():
    assert [METRICS["area"].text(value) for value in (144.94, 0.00123456, -2.5)] == [
        "144.9",
        "0.001235",
        "−2.5",
    ]
    names = ["mean_shape_index", "white_mean_shape_index", "area"]
    scores = pd.DataFrame(
        {
            "metric": names,
            "value": 0.3,
            "expected": 0.25,
            "centile": np.nan,
            "z": np.nan,
        }
    )
    assert centile_text(scores.assign(centile_low=np.nan, centile_high=np.nan)) == [
        "–",
        "–",
        "+20.0 %",
    ]


JOBS = pd.DataFrame(
    [
        ("pial_from_labels", None, 36.0, 30.0, 200.0),
        ("simulate", "thin", 3600.0, 4 * 3600.0, 2000.0),
        ("pial_from_labels", None, 36.0, np.nan, 300.0),
        ("simulate", "thick", 1800.0, 7200.0, 1000.0),
        ("lost", None, np.nan, np.nan, np.nan),
    ],
    columns=["rule", "run", "wall_s", "cpu_s", "memory_MiB"],
)


def test_core_hours_are_the_longer_of_wall_and_cpu_time_and_the_last_row_has_the_sum():
    table = resources(JOBS)
    rows = table.set_index(["stage", "run"])
    assert table["stage"].tolist() == [
        "simulate",
        "simulate",
        "pial_from_labels",
        "lost",
        "all",
    ]
    assert rows.loc[("simulate", "thin")].tolist() == pytest.approx(
        [1, 1.0, 4.0, 2000.0]
    )
    # a job occupies a core all the time, however little of it was counted
    assert rows.loc[("pial_from_labels", "")].tolist() == pytest.approx(
        [2, 0.02, 0.02, 300.0]
    )
    assert rows.loc[("all", "")].tolist() == pytest.approx([5, 1.52, 6.02, 2000.0])
    # a job without a time is counted and adds nothing
    assert rows.loc[("lost", ""), ["jobs", "core_hours"]].tolist() == [1, 0.0]
    assert np.isnan(rows.loc[("lost", ""), "memory_MiB"])
