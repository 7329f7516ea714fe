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
    table = pd.DataFrame({"value": values})
    names = table.index.str.split("_", n=1, expand=True)
    table[["hemisphere", "metric"]] = names.to_frame().to_numpy()
    return table.assign(subject=subject, run="observed", week=week, unit="cm2")


def test_differences_are_those_from_the_line_between_two_weeks():
    values = {"whole_area": 147.0, "left_area": 70.0, "right_area": 77.0}
    metrics = rows("a", 26.0, **values, whole_mean_shape_index=0.1)
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
    assert index["times_noise"] == pytest.approx(0.1 / (np.sqrt(2) * 0.05))


def test_brains_that_are_not_comparable_have_no_difference():
    assert atlas_curves(CONTENT, SETTINGS | {"edge_length_mm": 1.2}).empty
    curves = atlas_curves(CONTENT, SETTINGS)
    half = rows("half", 25.0, whole_area=60.0, left_area=60.0)
    whole = {"whole_area": 160.0, "left_area": 80.0, "right_area": 80.0}
    others = [("early", 23.9), ("late", 27.1), ("last", 27.0)]
    brains = [rows(name, week, **whole) for name, week in others]
    found = atlas_differences(pd.concat([half, *brains]), curves, NOISE)
    assert list(zip(found["subject"], found["hemisphere"], strict=True)) == [
        ("last", "whole"),
        ("half", "left"),
        ("last", "left"),
    ]
    assert (found["difference"] == 0).all()


def test_shipped_atlases_are_those_of_the_default_settings(tmp_path):
    content = read_yaml(SHIPPED / "norms" / "atlases.yaml")
    (tmp_path / "labels.nii.gz").touch()
    brain = {"id": "a", "week": 24, "labels": "labels.nii.gz", "scheme": "feta-7"}
    settings = norm_settings(load({"brains": [brain]}, tmp_path))
    curves = atlas_curves(content, settings)
    assert set(curves["atlas"]) == {"crl", "chinese"}
    assert set(curves["metric"]) <= set(METRICS)
    for _, part in curves.groupby(["atlas", "hemisphere"]):
        wide = part.pivot_table("value", "week", "metric")
        # brains grow and fold
        growing = ["volume", "area", "gyrification_index", "mean_sulcal_depth"]
        assert (wide.loc[35.0, growing] > wide.loc[23.0, growing]).all()


def test_the_documentation_has_what_weeks_and_segmentation_are_worth():
    atlases = read_yaml(SHIPPED / "norms" / "atlases.yaml")["atlases"]
    areas, thickness = (
        pd.DataFrame(
            {
                atlas: pd.Series(facts["values"]["whole"][metric], facts["weeks"])
                for atlas, facts in atlases.items()
            }
        )
        for metric in ("area", "mean_thickness")
    )
    words = (DOCS / "how-to" / "usual.md").read_text()
    parts = {part.split()[0]: part for part in words.split("\n- **")}
    growth = 100 * (areas.shift(-1) / areas - 1)
    jumps = growth.loc[24.0]
    others = growth.drop(24.0)
    low, high = others.min().min(), others.max().max()
    assert parts["Age"] == Facts(
        f"{low:.0f} to +{high:.0f} %".replace("-", "−"),
        f"{jumps['crl']:.0f} % (CRL)",
        f"{jumps['chinese']:.0f} % (Chinese)",
    )
    thinner = 100 * (1 - thickness["chinese"] / thickness["crl"])
    range_of_percent = f"{thinner.min():.0f} to {thinner.max():.0f} %"
    assert parts["Segmentation"] == Facts(range_of_percent)
