"""Tables hold differences and escaped text."""

import re

import numpy as np
import pandas as pd

from gyriflow.report.tables import (
    html_table,
    mesh_quality_page,
    metrics_page,
    metrics_table,
    prediction_page,
    runs_table,
)


def test_metrics_table_gives_the_difference_from_the_measured_brain():
    metrics = pd.DataFrame(
        [
            ("s", "thin", 22.0, "whole", "area", 110.0, "cm2"),
            ("s", "thin", 23.0, "whole", "area", 150.0, "cm2"),
            ("s", "real", 22.0, "whole", "area", 100.0, "cm2"),
            ("s", "thin", 22.0, "left", "area", 55.0, "cm2"),
            ("s", "thin", 22.0, "whole", "gyrification_index", 1.2, "1"),
            ("s", "thin", 22.0, "whole", "mean_shape_index", -0.01, "1"),
            ("s", "real", 22.0, "whole", "mean_shape_index", 0.02, "1"),
            ("s", "thin", 22.0, "whole", "mean_curvature_q05", -0.01, "1/mm"),
            ("s", "thin", 22.0, "whole", "crossing_faces", 0.0, "1"),
        ],
        columns=["subject", "run", "week", "hemisphere", "metric", "value", "unit"],
    )
    table = metrics_table(metrics)
    assert table.loc[("pial area (cm²)", 22.0), "thin"] == 110.0
    assert table.loc[("pial area (cm²)", 22.0), "thin, difference (%)"] == "+10.0"
    assert np.isnan(table.loc[("pial area (cm²)", 23.0), "real brain"])
    assert table.loc[("gyrification index, hulls", 22.0), "thin"] == 1.2
    # a share of what may be zero says nothing
    assert table.loc[("mean shape index", 22.0), "thin, difference (%)"] == "–"
    assert not table.index.get_level_values("metric").str.contains("curvature").any()
    assert not table.index.get_level_values("metric").str.contains("crossing").any()
    assert "sphere" in metrics_table(metrics, measured="sphere")


def test_metrics_table_without_measured_brains_has_no_differences():
    metrics = pd.DataFrame(
        [("s", "thin", 22.0, "whole", "area", 110.0, "cm2")],
        columns=["subject", "run", "week", "hemisphere", "metric", "value", "unit"],
    )
    assert (metrics_table(metrics)["thin, difference (%)"] == "–").all()


def test_the_page_has_the_last_week_that_runs_and_real_brains_share():
    rows = [("s", run, week, "whole", "area", 100.0 + week, "cm2") for run, week in
            (("thin", 22.0), ("real", 22.0), ("thin", 23.0), ("thin", 24.0), ("real", 23.0))]  # fmt: skip
    columns = ["subject", "run", "week", "hemisphere", "metric", "value", "unit"]
    page = metrics_page(pd.DataFrame(rows, columns=columns), measured="real brain")
    assert "at 23 GW" in page
    assert re.findall("<td.*?>(.*?)</td>", page) == ["pial area (cm²)", "123", "123", "0.0"]


def test_runs_table_puts_what_differs_first():
    table = runs_table(
        {
            "reference": {"poisson_ratio": 0.45, "contact": {"gap_mm": 2.5}, "thickness_mm": 1.5},
            "thin": {"poisson_ratio": 0.45, "contact": {"gap_mm": 2.0}, "thickness_mm": 1.5},
        }
    )
    assert table.index.tolist() == ["contact gap (mm)", "cortical thickness (mm)", "Poisson's ratio"]
    assert table.loc["contact gap (mm)", "thin"] == "2"


def test_parameters_that_one_run_lacks_and_another_leaves_off_are_no_difference_and_powers_are_raised():
    growth = {"growth": {"thickness_mm": None, "smoothing_mm": 1.5}, "growth_rate_per_s": 2e-7}
    table = runs_table({"reference": {"growth": {}, "growth_rate_per_s": 2e-7}, "measured": growth})
    assert table.index.tolist() == ["growth smoothing (mm)", "growth rate (s⁻¹)"]
    assert table.loc["growth rate (s⁻¹)", "measured"] == "2·10⁻⁷"


def test_a_curve_is_told_by_its_ends():
    curve = {"growth": {"area_cm2": {"21.0": 89.9166, "23.0": 100.0, "25.25": 143.2723}}}
    table = runs_table({"reference": {"growth": {}}, "measured": curve})
    assert table.loc["growth area (cm²)", "measured"] == "89.92 at 21.0 GW to 143.3 at 25.25 GW"


def test_html_is_escaped_named_and_the_same_each_time():
    table = pd.DataFrame({"run <b>": ["a & b"], "value": [1 / 3]})
    html = html_table(table, caption="x < y", synthetic=True)
    assert "a &amp; b" in html
    assert "run &lt;b&gt;" in html
    assert "x &lt; y (a simple shape, not a real brain)" in html
    assert "0.3333<" in html
    assert html == html_table(table, caption="x < y", synthetic=True)


def test_simpler_ways_of_several_runs_are_one_row():
    columns = ("r_shape_index", "distance_mm", "distance95_mm", "area_error", "volume_error")
    numbers = dict.fromkeys((*columns, "crossing_faces", "roughness_ratio", "skill"), 0.1234)
    rows = [
        {"run": run, "start": "a", "week": 24.0, "model": model} | numbers
        for run in ("expected", "stiff")
        for model in ("run", "atlas")
    ]
    cells = re.findall("<td.*?>(.*?)</td>", prediction_page(pd.DataFrame(rows)))
    assert cells[2::11] == ["expected", "the atlas&#39; brain, scaled", "stiff"]
    assert cells[3:11] == ["0.123"] * 8


def test_the_quality_of_a_mesh_stands_beside_its_limits():
    quality = {"tets": 8, "min_radius_ratio": 0.2, "surface_distance_mm": {"hausdorff99": 0.05}, "gap_kept": None}
    page = mesh_quality_page({"young": quality}, {"min_radius_ratio": 0.1, "max_surface_distance_mm": 0.3})
    rows = [re.findall("<td.*?>(.*?)</td>", row) for row in page.split("<tr>")]
    assert ["least radius ratio", "0.2", "0.1"] in rows
    assert ["99 % of the surface within (mm)", "0.05", "0.3"] in rows
    assert ["share of narrow gaps that is open", "–", "–"] in rows
