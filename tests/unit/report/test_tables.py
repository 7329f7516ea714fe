"""Tables of a study, and any table as HTML."""

import re

import numpy as np
import pandas as pd
import pytest
from text_tables import frame

from gyriflow.quantities import METRICS
from gyriflow.report.measures import metrics_table
from gyriflow.report.tables import (
    html_table,
    mesh_quality,
    resources,
    runs_table,
)

RUN_METRICS = """
subject run      week hemisphere metric             value unit
s       thin     22   whole      area               110   cm2
s       thin     23   whole      area               150   cm2
s       observed 22   whole      area               100   cm2
s       observed 21   whole      area               90    cm2
s       thin     22   whole      gyrification_index 1.2   1
s       thin     22   whole      mean_shape_index   -0.01 1
s       observed 22   whole      mean_shape_index   0.02  1
s       thin     22   whole      mean_curvature_q05 -0.01 1/mm
s       thin     22   whole      crossing_faces     0     1
s       thin     22   left       area               55    cm2
"""


def metrics_of_the_last_common_week_with_differences_from_the_observed_brain():
    """No difference of what may be zero, or without an observed value."""
    return metrics_table(frame(RUN_METRICS), observed_name="ellipsoid")


def metrics_of_the_last_week_without_observed_brains():
    return metrics_table(frame(RUN_METRICS).query("run == 'thin'"))


def parameters_of_runs_those_that_differ_first():
    """A parameter that is off equals an absent one, and curves have their ends."""
    curve = {"21.0": 89.9166, "23.0": 100.0, "25.25": 143.2723}
    common = {"poisson_ratio": 0.45, "growth_rate_per_s": 2e-7, "thickness_mm": 1.5}
    reference = common | {"contact": {"gap_mm": 2.5}, "growth": {}}
    growth = {"thickness_mm": None, "area_cm2": curve}
    thin = common | {"contact": {"gap_mm": 2.0}, "growth": growth}
    return runs_table({"reference": reference, "thin": thin})


def the_quality_of_a_mesh_with_its_limits():
    quality = {"tets": 3072, "min_radius_ratio": 0.125}
    quality["surface_distance_mm"] = {"hausdorff99": 0.0625}
    gates = {"min_radius_ratio": 0.02, "max_surface_distance_mm": 0.1}
    return mesh_quality([quality], starts=["a"], gates=gates)


def core_hours_the_longer_of_wall_and_cpu_time_with_their_sum():
    """A job without a time is counted and adds nothing."""
    jobs = """
    rule             run   wall_s cpu_s memory_MiB
    pial_from_labels -     36     30    200
    simulate         thin  3600   14400 2000
    pial_from_labels -     36     -     300
    simulate         thick 1800   7200  1000
    lost             -     -      -     -
    """
    return resources(frame(jobs))


TABLES = (
    metrics_of_the_last_common_week_with_differences_from_the_observed_brain,
    metrics_of_the_last_week_without_observed_brains,
    parameters_of_runs_those_that_differ_first,
    the_quality_of_a_mesh_with_its_limits,
    core_hours_the_longer_of_wall_and_cpu_time_with_their_sum,
)


@pytest.mark.parametrize("table", TABLES, ids=lambda table: table.__name__)
def test_a_table_has(table, recorded):
    recorded(table().reset_index().T.to_dict(), rtol=1e-3)


def test_html_is_escaped_and_marks_numbers_and_verdicts():
    row = {"verdict": "fine", "run <b>": "a & b", "value": 1 / 3, "none": np.nan}
    table = pd.DataFrame([row | {"count": 7}])
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


def test_metrics_have_their_digits():
    texts = [METRICS["area"].text(value) for value in (144.94, 0.00123456, -2.5)]
    assert texts == ["144.9", "0.001235", "−2.5"]
