"""Energy and emissions against numbers worked out by hand."""

import numpy as np
import pandas as pd
import pytest

from gyriflow.report.resources import resources

NAN = np.nan
JOBS = pd.DataFrame(
    [
        ("pial_from_labels", None, 36.0, 30.0, 200.0),
        ("simulate", "thin", 3600.0, 4 * 3600.0, 2000.0),
        ("pial_from_labels", None, 36.0, NAN, 300.0),
        ("simulate", "thick", 1800.0, 7200.0, 1000.0),
        ("lost", None, NAN, NAN, NAN),
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


def test_a_job_without_a_time_is_counted_and_adds_nothing():
    lost = resources(JOBS.iloc[4:]).iloc[0]
    assert (lost["jobs"], lost["energy_Wh"]) == (1, 0.0)
    assert np.isnan(lost["memory_MiB"])
