"""Files that appear whole or not at all: temporary names and renames, JSON and tables."""

import json
import math
import shutil
import uuid
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from os import PathLike
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pandas as pd

from ..errors import InputError, StorageError

AnyPath = str | PathLike[str]


@contextmanager
def replaced(path: AnyPath) -> Iterator[Path]:
    """Yields a temporary path beside `path` that takes its place when the block ends well.

    The temporary name is hidden and has the same suffixes. After an error it is removed and an earlier file
    stays as it was. Missing folders are made. StorageError where the system refuses to write.
    """
    path = Path(path)
    temporary = path.with_name(f".{uuid.uuid4().hex[:12]}.{path.name}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield temporary
        temporary.replace(path)
    except OSError as error:
        raise StorageError(
            f"cannot be written: {error.strerror or error}",
            path=path,
            remedy="Free disk space or choose a folder that can be written (--directory); earlier files are unchanged.",
        ) from error
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


def emptied(folder: AnyPath) -> Path:
    """Returns the path of a folder that is removed with all in it, so that nothing of an earlier run is left there."""
    shutil.rmtree(folder, ignore_errors=True)
    return Path(folder)


def _plain(value: Any) -> Any:
    """Returns `value` in the types of JSON: numpy scalars and arrays unwrapped, non-finite numbers as null."""
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple | set | np.ndarray):
        return [_plain(item) for item in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, Path):
        return str(value)
    return value


def write_json(path: AnyPath, content: Any) -> None:
    """Writes plain Python and numpy values as JSON; NaN and infinity become null."""
    text = json.dumps(_plain(content), indent=2, ensure_ascii=False)
    with replaced(path) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")


def read_json(path: AnyPath) -> Any:
    """Returns the content of a JSON file; InputError where it is missing or torn."""
    try:
        return json.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(f"cannot be read as JSON: {error}", path=path) from error


def read_text(path: AnyPath) -> str:
    """Returns a text file; InputError where it is missing."""
    try:
        return Path(path).read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        raise InputError(f"cannot be read as text: {error}", path=path) from error


def write_text(path: AnyPath, text: str) -> None:
    """Writes a text file."""
    with replaced(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def write_table(path: AnyPath, table: pd.DataFrame) -> None:
    """Writes a table as CSV without its index, ten significant digits."""
    with replaced(path) as temporary:
        table.to_csv(temporary, index=False, float_format="%.10g")


def read_tab_separated(path: AnyPath) -> list[dict[str, str]]:
    """Returns the rows of a tab-separated table with a heading, as texts by column; InputError where it is none."""
    try:
        table = _read_texts(path)
        # rows that are longer than the heading have names before it, as R writes them, or tabs at their end
        if (table.iloc[:, -table.index.nlevels :] == "").all(axis=None) and not isinstance(table.index, pd.RangeIndex):
            with warnings.catch_warnings(action="ignore", category=pd.errors.ParserWarning):
                table = _read_texts(path, index_col=False)
    except (OSError, ValueError) as error:
        raise InputError(f"cannot be read as a tab-separated table: {error}", path=path) from error
    rows = [{str(name).strip(): value.strip() for name, value in row.items()} for row in table.to_dict("records")]
    for number, row in enumerate(rows, start=2):
        for name, value in row.items():
            if not value.isprintable():
                raise InputError(
                    f"has a line break or another character that is not printed in row {number}, {name}",
                    path=path,
                    found=repr(value),
                    expected="one line of text in each cell",
                )
    if not rows:
        raise InputError("has no rows", path=path, expected="a heading and a row for each brain")
    return rows


def _read_texts(path: AnyPath, index_col: Literal[False] | None = None) -> pd.DataFrame:
    return pd.read_csv(path, sep="\t", dtype=str, keep_default_na=False, encoding="utf-8-sig", index_col=index_col)


def read_table(path: AnyPath) -> pd.DataFrame:
    """Returns a CSV table; InputError where it is missing or torn."""
    try:
        return pd.read_csv(path)
    except (OSError, ValueError) as error:
        raise InputError(f"cannot be read as a CSV table: {error}", path=path) from error
