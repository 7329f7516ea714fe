"""Tables of participants and their sessions in the format of BIDS: the age and the
other values of a scan."""

import difflib
import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..formats import is_volume
from ..io.files import read_json, read_text_table
from ..names import merged_names
from ..settings.base import absent_content, hint_for_missing, located, own_name, path_in
from ..settings.brains import SOURCES, ParticipantsSettings
from ..settings.weeks import EXPECTED_AGE, WeekNotation
from .ages import (
    EXPECTED_COLUMNS,
    OTHER_TYPE,
    AgeColumn,
    ScanAge,
    TableAge,
    age_columns,
    choose_age,
    column_key,
    is_missing,
    may_be_days,
    unit_of,
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
SHARED_FOLDERS = ("rawdata", "sourcedata", "derivatives", "phenotype")
"""Folders of a data set whose tables apply to all of it."""
AGE_TYPES = ("age_type", "age_reference", "type_of_age", "age_ref")
AGE_UNITS = ("age_unit", "age_units", "unit_of_age")


@dataclass(frozen=True)
class Row:
    """A row of a table for the files in the folder `scope`.

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

    @property
    def subject(self) -> str:
        return self.name.removeprefix("sub-")

    def _applies_to(self, file: Path | None) -> bool:
        """Return whether a row is about a file; None: any file."""
        return file is None or file.is_relative_to(self.scope)


@dataclass(frozen=True)
class Table:
    """A table of participants or sessions.

    It applies to the files in the folder `scope`, with a `subject` only to those of the
    subject. A table that cannot be read has a `problem`.
    """

    path: Path
    scope: Path
    subject: str | None
    rows: Sequence[Row] = ()
    columns: Sequence[str] = ()
    ages: Sequence[AgeColumn] = ()
    problem: str = ""

    def _may_have(self, subject: str, file: Path | None) -> bool:
        """Return whether a table may have a row about a file of a subject."""
        is_in_scope = file is None or file.is_relative_to(self.scope)
        return is_in_scope and self.subject in (None, subject)

    @property
    def age_problem(self) -> str:
        """The reason why none of its columns gives ages, or ""."""
        if not self.ages:
            expected = f"{EXPECTED_COLUMNS} {self.path.stem}.json"
            return (
                f"has no column of gestational ages; found {', '.join(self.columns)};"
                f" expected {expected}"
            )
        if any(not column.problem for column in self.ages):
            return ""
        first = self.ages[0]
        return (
            f"{first.name}: {first.problem}; found the columns"
            f" {', '.join(self.columns)}; instead, name the age gestational_age or"
            " scan_age"
        )


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
        if column_key(first) in (*IDS, *SESSIONS) and any(
            row[first] != row[second] for row in texts
        ):
            raise InputError(
                "has two columns of one name",
                path=path,
                found=f"{first} and {second}",
                expected="one",
            )
    names = {column_key(name): name for name in columns}
    ids = next((names[key] for key in IDS if key in names), None)
    if ids is None and empty.subject is None:
        raise InputError(
            "has no column of ids",
            path=path,
            found=", ".join(columns),
            expected=" or ".join(IDS),
        )
    session = next((names[key] for key in SESSIONS if key in names), None)
    ages = age_columns(columns, _sidecar(empty), f"{path.stem}.json")
    name_parts = TABLE_NAME.fullmatch(path.name)
    session_of_file = name_parts[2] if name_parts else None
    is_of_scans = name_parts is not None and name_parts[3] is not None
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
        if is_of_scans:
            # other columns are those of files
            further = {column.name: values[column.name] for column in ages}
        else:
            further = {
                key: text for key, text in values.items() if key not in (ids, session)
            }
        place = f"{path.name} row {number}"
        row = Row(path, empty.scope, place, name, own_session, further, ())
        rows.append(replace(row, ages=[*_ages_in(row, ages)]))
    return replace(empty, rows=rows, columns=columns, ages=ages)


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


def _ages_in(row: Row, columns: Iterable[AgeColumn]) -> Iterator[TableAge]:
    """Yield the ages in a row; further columns may have their type or unit."""
    kind = _first_text(row, AGE_TYPES)
    unit_name = _first_text(row, AGE_UNITS)
    for column in columns:
        if kind is not None and OTHER_TYPE.search(kind):
            problem = f"is not a gestational age: its type (age_type) is {kind}"
            column = replace(column, problem=problem, is_other=True)
        elif unit_name is not None and column_key(column.name) == "age":
            unit = unit_of(unit_name)
            problem = ""
            if unit is None:
                problem = f"found the unit {unit_name}; expected weeks or days"
            column = replace(column, unit=unit or "weeks", problem=problem)
        text = row.values[column.name]
        yield TableAge(row.place, column, text, row.session is not None)


def _first_text(row: Row, names: Sequence[str]) -> str | None:
    """Return the text in the first column of a row with one of some names, or None."""
    for column, text in row.values.items():
        if column_key(column) in names:
            return text
    return None


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
    shared = [
        number
        for number, part in enumerate(folder.parts)
        if part.lower() in SHARED_FOLDERS
    ]
    return Path(*folder.parts[: shared[0]]) if shared else folder


class ScanTables:
    """The tables of participants and sessions of a data set; `notation` is that of ages
    such as 24.3, if known."""

    def __init__(
        self, paths: Iterable[Path], notation: WeekNotation | None = None
    ) -> None:
        self.tables: list[Table] = []
        self.notation = notation
        for path in paths:
            try:
                self.tables.append(_read_table(path))
            except InputError as error:
                self.tables.append(replace(_empty_table(path), problem=str(error)))

    @cached_property
    def ambiguity(self) -> str:
        """The problem that all ages may be either decimals or weeks and days, or ""."""
        kinds = [
            age.column.kind for age in self._ages if age.column.kind != "postnatal"
        ]
        first = min(kinds, key=["scan", "gestational", "age"].index, default="age")
        texts = [
            age.text
            for age in self._ages
            if age.column.kind == first and age.column.unit == "weeks"
        ]
        return ambiguity_of(texts) if self.notation is None else ""

    @cached_property
    def _ages_at_scans(self) -> list[TableAge]:
        """The ages that are named as at a scan."""
        return [
            age
            for age in self._ages
            if age.column.kind == "scan" and not is_missing(age.text)
        ]

    @cached_property
    def ids(self) -> dict[str, str]:
        """The last row of each subject, for messages."""
        return {subject: rows[-1].place for subject, rows in self._by_subject.items()}

    def sessions_of(self, subject: str) -> list[str]:
        """Return the sessions of a subject that any row names."""
        sessions: dict[str, None] = {}
        for row in self._by_subject.get(subject, ()):
            if row.session is not None:
                sessions[row.session] = None
        return list(sessions)

    @cached_property
    def _ages(self) -> list[TableAge]:
        ages: list[TableAge] = []
        for table in self.tables:
            for row in table.rows:
                ages += row.ages
        return ages

    @cached_property
    def _by_subject(self) -> dict[str, list[Row]]:
        rows: dict[str, list[Row]] = {}
        for table in self.tables:
            for row in table.rows:
                rows.setdefault(row.subject, []).append(row)
        return rows

    def facts(
        self,
        subject: str,
        session: str | None,
        is_only_scan: bool = True,
        place: Path | None = None,
    ) -> ScanAge | None:
        """Return a scan's age and values in the tables for a file, or None if they have
        no row of its subject.

        A row without a session is of a subject's only scan.
        """
        own = [
            row for row in self._by_subject.get(subject, ()) if row._applies_to(place)
        ]
        unread = []
        for table in self.tables:
            if table.problem and table._may_have(subject, place):
                unread.append(table)
        if not own and not unread:
            return None
        with_session = [row for row in own if row.session is not None]
        sessions = list(dict.fromkeys(row.session for row in with_session))
        if session is None and len(sessions) == 1 and is_only_scan:
            (session,) = sessions
        elif session is None and sessions:
            rows = ", ".join(f"{row.place} ({row.session})" for row in with_session)
            cause = (
                f"its name has no session; found {rows}; expected ses-… in the name, as"
                " in session_id"
            )
            return ScanAge(None, cause=cause)
        is_only_scan &= len({*sessions, session} - {None}) < 2
        ages: list[TableAge] = []
        values: dict[str, str] = {}
        for label in dict.fromkeys((None, session)):
            rows_of_scan = [row for row in own if row.session == label]
            difference = _difference(rows_of_scan)
            if difference:
                return ScanAge(None, cause=difference)
            is_shared = label != session and not is_only_scan
            for row in rows_of_scan:
                values |= row.values
                ages += [replace(age, is_shared=is_shared) for age in row.ages]
        age = choose_age(ages, self.notation, self._ages_at_scans[:1])
        # a table that cannot be read may have the age of exactly this scan
        is_certain = age.week is not None and any(age.has_session for age in ages)
        for table in unread:
            if table.subject or not is_certain:
                return ScanAge(None, cause=table.problem)
        if age.week is None and not age.cause:
            cause = _missing_age(with_session, ages, session)
            if not cause:
                table = next(
                    table for table in self.tables if table.path == own[0].path
                )
                cause = f"{table.path}: {table.age_problem}"
            return ScanAge(None, cause=cause)
        further = {key: text for key, text in values.items() if key not in age.columns}
        return replace(age, values=further)


def ambiguity_of(texts: Iterable[str]) -> str:
    """Return the problem that all of several ages may be either decimals or weeks and
    days, or ""."""
    if examples := may_be_days(texts):
        choice = (
            "--decimal-weeks or --weeks-days (in a configuration, participants.ages:"
            " decimal or days)"
        )
        return (
            f"ages such as {', '.join(examples)} may be decimals, or weeks and days;"
            f" choose {choice}"
        )
    return ""


def _missing_age(
    with_session: Sequence[Row], ages: Sequence[TableAge], session: str | None
) -> str:
    """Return why none of the ages in tables is that of a scan; "" if there are none."""
    sessions = {row.session for row in with_session}
    if session is not None and sessions and session not in sessions:
        found = ", ".join(f"{row.session} ({row.place})" for row in with_session)
        return f"no row of its session; found {found}; expected {session}"
    for age in ages:
        if is_missing(age.text):
            continue
        expected = "a row for each, with session_id"
        if session is not None:
            expected = f"a row with session_id {session}"
        return (
            f"one age is given for several sessions; found {age.column.name}"
            f" {age.text} ({age.place}); expected {expected}"
        )
    if not ages:
        return ""
    first = ages[0]
    return f"{first.column.name}: found n/a; expected {EXPECTED_AGE} ({first.place})"


# brains of a configuration

PATHS = (
    "labels",
    "image",
    "pial",
    "white",
    "hemispheres.left",
    "hemispheres.right",
    "hemisphere.file",
)
"""Columns that are keys of brains with paths, inner keys with dots."""
BRAIN_KEYS = (
    *PATHS,
    "population",
    "subject",
    "scheme",
    "affine_from",
    "coordinates",
    "hemisphere.side",
)
"""All columns that are keys of brains, except ids and age."""
FILES, SIDE = "files", "side"
"""Columns of files of any source, and of their hemisphere."""
KNOWN_COLUMNS = (
    *IDS,
    *SESSIONS,
    "gestational_age",
    "scan_age",
    "week",
    "age",
    FILES,
    SIDE,
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
            left_out[entry["id"]] = {"week": entry["week"], "cause": cause}
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
    if all(each.age_problem for each in tables.tables):
        raise InputError(table.age_problem, path=table.path)
    if tables.ambiguity:
        raise InputError(tables.ambiguity, path=table.path)
    names = [row.name for row in table.rows]
    for first, second in merged_names(names, lambda name: name.removeprefix("sub-")):
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
        if SUBJECT_FOLDER.match(name):
            files.append(f"{name}/{name}_sessions.tsv")
    for file in files:
        if os.path.lexists(folder / file):
            yield folder / file


def _difference(rows: Iterable[Row]) -> str:
    """Return how several rows of one scan in a table differ, or ""."""
    first_rows: dict[Path, Row] = {}
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
    further = {}
    for key, text in values.items():
        if key not in (FILES, SIDE, *BRAIN_KEYS) and not is_missing(text):
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
        side = values.get(SIDE)
        limit, expected = 2, "at most a left and a right hemisphere"
        if side is not None:
            limit, expected = 1, "the file of this side"
        if len(files) > limit:
            found = f"{len(files)}, {'; '.join(files)}"
            return {}, f"files: found {found}; expected {expected}"
        values |= _file_keys(files, side)
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


def _file_keys(files: list[str], side: str | None) -> dict[str, str]:
    first = files[0]
    if side is not None:
        return {"hemisphere.file": first, "hemisphere.side": side}
    if len(files) == 2:
        return {
            "hemispheres.left": first,
            "hemispheres.right": files[1],
        }
    key = "labels" if is_volume(first) else "pial"
    return {key: first}
