"""Which brains are references: norms, regions and scans of one subject."""

import pytest
from configurations import LABELLED

from gyriflow.config import load
from gyriflow.errors import InputError
from gyriflow.study import resolve
from gyriflow.study.figures import figures_of

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


def test_averages_are_no_individuals(volume):
    atlas = {"name": "spina-bifida", "series": "operated", "weeks": [25, 26]}
    own = {"labels": volume, "scheme": "feta-7"}
    brains = [{"id": f"s{week}", "week": week, "subject": f"s{week}", **own} for week in (21, 23)]
    brains += [{"id": f"n{week}", "week": week, **own} for week in (21, 21.4, 23)]
    found = resolve(load({"brains": brains, "atlas": atlas, "metrics": {"norm_reference": ["spina-bifida"]}}))
    assert found.norm_reference == ["spina-bifida-operated-25", "spina-bifida-operated-26"]
    assert not found.individuals(found.norm_reference)
    assert found.individuals(["s21", "s23"])
    assert not found.individuals(["n21", "n23"])
    assert found.individuals(["n21", "n21.4", "n23"])


def test_charts_are_coloured_by_a_covariate_that_groups_subjects(volume):
    own = {"labels": volume, "scheme": "feta-7", "week": 21}
    covariates = [{"site": "x", "mother": str(number), "sex": "FM"[number % 2]} for number in range(3)]
    brains = [{"id": f"b{n}", "covariates": values, **own} for n, values in enumerate(covariates)]
    coloured = {}
    for wanted in (None, "mother"):
        study = resolve(load({"brains": brains, "metrics": {"colour_by": wanted}}))
        coloured[wanted] = next(one for one in figures_of(study) if one.name == "metrics_figure").options["groups"]
    assert coloured[None] == {"b0": "sex: F", "b1": "sex: M", "b2": "sex: F"}
    assert coloured["mother"]["b2"] == "mother: 2"
    with pytest.raises(InputError, match=r"found 1 values of 'site'"):
        load({"brains": brains, "metrics": {"colour_by": "site"}})
