"""Tables of a study, and any table as HTML."""

import re

import numpy as np
import pandas as pd
import pytest
from facts import Facts
from text_tables import frame

from gyriflow.metrics.atlas_curves import DIFFERENCES
from gyriflow.metrics.norms import cohort_norms, measured_scores
from gyriflow.quantities import METRICS
from gyriflow.report.page import scores_table
from gyriflow.report.tables import (
    accuracy_table,
    brain_table,
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

from .test_charts import REFERENCE, metrics_with_norms
from .test_page import RUNS, VALIDATION

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


PREDICTED = """
subject run      week hemisphere metric         value expected z centile
s       observed 22.4 whole      area           100   -        - -
s       a        29.9 whole      area           210   -        - -
s       a        22.4 whole      area           101   -        - -
atlas30 observed 30.0 whole      area           200   -        - -
atlas29 observed 29.0 whole      area           190   -        - -
s       a        29.9 whole      volume         150   -        - -
s       a        29.9 whole      crossing_faces 0     -        - -
"""
PREDICTION = {"run": "a", "brain": "s", "start_week": 22.4, "week": 29.9}
PREDICTION |= {"atlas_brain": "atlas30", "atlas_week": 30}
PREDICTION |= {"tests": {"errors": {"area": "± 8 %"}}}


def a_predicted_brain_between_its_start_and_the_atlas_brain():
    """What a brain has not is a dash."""
    metrics = frame(PREDICTED, centile_low=0.0, centile_high=0.0)
    return predicted_table(metrics, PREDICTION, metrics)


def a_predicted_brain_with_centiles_and_the_interval_of_its_ensemble():
    metrics = frame(PREDICTED, centile_low=0.0, centile_high=0.0)
    is_rated = metrics["metric"] == "area"
    rated = ["z", "centile", "centile_low", "centile_high"]
    metrics.loc[is_rated, rated] = [0.5, 69.0, 60.0, 80.0]
    intervals = frame("week low high\n22.4 100 100\n29.9 190 240", metric="area")
    return predicted_table(metrics, PREDICTION, metrics, intervals)


def accuracy_by_horizon_with_the_range_of_starts():
    rows = frame(
        """
        start horizon model distance_mm r_shape_index area_difference volume_difference
        crl   2.0     run   0.2         0.8           -0.02           -
        wu    2.0     run   0.3         0.9           0.01            -
        crl   2.0     atlas 0.5         0.4           0               0
        wu    2.0     atlas 0.7         0.4           0               0
        """
    )
    return accuracy_table({"rows": rows.to_dict("records")})


KEPT = """
week smooth_share finer_share difference_mm
24   0.8          0.4         0.9
26   0.6          0.2         0.9
28   0.5          0.1         0.9
"""


def what_a_prediction_keeps_up_to_its_end():
    return kept_table(frame(KEPT), 25.0)


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


NO_DIFFERENCES = pd.DataFrame(columns=DIFFERENCES)


def numbers_of_a_brain(reference, *, individuals=True):
    """Return the table of a brain of a cohort, some of which are its reference."""
    metrics = metrics_with_norms()
    own = metrics[metrics["subject"] == "case"]
    brains = metrics if reference else own
    norms = cohort_norms(brains, reference, individuals=individuals)
    scores = measured_scores(brains, reference, norms)
    return brain_table(own, scores, NO_DIFFERENCES)


def a_brain_with_centiles():
    return numbers_of_a_brain(REFERENCE)


def a_brain_beside_averages():
    return numbers_of_a_brain(REFERENCE, individuals=False)


def a_brain_without_a_norm():
    return numbers_of_a_brain([])


def a_brain_with_differences_from_atlases_beside_the_noise():
    """A metric that a warning is of has no multiple of the noise, others at most 10,
    and a metric of hemispheres has both."""
    own = frame(
        """
        subject run      week hemisphere metric          value unit
        case    observed 25   whole      area            252   cm2
        case    observed 25   whole      volume          90    mL
        case    observed 25   left       spangy_B4_power 9     1
        case    observed 25   right      spangy_B4_power 9     1
        """
    )
    differences = """
    subject run       hemisphere metric          atlas relative_difference times_noise
    case    observed  whole      volume          one   -0.031              -22.2
    case    observed  whole      volume          two   0.001               1.9
    case    observed  whole      volume          three -                   3.0
    case    observed  whole      area            one   -0.031              -22.2
    case    predicted whole      volume          one   0.5                 9.0
    s1      observed  whole      volume          one   0.5                 9.0
    case    observed  left       spangy_B4_power one   -0.031              -22.2
    case    observed  right      spangy_B4_power one   0.001               1.9
    """
    scores = measured_scores(own, [], cohort_norms(own, []))
    differences = frame(differences, difference=1.0)
    return brain_table(own, scores, differences, {"area": "lower bound"})


def the_scores_of_a_run_at_its_last_compared_week():
    """Those from another start brain of that week are not its own."""
    other = VALIDATION.assign(start="old", distance_mm=9.0)
    return scores_table(RUNS, pd.concat([VALIDATION, other]))


def a_run_without_scores():
    return scores_table(RUNS)


TABLES = (
    metrics_of_the_last_common_week_with_differences_from_the_observed_brain,
    metrics_of_the_last_week_without_observed_brains,
    a_predicted_brain_between_its_start_and_the_atlas_brain,
    a_predicted_brain_with_centiles_and_the_interval_of_its_ensemble,
    accuracy_by_horizon_with_the_range_of_starts,
    what_a_prediction_keeps_up_to_its_end,
    parameters_of_runs_those_that_differ_first,
    the_quality_of_a_mesh_with_its_limits,
    core_hours_the_longer_of_wall_and_cpu_time_with_their_sum,
    a_brain_with_centiles,
    a_brain_beside_averages,
    a_brain_without_a_norm,
    a_brain_with_differences_from_atlases_beside_the_noise,
    the_scores_of_a_run_at_its_last_compared_week,
    a_run_without_scores,
)


@pytest.mark.parametrize("table", TABLES, ids=lambda table: table.__name__)
def test_a_table_has(table, recorded):
    recorded(table().reset_index().T.to_dict(), rtol=1e-3)


def test_what_a_prediction_keeps_is_said_in_a_sentence():
    kept = frame(KEPT)
    assert kept_sentence(kept, 25.0) == Facts("0.90 mm", "25 GW", "70 %", "30 %")
    assert "error of the match" not in kept_sentence(kept, 25.0)
    small = kept.assign(smooth_share=0.1)
    assert "error of the match" in kept_sentence(small, 25.0)


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


def test_signed_metrics_have_no_difference_in_percent():
    scores = frame(
        """
        metric                 value expected centile centile_low centile_high z
        mean_shape_index       0.3   0.25     -       -           -            -
        white_mean_shape_index 0.3   0.25     -       -           -            -
        area                   0.3   0.25     -       -           -            -
        """
    )
    assert centile_text(scores) == ["–", "–", "+20.0 %"]
