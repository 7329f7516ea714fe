"""Differences from atlases are those of straight lines between their weeks, of
comparable brains only."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from facts import Facts

from gyriflow.io.yaml_files import read_yaml
from gyriflow.metrics.atlas_curves import atlas_curves, atlas_differences
from gyriflow.quantities import METRICS
from gyriflow.shipped import SHIPPED
from gyriflow.study.checks import norm_settings
from gyriflow.study.loading import load

DOCS = Path(__file__).parents[3] / "docs"
SETTINGS = {"norms": 3, "edge_length_mm": 1.0}
WEEKS = [24.0, 25.0, 27.0]
VALUES = {
    "whole": {"area": [100.0, 120.0, 160.0], "mean_shape_index": [0.2, 0.1, -0.1]},
    "left": {"area": [50.0, 60.0, 80.0]},
}
CONTENT = {
    "made_with": SETTINGS,
    "atlases": {"one": {"weeks": WEEKS, "values": VALUES}},
}
NOISE = {"metrics": {"area": {"cv": 0.01}, "mean_shape_index": {"sd": 0.05}}}


def rows(subject, week, **values):
    """Return metrics of an observed brain by hemisphere and metric, as
    `left_area=50.0`."""
    table = []
    for name, value in values.items():
        hemisphere, metric = name.split("_", 1)
        table.append((subject, "observed", week, hemisphere, metric, value, "cm2"))
    names = ["subject", "run", "week", "hemisphere", "metric", "value", "unit"]
    return pd.DataFrame(table, columns=names)


def test_differences_are_those_from_the_line_between_two_weeks():
    metrics = rows(
        "a",
        26.0,
        whole_area=147.0,
        left_area=70.0,
        right_area=77.0,
        whole_mean_shape_index=0.1,
    )
    curves = atlas_curves(CONTENT, SETTINGS | {"version": "any"})
    found = atlas_differences(metrics, curves, NOISE)
    found = found.set_index(["hemisphere", "metric"])
    assert list(found.index) == [
        ("whole", "area"),
        ("whole", "mean_shape_index"),
        ("left", "area"),
    ]
    area = found.loc[("whole", "area")]
    assert (area["atlas"], area["expected"], area["difference"]) == ("one", 140.0, 7.0)
    assert area["relative_difference"] == pytest.approx(0.05)
    assert area["noise"] == pytest.approx(np.sqrt(2) * 1.4)
    assert area["times_noise"] == pytest.approx(7.0 / (np.sqrt(2) * 1.4))
    # what may be negative has no share
    index = found.loc[("whole", "mean_shape_index")]
    assert np.isnan(index["relative_difference"])
    assert index["difference"] == pytest.approx(0.1)
    assert index["times_noise"] == pytest.approx(0.1 / (np.sqrt(2) * 0.05))


def test_brains_that_are_not_comparable_have_no_difference():
    curves = atlas_curves(CONTENT, SETTINGS)
    half = rows("half", 25.0, whole_area=60.0, left_area=60.0)
    early = rows("early", 23.9, whole_area=90.0, left_area=45.0, right_area=45.0)
    late = rows("late", 27.1, whole_area=90.0, left_area=45.0, right_area=45.0)
    last = rows("last", 27.0, whole_area=160.0, left_area=80.0, right_area=80.0)
    metrics = pd.concat([half, early, late, last], ignore_index=True)
    found = atlas_differences(metrics, curves, NOISE)
    assert list(zip(found["subject"], found["hemisphere"], strict=True)) == [
        ("last", "whole"),
        ("half", "left"),
        ("last", "left"),
    ]
    assert (found["difference"] == 0).all()


def test_atlases_that_were_measured_with_other_settings_are_not_compared():
    curves = atlas_curves(CONTENT, SETTINGS | {"edge_length_mm": 1.2})
    assert curves.empty
    metrics = rows("a", 25.0, whole_area=1.0, left_area=1.0, right_area=1.0)
    assert atlas_differences(metrics, curves, NOISE).empty


def test_shipped_atlases_are_those_of_the_default_settings(tmp_path):
    content = read_yaml(SHIPPED / "norms" / "atlases.yaml")
    (tmp_path / "labels.nii.gz").touch()
    brain = {"id": "a", "week": 24, "labels": "labels.nii.gz", "scheme": "feta-7"}
    settings = norm_settings(load({"brains": [brain]}, tmp_path))
    curves = atlas_curves(content, settings)
    assert set(curves["atlas"]) == {"crl", "chinese"}
    assert set(curves["metric"]) <= set(METRICS)
    for (_, hemisphere), part in curves.groupby(["atlas", "hemisphere"]):
        wide = part.pivot_table("value", "week", "metric")
        assert wide.index[0] <= 22.0
        assert wide.index[-1] >= 35.0
        # brains grow and fold
        growing = ["volume", "area", "gyrification_index", "mean_sulcal_depth"]
        assert (wide[growing].iloc[-1] > wide[growing].iloc[0]).all(), hemisphere


def test_the_documentation_has_what_weeks_and_segmentation_are_worth():
    content = read_yaml(SHIPPED / "norms" / "atlases.yaml")
    percent = {}
    for atlas, facts in content["atlases"].items():
        areas = np.array(facts["values"]["whole"]["area"])
        growth = 100 * (areas[1:] / areas[:-1] - 1)
        for week, value in zip(facts["weeks"], growth, strict=False):
            percent[atlas, week] = value
    jumps = [percent.pop((atlas, 24.0)) for atlas in ("crl", "chinese")]
    words = (DOCS / "how-to" / "usual.md").read_text()
    parts = {part.split()[0]: part for part in words.split("\n- **")}
    sentence = parts["Age"]
    low, high = min(percent.values()), max(percent.values())
    assert sentence == Facts(
        f"{low:.0f} to +{high:.0f} %".replace("-", "−"),
        f"{jumps[0]:.0f} % (CRL)",
        f"{jumps[1]:.0f} % (Chinese)",
    )
    thickness = {
        atlas: dict(
            zip(facts["weeks"], facts["values"]["whole"]["mean_thickness"], strict=True)
        )
        for atlas, facts in content["atlases"].items()
    }
    thinner = [
        100 * (1 - value / thickness["crl"][week])
        for week, value in thickness["chinese"].items()
    ]
    assert parts["Segmentation"] == Facts(f"{min(thinner):.0f} to {max(thinner):.0f} %")
