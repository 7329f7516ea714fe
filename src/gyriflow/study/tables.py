"""Write and read the tables of a plan: a row for each record, a column for each of its
fields.

Texts are written as they are, other values as JSON. An empty cell is a missing value.
"""

import csv
import io
import json
from collections.abc import Iterable
from dataclasses import fields
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Literal, get_args, get_origin, get_type_hints

from pydantic import TypeAdapter

from ..io.files import AnyPath, read_text, write_text


def write_rows(
    path: AnyPath,
    kind: type,
    rows: Iterable[Any],
) -> None:
    """Write records of one dataclass as CSV, unless the file has these rows already."""
    text = io.StringIO()
    names = [column.name for column in fields(kind)]
    table = csv.DictWriter(text, names, lineterminator="\n")
    table.writeheader()
    adapter: TypeAdapter = TypeAdapter(kind)
    for row in rows:
        plain = adapter.dump_python(row, mode="json", exclude_unset=True)
        cells = {name: _cell(value) for name, value in plain.items()}
        table.writerow(cells)
    write_changed(path, text.getvalue())


def write_changed(path: AnyPath, text: str) -> None:
    """Write a text file, unless it has this text already."""
    if not Path(path).is_file() or read_text(path) != text:
        write_text(path, text)


def read_rows[Row](path: AnyPath, kind: type[Row]) -> list[Row]:
    """Return the records of a table of `write_rows`; InputError if it cannot be
    read."""
    types = get_type_hints(kind)
    table = csv.DictReader(io.StringIO(read_text(path)))
    rows = []
    for cells in table:
        rows.append({name: _value(text, types[name]) for name, text in cells.items()})
    return TypeAdapter(list[kind]).validate_python(rows)  # type: ignore[valid-type]


def _cell(value: Any) -> str:
    if value is None:
        return ""
    return value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)


def _value(text: str, kind: Any) -> Any:
    if _is_text(kind):
        is_optional = NoneType in get_args(kind)
        return None if is_optional and not text else text
    return json.loads(text) if text else None


def _is_text(kind: Any) -> bool:
    """Return whether the values of a type are texts, or texts and None."""
    if get_origin(kind) is UnionType:
        return all(part is NoneType or _is_text(part) for part in get_args(kind))
    return kind is str or get_origin(kind) is Literal
