"""From which brains the apparent age is estimated."""

import pytest

from gyriflow.config import load
from gyriflow.errors import InputError


def study(brains: list[dict], **metrics: object) -> dict:
    return {"brains": brains, "start": brains[0]["id"], "folding": {"end_week": 31}, "metrics": metrics}


PHANTOMS = [{"id": f"p{week}", "week": week, "phantom": {}} for week in range(21, 27)]


@pytest.fixture
def real(tmp_path) -> list[dict]:
    (tmp_path / "a.stl").touch()
    return [{"id": f"r{week}", "week": week, "pial": str(tmp_path / "a.stl")} for week in range(21, 26)]


def test_real_brains_are_the_reference_where_there_are_any(real):
    assert load(study([*PHANTOMS, *real])).age_reference == ["r21", "r22", "r23", "r24", "r25"]
    assert load(study(PHANTOMS)).age_reference == [f"p{week}" for week in range(21, 27)]


def test_simple_shapes_are_no_reference():
    shapes = [{"id": f"s{week}", "week": week, "shape": {"kind": "sphere"}} for week in range(21, 27)]
    assert load(study(shapes)).age_reference == []


def test_too_few_weeks_give_none(real):
    twice = [*real[:4], real[3] | {"id": "again"}]
    assert load(study(twice)).age_reference == []
    assert load(study([*real[:3], *PHANTOMS])).age_reference == []


def test_named_ones(real):
    names = ["p21", "p22", "p23", "p24", "r25"]
    assert load(study([*PHANTOMS, *real], age_reference=names)).age_reference == names


@pytest.mark.parametrize(
    ("names", "match"),
    [
        (["p21", "p77"], r"metrics.age_reference: found p77; expected ids of brains: p21, p22"),
        (["p21", "p22", "p23", "p24"], r"metrics.age_reference: found brains of 4 weeks; it should have 5 or more"),
        ([], r"metrics.age_reference: found brains of 0 weeks"),
    ],
)
def test_refused(names, match):
    with pytest.raises(InputError, match=match):
        load(study(PHANTOMS, age_reference=names))
