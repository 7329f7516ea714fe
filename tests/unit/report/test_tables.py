"""Tables of a study, and any table as HTML."""

import re

import numpy as np
import pandas as pd
import pytest

from gyriflow.report.tables import html_table, metrics_table, resources, runs_table

COLUMNS = ["subject", "run", "week", "hemisphere", "metric", "value", "unit"]


def metrics(*rows):
    """Return metrics from (run, week, metric, value), of whole brains."""
    units = {"area": "cm2", "mean_curvature_q05": "1/mm"}
    table = [("s", run, week, "whole", metric, value, units.get(metric, "1")) for run, week, metric, value in rows]
    return pd.DataFrame([*table, ("s", "thin", 22.0, "left", "area", 55.0, "cm2")], columns=COLUMNS)


def test_metrics_of_the_last_common_week_stand_with_the_difference_from_the_measured_brain():
    table = metrics_table(
        metrics(
            ("thin", 22.0, "area", 110.0),
            ("thin", 23.0, "area", 150.0),
            ("real", 22.0, "area", 100.0),
            ("real", 21.0, "area", 90.0),
            ("thin", 22.0, "gyrification_index", 1.2),
            ("thin", 22.0, "mean_shape_index", -0.01),
            ("real", 22.0, "mean_shape_index", 0.02),
            ("thin", 22.0, "mean_curvature_q05", -0.01),
            ("thin", 22.0, "crossing_faces", 0.0),
        ),
        measured="ellipsoid",
    )
    assert table.index.name == "metric at 22 GW"
    assert list(table) == ["ellipsoid", "thin", "thin, difference (%)"]
    assert table.loc["pial area (cm²)"].tolist() == [100.0, 110.0, "+10.0"]
    # without a measured value, or where a share of what may be zero says nothing
    assert table.loc["gyrification index, hulls", ["thin", "thin, difference (%)"]].tolist() == [1.2, "–"]
    assert table.loc["mean shape index", "thin, difference (%)"] == "–"
    assert len(table) == 3

    # without measured brains those of the last week
    table = metrics_table(metrics(("thin", 22.0, "area", 110.0), ("thin", 23.0, "area", 120.0)))
    assert table.loc["pial area (cm²)", ["thin", "thin, difference (%)"]].tolist() == [120.0, "–"]


def test_runs_table_puts_what_differs_first():
    table = runs_table(
        {
            "reference": {"poisson_ratio": 0.45, "contact": {"gap_mm": 2.5}, "thickness_mm": 1.5},
            "thin": {"poisson_ratio": 0.45, "contact": {"gap_mm": 2.0}, "thickness_mm": 1.5},
        }
    )
    assert table.index.tolist() == ["contact gap (mm)", "cortical thickness (mm)", "Poisson's ratio"]
    assert table.loc["contact gap (mm)", "thin"] == "2"


def test_parameters_that_one_run_lacks_and_another_leaves_off_are_no_difference_and_curves_have_their_ends():
    growth = {"thickness_mm": None, "area_cm2": {"21.0": 89.9166, "23.0": 100.0, "25.25": 143.2723}}
    runs = {"reference": {"growth": {}}, "measured": {"growth": growth}}
    table = runs_table({name: run | {"growth_rate_per_s": 2e-7} for name, run in runs.items()})
    assert table.index.tolist() == ["growth area (cm²)", "growth rate (s⁻¹)"]
    assert table["measured"].tolist() == ["89.92 at 21.0 GW to 143.3 at 25.25 GW", "2·10⁻⁷"]


def test_html_is_escaped_and_marks_numbers_and_verdicts():
    table = pd.DataFrame({"verdict": ["look"], "run <b>": ["a & b"], "value": [1 / 3], "none": [np.nan], "count": [7]})
    html = html_table(table)
    assert "<th>run &lt;b&gt;</th>" in html
    assert re.findall('<td class="(.*?)">(.*?)</td>', html) == [
        ("verdict look", "look"), ("whole", "a &amp; b"), ("number", "0.3333"), ("number", "–"), ("number", "7")
    ]  # fmt: skip
    assert "<th>brain</th>" in html_table(table.rename_axis("brain"))


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


def test_energy_is_that_of_the_busy_cores_and_the_last_row_has_the_sum():
    table = resources(JOBS)
    rows = table.set_index(["stage", "run"])
    assert table["stage"].tolist() == ["simulate", "simulate", "pial_from_labels", "lost", "all"]
    assert rows.loc[("simulate", "thin")].tolist() == pytest.approx([1, 1.0, 4.0, 2000.0, 48.0, 22.8])
    # a job keeps a core busy all the time, however little of it was sampled
    assert rows.loc[("pial_from_labels", "")].tolist() == pytest.approx([2, 0.02, 0.02, 300.0, 0.24, 0.114])
    assert rows.loc[("all", "")].tolist() == pytest.approx([5, 1.52, 6.02, 2000.0, 72.24, 34.314])
    # a job without a time is counted and adds nothing
    assert rows.loc[("lost", ""), ["jobs", "energy_Wh"]].tolist() == [1, 0.0]
    assert np.isnan(rows.loc[("lost", ""), "memory_MiB"])
