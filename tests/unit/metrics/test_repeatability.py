"""Noise beside changes and distances, from a record of one brain measured several
times."""

import numpy as np
import pandas as pd
import pytest

from gyriflow.io.yaml_files import read_yaml
from gyriflow.metrics.repeatability import (
    score_noise,
    with_distance_noise,
)
from gyriflow.quantities import METRICS, Shown
from gyriflow.shipped import SHIPPED

RECORD = {
    "metrics": {
        "area": {"cv": 0.01, "sd": 3.0},
        "mean_shape_index": {"cv": 0.2, "sd": 0.004},
        "spangy_B4_relative_power": {"cv": 0.02, "sd": 0.006},
        "spangy_shape_index_B5_relative_power": {"cv": 0.1, "sd": 0.02},
    },
    "distances": {"surface_distance": 0.05, "spectral_distance_B4": 0.03},
}
MEAN = np.sqrt(2) * np.sqrt(2 / np.pi)


@pytest.mark.parametrize(
    ("measure", "expected"),
    [
        ("surface_distance", 0.05),
        ("spectral_distance_B4", 0.03),
        ("spectral_distance_B4_to_B6", np.nan),
        ("area", MEAN * 0.01),
        ("relative_power_B4", MEAN * 0.006),
        ("shape_index_relative_power_B5", MEAN * 0.02),
        ("shape_index_relative_power_B5_weyl", MEAN * 0.02),
        ("weyl_number", np.nan),
    ],
)
def test_noise_of_a_distance_is_that_of_a_brain_from_itself(measure, expected) -> None:
    table = with_distance_noise(pd.DataFrame({"measure": [measure]}), RECORD, "measure")
    np.testing.assert_allclose(table["noise"], [expected])


def test_noise_of_a_score_is_the_weighted_sum_of_its_parts() -> None:
    record = {"scores": {"size": 0.001, "shape_index": 0.04}}
    assert score_noise({"size": 3.0, "shape_index": 0.5}, record) == pytest.approx(
        0.023
    )
    assert np.isnan(score_noise({"size": 3.0, "surface_distance": 0.5}, record))


def test_noise_and_curves_of_atlases_have_all_metrics_of_charts() -> None:
    charted = {name for name, metric in METRICS.items() if metric.shown & Shown.CHART}
    noise = read_yaml(SHIPPED / "norms" / "repeatability.yaml")["metrics"]
    assert set(noise) <= set(METRICS)
    atlases = read_yaml(SHIPPED / "norms" / "atlases.yaml")["atlases"]
    assert charted <= set(noise), "benchmarks/repeatability.py measures the noise"
    for atlas in atlases.values():
        curves = set(atlas["values"]["left"]) | set(atlas["values"]["whole"])
        assert charted <= curves, "benchmarks/atlas_curves.py measures the atlases"
