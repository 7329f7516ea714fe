"""Two results folders side by side: what agrees, what differs and by how much, what only one has."""

import pandas as pd
import pytest

from gyriflow.errors import InputError
from gyriflow.io.files import write_table
from gyriflow.io.yaml_files import write_yaml
from gyriflow.shell.compare import compare_results, compare_tables

METRICS = pd.DataFrame(
    {
        "subject": "a",
        "run": ["real", "real", "r", "r"],
        "week": [21, 21, 22, 22],
        "metric": ["area", "volume", "area", "volume"],
        "value": [100.0, 50.0, 110.0, float("nan")],
        "seconds": [1.0, 2.0, 3.0, 4.0],
    }
)


def test_order_time_and_missing_values_are_no_difference():
    other = METRICS.iloc[::-1].assign(seconds=9.0)
    assert compare_tables(METRICS, other, 1e-6) == (4, [])


def test_a_difference_names_its_metric_and_how_large_it_is():
    other = METRICS.assign(value=[100.0, 50.0, 121.0, float("nan")])
    count, found = compare_tables(METRICS, other, 1e-6)
    assert (count, found) == (4, ["area: 1 of 2 differ, at most by 9.09 % (110 and 121)"])
    assert compare_tables(METRICS, other, 0.1) == (4, [])
    # a number against none
    _, found = compare_tables(METRICS, METRICS.fillna(1.0), 0.1)
    assert found == ["volume: 1 of 2 differ, at most by 100 % (nan and 1)"]


def test_rows_and_columns_of_one_table_only_are_named():
    _, found = compare_tables(METRICS, METRICS.iloc[:3].drop(columns="seconds"), 1e-6)
    assert found == ["columns only in the first: seconds", "1 row only in the first"]


def test_results_are_compared_with_their_settings(tmp_path):
    for name, value in (("one", 1.0), ("two", 2.0)):
        results = tmp_path / name / "results"
        write_table(results / "study" / "metrics.csv", METRICS.assign(value=value))
        write_table(results / "study" / "resources.csv", METRICS.assign(value=value))
        write_yaml(results / "report" / "config.yaml", {"folding": {"thickness_mm": value}, "start": "a"})
    found = compare_results(tmp_path / "one", tmp_path / "two" / "results", 1e-6)
    assert found.settings == ["folding.thickness_mm: 1.0 and 2.0"]
    assert (found.tables, found.numbers) == (1, 4)
    assert {file for file, _ in found.differences} == {"study/metrics.csv"}
    assert not compare_results(tmp_path / "one", tmp_path / "one", 0.0).differences
    with pytest.raises(InputError, match="holds no results"):
        compare_results(tmp_path, tmp_path / "one", 0.0)
