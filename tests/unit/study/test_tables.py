"""Tables of a plan: what is read is what was written."""

from dataclasses import dataclass

from gyriflow.settings.brains import ShapeSettings
from gyriflow.settings.terms import Side
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


SIZED = ShapeSettings(semi_axes_mm=(9, 8, 9))
ROWS = [
    Row("021", 21.0, "left", "NA", True, ("a b;c.nii", 'q"u,\n.gii'), {}, None),
    Row("1e3", 24.29, None, None, False, (), {"sex": "F"}, SIZED),
    Row("true", 22.0, "right", "ü", False, ("null",), {"a": "1"}, ShapeSettings()),
]


def test_rows_are_read_as_they_were_written_ids_as_text(tmp_path):
    path = tmp_path / "rows.csv"
    write_rows(path, Row, ROWS)
    assert read_rows(path, Row) == ROWS
    # the settings that were given stay known as such
    assert read_rows(path, Row)[1].shape.model_fields_set == {"semi_axes_mm"}


def test_a_table_is_only_written_if_it_changed(tmp_path):
    path = tmp_path / "rows.csv"
    write_rows(path, Row, ROWS)
    written = path.stat().st_mtime_ns, path.stat().st_ino
    write_rows(path, Row, ROWS)
    assert (path.stat().st_mtime_ns, path.stat().st_ino) == written
    write_rows(path, Row, ())
    assert read_rows(path, Row) == []
