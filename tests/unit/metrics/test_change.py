"""Change between scans of a subject, and tables of a group."""

import numpy as np
import pandas as pd
import pytest

from gyriflow.metrics.change import change_between_scans, long_table, wide_table

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


def test_without_scans_the_table_is_empty() -> None:
    assert len(change_between_scans(long_table([METRICS]), {})) == 0


def test_wide_has_a_row_per_brain_and_week() -> None:
    table = wide_table(long_table([METRICS, REGIONS]))
    assert len(table) == 6
    row = table.set_index(["subject", "run", "week"]).loc[("other", "real", 24.0)]
    assert row["whole_area_cm2"] == 160.0
    assert row["left_mean_curvedness_1_per_mm"] == 0.1
    assert np.isnan(row["left_frontal_area_cm2"])
