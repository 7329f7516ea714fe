"""Tables of a plan: what is read is what was written."""

from dataclasses import astuple, dataclass

import pytest
from configurations import LABELLED, resolved, touched

from gyriflow.errors import InputError
from gyriflow.settings.brains import ShapeSettings
from gyriflow.settings.terms import Side
from gyriflow.study.records import Brain
from gyriflow.study.tables import read_rows, write_rows


@dataclass(frozen=True)
class Row:
    id: str
    week: float
    side: Side | None
    population: str | None
    is_start: bool
    files: tuple[str, ...]
    covariates: dict[str, str]
    shape: ShapeSettings | None


ROWS = [
    Row("021", 21.0, "left", "NA", True, ("a b;c.nii", 'q"u,\n.gii'), {}, None),
    Row("1e3", 24.29, None, None, False, (), {"sex": "F"}, ShapeSettings(seed=3)),
    Row("true", 22.0, "right", "ü", False, ("null",), {"a": "1"}, ShapeSettings()),
]


def test_rows_are_read_as_they_were_written_ids_as_text(tmp_path):
    path = tmp_path / "rows.csv"
    write_rows(path, Row, ROWS)
    assert read_rows(path, Row) == ROWS
    # the settings that were given stay known as such
    assert read_rows(path, Row)[1].shape.model_fields_set == {"seed"}
    write_rows(path, Row, [])
    assert read_rows(path, Row) == []


def test_a_table_is_only_written_if_it_changed(tmp_path):
    path = tmp_path / "rows.csv"
    write_rows(path, Row, ROWS)
    written = path.stat().st_mtime_ns, path.stat().st_ino
    write_rows(path, Row, ROWS)
    assert (path.stat().st_mtime_ns, path.stat().st_ino) == written
    write_rows(path, Row, ROWS[:1])
    assert read_rows(path, Row) == ROWS[:1]


def test_a_missing_table_is_named(tmp_path):
    with pytest.raises(InputError, match=r"brains\.csv"):
        read_rows(tmp_path / "brains.csv", Brain)


def test_brains_are_read_as_they_were_written(tmp_path):
    touched(tmp_path, "left.gii", "right.gii", "white.gii")
    pial = str(tmp_path / "left.gii")
    brains = [
        {"id": "007", "week": 21, "subject": "12", **LABELLED},
        {"id": "half", "week": 22.29, "hemisphere": {"file": pial, "side": "left"}},
        {"id": "white", "week": 23, "pial": pial, "white": pial},
        {"id": "ball", "week": 22, "shape": {"seed": 2}, "covariates": {"sex": "F"}},
    ]
    regions = {"007": {"volume": pial, "names": {1: "frontal"}}}
    found = resolved(brains, start="007", metrics={"regions": regions}).brains
    path = tmp_path / "brains.csv"
    write_rows(path, Brain, found.values())
    read = read_rows(path, Brain)
    assert [astuple(brain) for brain in read] == [
        astuple(brain) for brain in found.values()
    ]
