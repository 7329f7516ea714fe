"""Tables of a study: of its group, of sides, of change between scans, and of displacement by week."""

import numpy as np
import pandas as pd
import pytest

from gyriflow.metrics.tables import asymmetry, change_between_scans, long_table, weekly_norms, wide_table

COLUMNS = ["subject", "run", "week", "hemisphere", "metric", "value", "unit"]
METRICS = pd.DataFrame(
    [
        ("early", "real", 22.0, "whole", "area", 100.0, "cm2"),
        ("late", "real", 24.0, "whole", "area", 150.0, "cm2"),
        ("early", "follows", 22.0, "whole", "area", 98.0, "cm2"),
        ("early", "follows", 23.0, "whole", "area", 120.0, "cm2"),
        ("early", "follows", 24.0, "whole", "area", 140.0, "cm2"),
        ("other", "real", 24.0, "whole", "area", 160.0, "cm2"),
        ("other", "real", 24.0, "left", "mean_curvedness", 0.1, "1/mm"),
    ],
    columns=COLUMNS,
)
REGIONS = pd.DataFrame(
    [
        ("early", "real", 22.0, "left", "frontal", "area", 20.0, "cm2"),
        ("late", "real", 24.0, "left", "frontal", "area", 26.0, "cm2"),
    ],
    columns=[*COLUMNS[:4], "region", *COLUMNS[4:]],
)
SCANS = {"one": ["early", "late"]}


def test_change_of_scans_and_of_the_simulation_from_the_first() -> None:
    table = change_between_scans(long_table([METRICS, REGIONS]), SCANS).set_index(["run", "region"])
    scans = table.loc[("real", "")]
    assert (scans["from_value"], scans["to_value"], scans["change"]) == (100.0, 150.0, 50.0)
    assert scans["change_per_week"] == pytest.approx(25.0)
    assert scans["relative_change"] == pytest.approx(0.5)
    assert scans["difference"] == 0.0
    run = table.loc[("follows", "")]
    # from the run's own start, beside what was measured
    assert (run["change"], run["measured_change"], run["difference"]) == (42.0, 50.0, -10.0)
    assert table.loc[("real", "frontal"), "change"] == 6.0
    assert ("follows", "frontal") not in table.index
    assert set(table["subject"]) == {"one"}


def test_wide_has_a_row_per_brain_and_week() -> None:
    table = wide_table(long_table([METRICS, REGIONS]), {})
    assert len(table) == 6
    row = table.set_index(["subject", "run", "week"]).loc[("other", "real", 24.0)]
    assert row["whole_area_cm2"] == 160.0
    assert row["left_mean_curvedness_1_per_mm"] == 0.1
    assert np.isnan(row["left_frontal_area_cm2"])
    known = wide_table(long_table([METRICS, REGIONS]), {"other": {"sex": "F", "run": "3"}}).set_index("subject")
    assert list(known.columns[:3]) == ["run", "week", "sex"]
    assert known.loc["other", "sex"] == "F"
    assert known["run"].isin(table["run"]).all()


def test_asymmetry_of_sides() -> None:
    table = pd.DataFrame({"hemisphere": ["left", "right"] * 2, "region": ["frontal"] * 2 + ["insula"] * 2})
    table = table.assign(metric="area", value=[30.0, 10.0, 0.0, 0.0])
    found = asymmetry(table).set_index("region")["asymmetry_index"]
    assert found["frontal"] == pytest.approx(1.0)
    assert np.isnan(found["insula"])


def test_norms_per_week_of_all_and_pial_nodes() -> None:
    start = np.zeros((4, 3))
    first = np.array([[3.0, 4, 0], [0, 0, 1], [0, 0, 0], [0, 0, 2]])
    second = first + np.array([0, 0, 0.5])
    table = weekly_norms([21.0, 22.0, 23.5], [start, first, second], np.array([1, 3]))
    assert table.columns.tolist() == ["from_week", "to_week", "nodes", "max_mm", "mean_mm"]
    assert table.to_numpy().tolist() == [
        [21.0, 22.0, "all", 5.0, 2.0],
        [21.0, 22.0, "pial", 2.0, 1.5],
        [22.0, 23.5, "all", 0.5, 0.5],
        [22.0, 23.5, "pial", 0.5, 0.5],
    ]
