"""Displacement norms of motions that are known."""

import numpy as np
import pytest

from gyriflow.errors import InputError
from gyriflow.metrics.displacement import weekly_norms


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


def test_single_week_has_no_rows_but_columns() -> None:
    table = weekly_norms([21.0], [np.zeros((3, 3))], np.array([0]))
    assert len(table) == 0
    assert "mean_mm" in table


@pytest.mark.parametrize(
    ("weeks", "positions", "match"),
    [
        ([21.0, 22.0], [np.zeros((3, 3))], "needs its positions"),
        ([22.0, 21.0], [np.zeros((3, 3))] * 2, "ascending"),
        ([21.0, 22.0], [np.zeros((3, 3)), np.zeros((4, 3))], "different nodes"),
    ],
)
def test_refused(weeks: list[float], positions: list[np.ndarray], match: str) -> None:
    with pytest.raises(InputError, match=match):
        weekly_norms(weeks, positions, np.array([0]))
