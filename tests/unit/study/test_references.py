"""Which brains are references: norms, regions and scans of one subject."""

import pytest
from configurations import LABELLED

from gyriflow.config import load
from gyriflow.study import resolve

BRAINS = [{"id": f"p{week}", "week": week, **LABELLED} for week in (21, 22, 25)]


def study(brains=None, runs=None, **metrics: object) -> dict:
    return {"brains": brains or BRAINS, "start": "p21", "folding": {"end_week": 22}, "metrics": metrics} | (
        {"runs": runs} if runs else {}
    )


@pytest.fixture
def volume(tmp_path) -> str:
    (tmp_path / "regions.nii.gz").touch()
    return str(tmp_path / "regions.nii.gz")


def test_the_norm_is_of_all_measured_brains_of_one_kind():
    assert resolve(load(study())).norm_reference == ["p21", "p22", "p25"]
    assert resolve(load(study(norm_reference=["p22"]))).norm_reference == ["p22"]


def test_the_norm_is_of_real_brains_where_there_are_any_and_never_of_simple_shapes(tmp_path):
    (tmp_path / "a.stl").touch()
    real = [{"id": f"r{week}", "week": week, "pial": str(tmp_path / "a.stl")} for week in (21, 22)]
    shapes = [{"id": f"s{week}", "week": week, "shape": {"semi_axes_mm": [23, 23, 23]}} for week in (21, 22)]
    assert resolve(load(study([*shapes, *real]) | {"start": "s21"})).norm_reference == ["r21", "r22"]
    assert resolve(load(study([*BRAINS, *real], norm_reference=["p22", "r21"]))).norm_reference == ["p22", "r21"]
    assert resolve(load(study(shapes) | {"start": "s21"})).norm_reference == []


def test_the_norm_is_of_brains_with_the_hemispheres_of_the_start(volume):
    labels = {"scheme": "feta-7"}
    brains = [{"id": f"w{week}", "week": week, "labels": volume, **labels} for week in (21, 22)]
    for side in ("left", "right"):
        brains.append({"id": side, "week": 21, "hemisphere": {"file": volume, "side": side}, **labels})
    for start, norm in (("w21", ["w21", "w22"]), ("left", ["left"])):
        assert resolve(load(study(brains) | {"start": start})).norm_reference == norm
    assert resolve(load(study(brains, norm_reference=["w22", "left"]) | {"start": "w21"})).norm_reference == ["w22"]
