"""Tables hold the published values, differences and escaped text."""

import numpy as np
import pandas as pd
import pytest

from gyriflow.report.displacement import displacement_chart, displacement_summary, displacement_table
from gyriflow.report.tables import agreement_table, growth_table, html_table, metrics_table, runs_table, sizes_table

NORMS = pd.DataFrame(
    {
        "run": "thin",
        "from_week": [21.0, 21.0, 25.0],
        "to_week": [22.0, 22.0, 26.0],
        "nodes": ["all", "pial", "all"],
        "max_mm": [3.31, 3.31, 2.5],
        "mean_mm": [0.57, 0.8, 0.5],
    }
)


def test_displacement_stands_beside_the_papers_values():
    table = displacement_table(NORMS).set_index(["source", "from_week", "nodes"])
    assert table.loc[("thin", 21.0, "pial"), "mean_mm"] == 0.8
    paper = table.xs("FetalFoldSim")
    assert paper["max_mm"].tolist() == [2.51, 2.22, 2.37, 2.57]
    assert paper["mean_mm"].tolist() == [0.42, 0.40, 0.38, 0.40]
    measured = table.xs("Wang et al. 2021")
    assert measured["max_mm"].tolist() == [1.24, 2.29, 3.65, 5.79]
    assert measured["mean_mm"].tolist() == [0.45, 0.88, 1.91, 3.03]


def test_displacement_summary_has_a_column_per_interval_and_dashes_where_nothing_is_known():
    summary = displacement_summary(NORMS)
    assert list(summary.columns) == ["21–22 GW", "22–23 GW", "23–24 GW", "24–25 GW", "25–26 GW"]
    assert summary.loc[("thin", "all"), "21–22 GW"] == "3.31 / 0.57"
    assert summary.loc[("thin", "all"), "22–23 GW"] == "–"
    assert summary.loc[("FetalFoldSim", "all"), "24–25 GW"] == "2.57 / 0.40"


def test_displacement_chart_draws_the_chosen_nodes_at_the_middle_of_the_interval():
    figure = displacement_chart(NORMS, nodes="all")
    lines = {line.get_label(): line.get_xydata().tolist() for line in figure.axes[1].lines}
    assert lines["thin"] == [[21.5, 0.57], [25.5, 0.5]]
    assert lines["FetalFoldSim"][0] == [21.5, 0.42]


def test_growth_table_is_in_units_of_1e_7():
    rates = pd.DataFrame(
        {
            "series": "volume",
            "from_week": [21.0],
            "to_week": [22.0],
            "area_ratio": [1.1],
            "rate_per_s": [1.234e-7],
            "volume_ratio": [1.2],
            "core_rate_per_s": [0.5e-7],
        }
    )
    assert growth_table(rates)["tangential rate (10⁻⁷ s⁻¹)"].tolist() == [1.234]
    assert "series" not in growth_table(rates)
    both = growth_table(pd.concat([rates, rates.assign(series="surface")]))
    assert both["series"].tolist() == ["volume", "surface"]


def test_agreement_table_has_each_interval_the_mean_and_the_mean_size():
    agreement = pd.DataFrame(
        {
            "series": "volume",
            "reference": "surface",
            "from_week": [21.0, 22.0],
            "to_week": [22.0, 23.5],
            "difference_per_s": [0.3e-7, -0.1e-7],
            "core_difference_per_s": [0.2e-7, 0.4e-7],
        }
    )
    table = agreement_table(agreement)
    assert set(table["compared"]) == {"volume − surface"}
    assert table["interval (GW)"].tolist() == ["21–22", "22–23.5", "mean", "mean size"]
    assert table["tangential rate, difference (10⁻⁷ s⁻¹)"].tolist() == pytest.approx([0.3, -0.1, 0.1, 0.2])
    assert table["core rate, difference (10⁻⁷ s⁻¹)"].tolist() == pytest.approx([0.2, 0.4, 0.3, 0.3])


def test_sizes_table_compares_series_week_by_week():
    areas = pd.DataFrame(
        [("surface", 21.0, 100.0, 50.0), ("surface", 22.0, 120.0, 60.0), ("volume", 22.0, 126.0, 57.0)],
        columns=["series", "week", "area_cm2", "volume_ml"],
    )
    table = sizes_table(areas)
    assert table["pial area (cm²): surface"].tolist() == [100.0, 120.0]
    assert table.loc[22.0, "pial area: volume − surface (%)"] == pytest.approx(5.0)
    assert table.loc[22.0, "volume: volume − surface (%)"] == pytest.approx(-5.0)
    assert np.isnan(table.loc[21.0, "pial area: volume − surface (%)"])


def test_metrics_table_gives_the_difference_from_the_measured_brain():
    metrics = pd.DataFrame(
        [
            ("thin", 22.0, "whole", "area", 110.0, "cm2"),
            ("thin", 23.0, "whole", "area", 150.0, "cm2"),
            ("real", 22.0, "whole", "area", 100.0, "cm2"),
            ("thin", 22.0, "left", "area", 55.0, "cm2"),
            ("thin", 22.0, "whole", "gyrification_index", 1.2, "1"),
        ],
        columns=["run", "week", "hemisphere", "metric", "value", "unit"],
    )
    table = metrics_table(metrics)
    assert table.loc[("area (cm²)", 22.0), "thin"] == 110.0
    assert table.loc[("area (cm²)", 22.0), "thin: difference (%)"] == pytest.approx(10.0)
    assert np.isnan(table.loc[("area (cm²)", 23.0), "real brain"])
    assert table.loc[("gyrification index", 22.0), "thin"] == 1.2
    assert "phantom" in metrics_table(metrics, measured="phantom")


def test_metrics_table_without_measured_brains_has_no_differences():
    metrics = pd.DataFrame(
        [("thin", 22.0, "whole", "area", 110.0, "cm2")],
        columns=["run", "week", "hemisphere", "metric", "value", "unit"],
    )
    assert metrics_table(metrics)["thin: difference (%)"].isna().all()


def test_runs_table_puts_what_differs_first():
    table = runs_table(
        {
            "reference": {"poisson_ratio": 0.45, "contact": {"gap_mm": 2.5}, "thickness_mm": 1.5},
            "thin": {"poisson_ratio": 0.45, "contact": {"gap_mm": 2.0}, "thickness_mm": 1.5},
        }
    )
    assert table.index.tolist() == ["contact.gap_mm", "poisson_ratio", "thickness_mm"]
    assert table["differs"].tolist() == ["yes", "", ""]
    assert table.loc["contact.gap_mm", "thin"] == "2"


def test_html_is_escaped_named_and_the_same_each_time():
    table = pd.DataFrame({"run <b>": ["a & b"], "value": [1 / 3]})
    html = html_table(table, caption="x < y", synthetic=True)
    assert "a &amp; b" in html
    assert "run &lt;b&gt;" in html
    assert "x &lt; y (synthetic phantom, not a real brain)" in html
    assert "0.3333<" in html
    assert html == html_table(table, caption="x < y", synthetic=True)
