"""Files that appear whole or not at all: temporary names and renames, JSON, tables,
HDF5; and fingerprints of files."""

import csv
import gzip
import hashlib
import html
import json
import math
import os
import re
import uuid
import zlib
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from functools import cache
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InputError, StorageError
from ..formats import START_BYTES, foreign_format
from ..grouping import counted
from ..settings.base import absent_content, hint_for_missing

if TYPE_CHECKING:
    import h5py
    import pandas as pd

AnyPath = str | PathLike[str]
AGAIN = "The file may be truncated or of another kind: copy or export it again."
PAIR = re.compile(r"\.(?:hdr|img)(\.gz)?$", re.IGNORECASE)
PAIR_ENDINGS = (".hdr", ".img", ".HDR", ".IMG")
EXTERNAL = re.compile(rb"""ExternalFileName\s*=\s*["']([^"']+)["']""")
TEXT_COLUMNS = (
    "subject",
    "brain",
    "from_brain",
    "to_brain",
    "start",
    "observed",
    "run",
    "series",
    "sweep",
    "sides",
    "page",
    "population",
    "observed_population",
    "source",
    "hemisphere",
    "region",
    "tissue",
    "structure",
    "nodes",
    "metric",
    "measure",
    "quantity",
    "proxy",
    "unit",
    "model",
    "kind",
    "growth_of",
    "parameter",
    "result",
    "place",
    "pose_by",
    "verdict",
    "cause",
    "outcome",
    "flag",
    "resolution",
    "level",
    "message",
    "warnings",
    "stage",
    "rule",
)
"""The columns of text in the tables that gyriflow writes, also where all texts look
like numbers, such as ids."""


def _companion_files(path: AnyPath) -> list[str]:
    """Return the further files that readers open with a file: the second of a pair, the
    external data of GIFTI."""
    path = Path(path)
    pair = PAIR.search(path.name)
    if pair is not None:
        stem = path.name[: pair.start()]
        compression = pair[1] or ""
        return [str(path.with_name(stem + end + compression)) for end in PAIR_ENDINGS]
    ending = path.name.lower()
    if not ending.endswith((".gii", ".gii.gz")):
        return []
    opener: Any = gzip.open if ending.endswith(".gz") else Path.open
    names: set[bytes] = set()
    # damaged files are reported by their readers
    with suppress(OSError, EOFError, zlib.error), opener(path, "rb") as file:
        names.update(EXTERNAL.findall(file.read()))
    companions = []
    for name in sorted(names):
        text = html.unescape(name.decode(errors="replace"))
        companions.append(str(path.parent / text))
    return companions


def _start_of(path: AnyPath) -> bytes:
    with suppress(OSError), Path(path).open("rb") as file:
        return file.read(START_BYTES)
    return b""


def require_content(path: AnyPath) -> None:
    """Raise InputError if the content of a file of git-annex or Git LFS is not here."""
    if absent := absent_content(Path(path), _start_of(path)):
        raise InputError(absent, path=path)


@contextmanager
def reading(
    path: AnyPath,
    kind: str,
    expected: str | None = None,
    remedy: str | None = AGAIN,
) -> Iterator[None]:
    """Turn what a reader raises into an InputError: the file cannot be read as `kind`,
    or is of another format."""
    require_content(path)
    try:
        yield
    except Exception as error:  # readers raise whatever a file leads them into
        for companion in _companion_files(path):
            require_content(companion)
        if isinstance(error, InputError):
            raise
        # of a pair, the missing file
        path = Path(getattr(error, "filename", None) or path)
        reason: object = error
        if isinstance(error, PermissionError):
            reason, remedy = "permission denied", None
        elif not path.is_file():
            reason, remedy = f"no such file{hint_for_missing(path)}", None
        elif not path.stat().st_size:
            reason = "it is empty"
        elif foreign := foreign_format(path, _start_of(path)):
            reason, remedy = f"it is {foreign.name}", foreign.remedy
        raise InputError(
            f"cannot be read as {kind}: {reason}",
            path=path,
            expected=expected,
            remedy=remedy,
        ) from error


def require_finite(
    values: np.ndarray,
    path: AnyPath,
    what: str,
    of: str,
) -> None:
    """Raise InputError where some of a file's (n,) or (n, k) values, such as the
    coordinates of vertices, are none."""
    bad = int(
        np.count_nonzero(~np.isfinite(values).all(axis=tuple(range(1, values.ndim))))
    )
    if bad:
        raise InputError(
            f"has NaN or infinite {what}",
            path=path,
            found=f"{bad} {of}",
            expected="none",
        )


@contextmanager
def atomic_write(path: AnyPath) -> Iterator[Path]:
    """Yield a temporary path that replaces `path` if the block succeeds; StorageError
    if the system refuses."""
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
            remedy=_remedy(path),
        ) from error
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


def _remedy(path: Path) -> str:
    """Return what to do about a file that cannot be written."""
    for folder in path.parents:
        if folder.is_symlink() and not folder.exists():
            target = folder.readlink()
            return (
                f"{folder} is a link to {target}, which does not exist: make that"
                " folder or remove the link."
            )
        if folder.is_file():
            return f"{folder} is a file in place of a folder: rename it."
    return (
        "Free disk space or choose a folder that can be written (--directory); earlier"
        " files are unchanged."
    )


def _plain(value: Any) -> Any:
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
    """Write plain Python and numpy values as JSON; NaN and infinity become null."""
    write_text(
        path,
        json.dumps(
            _plain(content),
            indent=2,
            ensure_ascii=False,
        )
        + "\n",
    )


def read_json(path: AnyPath) -> Any:
    """Return the content of a JSON file; InputError where it is missing or torn."""
    with reading(path, "JSON", remedy=None):
        return json.loads(Path(path).read_text(encoding="utf-8"))


def read_text(path: AnyPath) -> str:
    """Return a text file; InputError where it is missing."""
    with reading(path, "text", remedy=None):
        return Path(path).read_text(encoding="utf-8")


def write_text(path: AnyPath, text: str) -> None:
    """Write a text file."""
    with atomic_write(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def write_table(path: AnyPath, table: "pd.DataFrame") -> None:
    """Write a table as CSV without its index, ten significant digits."""
    with atomic_write(path) as temporary:
        table.to_csv(temporary, index=False, float_format="%.10g")


def read_text_table(path: AnyPath) -> list[dict[str, str]]:
    """Return the rows of a table with a heading, separated by tabs, semicolons or
    commas, as texts by column.

    UTF-8 or UTF-16, and Excel's first line `sep=;`. InputError otherwise, and if a
    column has two values in a row.
    """
    with reading(path, "a table of text", "text in UTF-8 or UTF-16", remedy=None):
        content = Path(path).read_bytes()
        # Excel's "Unicode text"
        text = content.decode(
            "utf-16"
            if content.startswith((BOM_UTF16_LE, BOM_UTF16_BE))
            else "utf-8-sig"
        )
        if not text.strip():
            raise InputError(
                "is empty", path=path, expected="a heading and a row for each brain"
            )
        # Excel's own line about the separator, which it does not show
        if named := re.match(r"sep=(.)\s*\n", text, re.IGNORECASE):
            text = text[named.end() :]
        separator = next(
            (mark for mark in "\t;," if mark in text.partition("\n")[0]), "\t"
        )
        lines = csv.reader(
            text.splitlines(keepends=True), delimiter=named[1] if named else separator
        )
        head, *body = [
            cells
            for cells in ([cell.strip() for cell in line] for line in lines)
            if any(cells)
        ]
    # R writes names of rows in a first column without a heading
    has_names = (
        separator == "\t"
        and bool(body)
        and all(len(cells) > len(head) and cells[len(head)] for cells in body)
    )
    rows = []
    for number, cells in enumerate((cells[has_names:] for cells in body), start=2):
        if any(cells[len(head) :]):
            raise InputError(
                "has a row that is longer than its heading",
                path=path,
                found=f"{counted(len(cells), 'cell')} in row {number}",
                expected=f"{len(head)}, as in the heading",
            )
        row: dict[str, str] = {}
        # columns whose names differ only in case are one
        names: dict[str, str] = {}
        for name, value in zip(
            head,
            [*cells, *[""] * len(head)],
            strict=False,
        ):
            if not value.isprintable():
                raise InputError(
                    "has a line break or another character that is not printed in row"
                    f" {number}, {name}",
                    path=path,
                    found=repr(value),
                    expected="one line of text in each cell",
                )
            first = names.setdefault(name.lower(), name)
            if row.setdefault(first, value) != value:
                raise InputError(
                    f"has two columns {name}",
                    path=path,
                    found=f"{row[first]} and {value} in row {number}",
                    expected="one value",
                )
        rows.append(row)
    if not rows:
        raise InputError(
            "has no rows", path=path, expected="a heading and a row for each brain"
        )
    return rows


def read_table(path: AnyPath) -> "pd.DataFrame":
    """Return a table of `write_table`, the `TEXT_COLUMNS` as text; InputError where it
    is missing or torn."""
    import pandas as pd

    with reading(path, "a CSV table", remedy=None):
        # "NA" and "None" are texts, too
        types = dict.fromkeys(TEXT_COLUMNS, str)
        return pd.read_csv(
            path,
            dtype=types,
            keep_default_na=False,
            na_values=[""],
        )


def read_tables(paths: Iterable[AnyPath]) -> "pd.DataFrame":
    """Return CSV tables below each other; InputError where one is missing or torn."""
    import pandas as pd

    return pd.concat(
        [read_table(path) for path in paths],
        ignore_index=True,
    )


@contextmanager
def new_hdf5(path: AnyPath) -> Iterator["h5py.File"]:
    """Yield an HDF5 file to be filled, which takes its place when the block ends well;
    StorageError where it can't."""
    import h5py

    with atomic_write(path) as temporary:
        # in memory first: HDF5 crashes later on where a write of its own has failed, as
        # on a full disk
        with h5py.File(
            temporary.name,
            "w",
            driver="core",
            backing_store=False,
        ) as file:
            yield file
            file.flush()
            image = file.id.get_file_image()
        temporary.write_bytes(image)


@contextmanager
def reading_hdf5(
    path: AnyPath,
    what: str,
    expected: str,
    remedy: str | None = None,
) -> Iterator["h5py.File"]:
    """Yield an HDF5 file to be read; InputError for whatever goes wrong in the block,
    with what it should be."""
    import h5py

    with reading(path, what, expected, remedy), h5py.File(path) as file:
        yield file


def sha256_of(path: AnyPath) -> str:
    """Return the SHA-256 of a file; StorageError where it cannot be read."""
    try:
        with Path(path).open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise StorageError(
            "cannot be read", path=path, found=error.strerror or error
        ) from error


@cache
def _facts(
    path: str,
    size: int,
    written_ns: int,
    changed_ns: int,
) -> list[Any]:
    """Return the contents of a file in one state, which is read once in a process."""
    return [sha256_of(path), size, written_ns, changed_ns, _companion_files(path)]


def contents(
    files: Iterable[AnyPath], earlier: Mapping[str, Any]
) -> dict[str, list[Any]]:
    """Return SHA-256, size, times and `_companion_files` of each file that can be read,
    companions included, by path.

    Files with the size (bytes) and times of writing and change (ns) of an `earlier`
    result are not read again.
    """
    by_path: dict[str, list[Any]] = {}
    paths = list(map(str, files))
    for path in paths:
        with suppress(OSError, StorageError):
            state = Path(path).stat()
            # a file that was moved here keeps its time of writing, not that of its last
            # change
            current = [state.st_size, state.st_mtime_ns, state.st_ctime_ns]
            found = earlier.get(path, [])
            by_path[path] = found if found[1:-1] == current else _facts(path, *current)
            paths += [
                companion for companion in by_path[path][-1] if companion not in paths
            ]
    return by_path


def fingerprints(
    files: Iterable[AnyPath], earlier: Mapping[str, Any]
) -> dict[str, dict[str, Any]]:
    """Return for each file that is there its SHA-256, its size in bytes and when it was
    last written (UTC); what has not changed since `earlier` is not read (see
    `contents`)."""
    by_path = {}
    for path, (sha256, size, written_ns, *_) in contents(files, earlier).items():
        written = datetime.fromtimestamp(written_ns // 10**9, UTC).isoformat(
            timespec="seconds"
        )
        by_path[path] = {"sha256": sha256, "bytes": size, "written": written}
    return by_path


def files_in(folder: AnyPath, *left_out: str) -> list[Path]:
    """Return the files of a folder and those in it, in order, without hidden ones and
    folders of some names."""
    files = []
    for path in files_below(folder):
        parts = path.relative_to(folder).parts
        if not any(part.startswith(".") or part in left_out for part in parts):
            files.append(path)
    return files


def files_below(folder: AnyPath) -> list[Path]:
    """Return all files below a folder, in order, links followed once; unreadable
    folders stand for theirs."""
    entered: set[str] = set()
    found: list[Path] = []
    errors: list[OSError] = []
    for place, folders, names in os.walk(
        folder, onerror=errors.append, followlinks=True
    ):
        here, real = Path(place), os.path.realpath(place)
        # a folder goes before the links to it
        folders[:] = (
            sorted(
                folders,
                key=lambda name: (here / name).is_symlink(),
            )
            if real not in entered
            else []
        )
        # links without a target are reported by their readers
        files = [here / name for name in names if real not in entered]
        found += [file for file in files if file.is_file() or not file.exists()]
        entered.add(real)
    for error in errors:
        if isinstance(error, PermissionError):
            found.append(Path(error.filename))
    return sorted(found)
