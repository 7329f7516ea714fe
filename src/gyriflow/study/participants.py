"""Tables of participants and their sessions in the format of BIDS: the age and the
other values of a scan."""

import difflib
import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..formats import is_volume
from ..io.files import read_json, read_text_table
from ..names import merged_names
from ..settings.base import absent_content, hint_for_missing, located, own_name, path_in
from ..settings.brains import SOURCES, ParticipantsSettings
from ..settings.weeks import WeekNotation
from .ages import (
    OTHER_AGE,
    AgeColumn,
    ScanAge,
    TableAge,
    age_column,
    column_key,
    is_missing,
    read_ages,
    require_clear_decimals,
)

IDS = ("participant_id", "id")
"""Possible names of the column of participants."""
SESSIONS = (
    "session_id",
    "session",
    "ses",
    "ses_id",
    "session_label",
    "session_number",
    "visit",
    "visit_id",
    "visit_number",
    "timepoint",
    "time_point",
    "tp",
    "wave",
)
"""Possible names of the column of sessions; the first one of a table counts."""
SUBJECT_FOLDER = re.compile(r"sub-[^_/.]+")
TABLE_NAME = re.compile(
    r"participants\.(?:tsv|csv)|(?:(sub-[^_/.]+)_)?(?:(ses-[^_/.]+)_)?(?:sessions|(scans))\.(?:tsv|csv)",
    re.IGNORECASE,
)
EXPECTED_COLUMNS = (
    "scan_age or gestational_age, in weeks, or with its unit in its name or JSON file"
)
SHARED_FOLDERS = ("rawdata", "sourcedata", "derivatives", "phenotype")
"""Folders of a data set whose tables apply to all of it."""


@dataclass(frozen=True)
class TableRow:
    """A row of the table in a file, about the files in the folder `scope`.

    It has its place for messages, subject and session without `sub-` and `ses-`, the
    texts of other columns, and its ages.
    """

    path: Path
    scope: Path
    place: str
    name: str
    session: str | None
    values: Mapping[str, str]
    ages: Sequence[TableAge]


@dataclass(frozen=True)
class Table:
    """A table of participants or sessions.

    It applies to the files in the folder `scope`, with a `subject` only to those of the
    subject. A table that cannot be read has a `problem`.
    """

    path: Path
    scope: Path
    subject: str | None
    rows: Sequence[TableRow] = ()
    columns: Sequence[str] = ()
    ages: Sequence[AgeColumn] = ()
    problem: str = ""


def _read_table(path: Path) -> Table:
    """Return a table of participants or sessions; InputError if it cannot be read or
    has no ids.

    A table of sessions or scans in a folder `sub-…` is of this subject, and applies to
    the folder around it. Another table applies to its own folder.
    """
    empty = _empty_table(path)
    texts = read_text_table(path)
    columns = list(texts[0])
    for first, second in merged_names(columns, column_key):
        if column_key(first) in (*IDS, *SESSIONS):
            raise InputError(
                "has two columns of one name",
                path=path,
                found=f"{first} and {second}",
                expected="one",
            )
    names = {column_key(name): name for name in columns}
    ids = next(
        (names[key] for key in IDS if key in names),
        None,
    )
    if ids is None and empty.subject is None:
        raise InputError(
            "has no column of ids",
            path=path,
            found=", ".join(columns),
            expected=" or ".join(IDS),
        )
    session = next(
        (names[key] for key in SESSIONS if key in names),
        None,
    )
    ages = _age_columns(columns, empty)
    name_parts = TABLE_NAME.fullmatch(path.name)
    session_of_file = name_parts[2] if name_parts else None
    further = set(columns) - {ids, session}
    if name_parts is not None and name_parts[3] is not None:
        # other columns are those of files
        further = {column.name for column in ages}
    rows = []
    for number, values in enumerate(texts, start=2):
        name = values[ids] if ids is not None else empty.subject or ""
        if empty.subject not in (None, name.removeprefix("sub-")):
            raise InputError(
                "is named as of another subject",
                path=path,
                found=name,
                expected=f"sub-{empty.subject}",
            )
        label = values[session] if session is not None else session_of_file or ""
        own_session = None if is_missing(label) else label.removeprefix("ses-")
        place = f"{path.name} row {number}"
        cells = [
            TableAge(
                place,
                column,
                values[column.name],
            )
            for column in ages
        ]
        other_values = {key: text for key, text in values.items() if key in further}
        row = TableRow(
            path,
            empty.scope,
            place,
            name,
            own_session,
            other_values,
            cells,
        )
        rows.append(row)
    return replace(
        empty,
        rows=rows,
        columns=columns,
        ages=ages,
    )


def _age_columns(names: Iterable[str], table: Table) -> list[AgeColumn]:
    """Return the columns of ages of a table, as its JSON file describes them."""
    sidecar = _sidecar(table)
    facts = {}
    if isinstance(sidecar, dict):
        facts = {column_key(str(name)): text for name, text in sidecar.items()}
    columns = []
    for name in names:
        described = facts.get(column_key(name), {})
        column = age_column(
            name,
            described,
            f"{table.path.stem}.json",
        )
        if column is not None:
            columns.append(column)
    return columns


def _sidecar(table: Table) -> Any:
    """Return the content of the JSON file of a table: beside it, or further up for all
    tables of its kind."""
    stem = table.path.stem.lower()
    names = (f"{stem}.json", f"{stem.rpartition('_')[2]}.json")
    for folder in table.path.parents[:3]:
        if not folder.is_relative_to(table.scope):
            continue
        for file in sorted(folder.glob("*.[jJ][sS][oO][nN]")):
            if file.name.lower() in names:
                return read_json(file)
    return {}


def _empty_table(path: Path) -> Table:
    name, folder = TABLE_NAME.fullmatch(path.name), path.parent
    subject = name[1] if name else None
    if name and not path.name.lower().startswith("participants."):
        # the table of a session may be in its folder, or in one within it
        around = (
            place for place in path.parents[:3] if SUBJECT_FOLDER.fullmatch(place.name)
        )
        if own := next(around, None):
            subject, folder = subject or own.name, own.parent
    return Table(
        path, data_set_of(folder), subject.removeprefix("sub-") if subject else None
    )


def data_set_of(folder: Path) -> Path:
    """Return the data set that a folder is of: the one around its raw data or
    derivatives."""
    for number, part in enumerate(folder.parts):
        if part.lower() in SHARED_FOLDERS:
            return Path(*folder.parts[:number])
    return folder


class ScanTables:
    """The tables of participants and sessions of a data set; `notation` is that of ages
    such as 24.3, if known.

    If any table has a column named as of the age at the scan, only such columns give
    ages, since a gestational age beside them is at birth. Otherwise gestational ages
    do, unless a column of another age has values.
    """

    def __init__(
        self, paths: Iterable[Path], notation: WeekNotation | None = None
    ) -> None:
        self.tables: list[Table] = []
        self.notation = notation
        for path in paths:
            try:
                self.tables.append(_read_table(path))
            except InputError as error:
                self.tables.append(
                    replace(
                        _empty_table(path),
                        problem=str(error),
                    )
                )
        self.rows: dict[str, list[TableRow]] = {}
        self.cells: list[TableAge] = []
        for table in self.tables:
            for row in table.rows:
                subject = row.name.removeprefix("sub-")
                self.rows.setdefault(subject, []).append(row)
                self.cells += row.ages
        kinds = {cell.column.kind for cell in self.cells}
        self.kind = "scan" if "scan" in kinds else "gestational"
        # in columns that are not named as of gestational ages
        others = [cell for cell in self._cells_of("other") if not is_missing(cell.text)]
        self.other_ages = others

    @property
    def age_problem(self) -> str:
        """The reason why no table gives ages, or ""."""
        if not self.tables or self._cells_of(self.kind):
            return ""
        first = self.tables[0]
        return (
            f"{first.path}: has no column of gestational ages; found"
            f" {', '.join(first.columns)}; expected {EXPECTED_COLUMNS}"
        )

    def require_clear_decimals(self, path: Path) -> None:
        """Raise InputError if all ages may be either decimals or weeks and days."""
        cells = self._cells_of(self.kind)
        texts = [cell.text for cell in cells if cell.column.unit == "weeks"]
        require_clear_decimals(texts, self.notation, path)

    def _cells_of(self, kind: str) -> list[TableAge]:
        return [cell for cell in self.cells if cell.column.kind == kind]

    def sessions_of(self, subject: str) -> list[str]:
        """Return the sessions of a subject that any row names."""
        sessions = dict.fromkeys(row.session for row in self.rows.get(subject, ()))
        return [session for session in sessions if session is not None]

    def facts(
        self,
        subject: str,
        session: str | None,
        is_only_scan: bool = True,
        place: Path | None = None,
    ) -> ScanAge | None:
        """Return a scan's age and values in the tables for a file, or None if they have
        no row of its subject.

        A row without a session is of a subject's only scan. Without any age, there is
        no cause.
        """
        for table in self.tables:
            is_of_subject = table.subject in (None, subject)
            if table.problem and is_of_subject and _is_in(place, table.scope):
                return ScanAge(None, cause=table.problem)
        own = [row for row in self.rows.get(subject, ()) if _is_in(place, row.scope)]
        if not own:
            return None
        with_session = [row for row in own if row.session is not None]
        found = ", ".join(f"{row.session} ({row.place})" for row in with_session)
        sessions = {row.session for row in with_session}
        if session is None and len(sessions) == 1 and is_only_scan:
            (session,) = sessions
        elif session is None and sessions:
            cause = (
                f"its name has no session; found {found}; expected ses-… in the name,"
                " as in session_id"
            )
            return ScanAge(None, cause=cause)
        is_only_scan &= len({*sessions, session} - {None}) < 2
        ages: list[TableAge] = []
        shared: list[TableAge] = []
        values: dict[str, str] = {}
        for label in dict.fromkeys((None, session)):
            rows_of_scan = [row for row in own if row.session == label]
            difference = _difference(rows_of_scan)
            if difference:
                return ScanAge(None, cause=difference)
            is_shared = label != session and not is_only_scan
            for row in rows_of_scan:
                values |= row.values
                (shared if is_shared else ages).extend(row.ages)
        age = self._age(ages)
        if age is None and sessions and session not in sessions:
            cause = f"no row of its session; found {found}; expected {session}"
            age = ScanAge(None, cause=cause)
        if age is None and shared:
            cells = [cell for cell in shared if not is_missing(cell.text)]
            cause = (
                f"one age is given for several sessions; found {(cells or shared)[0]};"
                f" expected a row with session_id {session}"
            )
            age = ScanAge(None, cause=cause)
        used = {cell.column.name for cell in ages if cell.column.kind == self.kind}
        further = {key: text for key, text in values.items() if key not in used}
        return replace(age or ScanAge(None), values=further)

    def _age(self, ages: Sequence[TableAge]) -> ScanAge | None:
        """Return the age that the cells of a scan give, or None if it has no cells."""
        used = [age for age in ages if age.column.kind == self.kind]
        present = [age for age in used if not is_missing(age.text)]
        others = []
        for age in ages:
            if age.column.kind != self.kind and not is_missing(age.text):
                others.append(age)
        doubtful = others
        if self.kind == "scan" and used:
            # such as the type of an age
            doubtful = [age for age in others if OTHER_AGE.search(age.text)]
        elif present and not others:
            doubtful = self.other_ages[:1]
        if doubtful:
            found = " and ".join(
                map(
                    str,
                    (*present, *doubtful),
                )
            )
            cause = (
                f"found {found}: which is the gestational age at the scan is unclear;"
                " expected it in a column named scan_age"
            )
            return ScanAge(None, cause=cause)
        if not ages:
            return None
        age_of_scan = read_ages(
            present or used[:1] or ages[:1],
            self.notation,
        )
        if age_of_scan.week is None or not others:
            return age_of_scan
        ignored = ", ".join(f"{age.column.name} {age.text}" for age in others)
        return replace(
            age_of_scan,
            source=f"{age_of_scan.source} (not {ignored})",
        )


def _is_in(file: Path | None, folder: Path) -> bool:
    """Return whether a file is in a folder; None: any file."""
    return file is None or file.is_relative_to(folder)


# brains of a configuration

PATHS = (
    "labels",
    "image",
    "pial",
    "white",
    "hemispheres.left",
    "hemispheres.right",
)
"""Columns that are keys of brains with paths, inner keys with dots."""
BRAIN_KEYS = (
    *PATHS,
    "population",
    "subject",
    "scheme",
    "affine_from",
    "coordinates",
    "side",
)
"""All columns that are keys of brains, except ids and age."""
FILES = "files"
"""Column of files of any source."""
KNOWN_COLUMNS = (
    *IDS,
    *SESSIONS,
    "gestational_age",
    "scan_age",
    "week",
    FILES,
    *BRAIN_KEYS,
)
MIN_SIMILARITY = 0.85
"""Minimum similarity of an unknown column to a known one to be reported as mistyped."""


def participants_brains(
    settings: ParticipantsSettings, folder: Path
) -> tuple[list[dict[str, Any]], dict[str, dict[str, Any]], dict[str, str]]:
    """Return the entries of `brains` made from a table, the rows that cannot be used by
    id, and the sources of ages.

    Each unusable row has `week`, its age if it is known, and `cause`, the reason.
    `folder` is the configuration's. InputError if the table cannot be read or lacks a
    column that every row needs.
    """
    path = located(folder, settings.file)
    table = _read_table(path)
    tables = ScanTables([path, *_session_tables(table)], settings.ages)
    _require_valid(table, tables)
    entries: list[dict[str, Any]] = []
    left_out: dict[str, dict[str, Any]] = {}
    sources: dict[str, str] = {}
    for name in dict.fromkeys(row.name for row in table.rows):
        subject = name.removeprefix("sub-")
        sessions: list[str | None] = [*tables.sessions_of(subject)]
        for session in sessions or [None]:
            scan = name if session is None else f"{name}_ses-{session}"
            facts = tables.facts(subject, session, len(sessions) < 2)
            assert facts is not None
            entry, problem = _entry(
                scan, name, session, facts, settings.columns, path.parent
            )
            problem = facts.cause or problem
            if problem:
                cause = f"{path}: {scan}: {problem}"
                left_out[scan] = {"week": facts.week, "cause": cause}
            else:
                entries.append(entry)
                sources[scan] = facts.source
    by_files: dict[str, list[dict[str, Any]]] = {}
    for entry in entries:
        files = [entry["subject"], *(entry.get(key) for key in SOURCES)]
        by_files.setdefault(repr(files), []).append(entry)
    for same in by_files.values():
        if len(same) == 1:
            continue
        found = " and ".join(entry["id"] for entry in same)
        for entry in same:
            cause = (
                f"{path}: {entry['id']}: {found} have the same files; expected files of"
                " each session"
            )
            left_out[entry["id"]] = {
                "week": entry["week"],
                "cause": cause,
            }
    entries = [entry for entry in entries if entry["id"] not in left_out]
    return entries, left_out, sources


def _require_valid(table: Table, tables: ScanTables) -> None:
    """Raise InputError if a table of brains has a mistyped column, no usable ages or
    two names of one participant."""
    ages = {age.name for age in table.ages}
    for column in table.columns:
        if column in ages or column_key(column) in KNOWN_COLUMNS:
            continue
        near = difflib.get_close_matches(
            column, KNOWN_COLUMNS, n=1, cutoff=MIN_SIMILARITY
        )
        if near:
            raise InputError(
                "has a column whose name seems mistyped",
                path=table.path,
                found=column,
                expected=near[0],
            )
    if tables.age_problem:
        raise InputError(tables.age_problem)
    tables.require_clear_decimals(table.path)
    names = [row.name for row in table.rows]
    for first, second in merged_names(
        names,
        lambda name: name.removeprefix("sub-"),
    ):
        raise InputError(
            "has two names of one participant",
            path=table.path,
            found=f"{first} and {second}",
            expected="one of them, since sub- is not part of the label",
        )


def _session_tables(table: Table) -> Iterator[Path]:
    folder = table.path.parent
    files = ["sessions.tsv"]
    for name in dict.fromkeys(row.name for row in table.rows):
        # other names could be paths out of the folder
        if SUBJECT_FOLDER.fullmatch(name):
            files.append(f"{name}/{name}_sessions.tsv")
    for file in files:
        if os.path.lexists(folder / file):
            yield folder / file


def _difference(rows: Iterable[TableRow]) -> str:
    """Return how several rows of one scan in a table differ, or ""."""
    first_rows: dict[Path, TableRow] = {}
    for row in rows:
        first = first_rows.setdefault(row.path, row)
        for column, text in row.values.items():
            known = first.values[column]
            if text != known:
                return (
                    f"several rows have this id; found {column} {known} ({first.place})"
                    f" and {text} ({row.place}); expected one row for each scan, with"
                    " its session_id"
                )
    return ""


def covariates(values: Mapping[str, str]) -> dict[str, dict[str, str]]:
    """Return the key `covariates` of a scan's brain: the values of its tables without
    another meaning."""
    own_keys = (FILES, *BRAIN_KEYS)
    further = {}
    for key, text in values.items():
        if key not in own_keys and not is_missing(text):
            further[key] = text
    return {"covariates": further} if further else {}


def _entry(
    scan: str,
    name: str,
    session: str | None,
    facts: ScanAge,
    columns: Mapping[str, str],
    folder: Path,
) -> tuple[dict[str, Any], str]:
    """Return the entry of a scan, or the problem of its row."""
    names = {
        "id": scan,
        "subject": name,
        "session": f"ses-{session}" if session else "n/a",
    }
    # after the table's columns, and without replacing them
    texts = dict(facts.values)
    for key, text in columns.items():
        filled = re.sub(
            r"\{(id|subject|session)\}", lambda match: names[match[1]], text
        )
        texts.setdefault(key, filled)
    values = {key: text for key, text in texts.items() if not is_missing(text)}
    entry: dict[str, Any] = {
        "id": scan,
        "week": facts.week,
        "subject": name,
        **covariates(values),
    }
    if FILES in values:
        files = [part.strip() for part in values[FILES].split(";")]
        limit, expected = 2, "at most a left and a right hemisphere"
        if "side" in values:
            limit, expected = 1, "the file of this side"
        if len(files) > limit:
            found = f"{len(files)}, {'; '.join(files)}"
            return {}, f"files: found {found}; expected {expected}"
        kind = "labels" if is_volume(files[0]) else "pial"
        keys = ("hemispheres.left", "hemispheres.right") if len(files) > 1 else (kind,)
        values |= dict(zip(keys, files, strict=True))
    for column, text in values.items():
        if column not in BRAIN_KEYS:
            continue
        value: str | list[str] = text
        if column in PATHS:
            parts = text.split(";") if column == "white" else [text]
            files = []
            for part in parts:
                place = own_name(path_in(folder, part.strip()))
                if not place.is_file():
                    missing = absent_content(place)
                    missing = missing or f"no such file{hint_for_missing(place)}"
                    return {}, f"{column}: {place}: {missing}"
                files.append(str(place))
            value = files[0] if len(files) == 1 else files
        *outer, last = column.split(".")
        section = entry
        for key in outer:
            section = section.setdefault(key, {})
        section[last] = value
    if not set(SOURCES) & set(entry):
        return entry, f"found no data; expected files, or one of {', '.join(PATHS)}"
    return entry, ""
