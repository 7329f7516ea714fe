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
    *(
        "session_id",
        "session",
        "ses",
        "ses_id",
        "session_label",
        "session_number",
        "visit",
        "visit_id",
    ),
    *("visit_number", "timepoint", "time_point", "tp", "wave"),
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
    """A row of a table: its place for messages, subject and session without `sub-` and
    `ses-`, and texts by column."""

    place: str
    name: str
    session: str | None
    values: Mapping[str, str]

    @property
    def subject(self) -> str:
        return self.name.removeprefix("sub-")


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

    def ages_in(self, row: Row) -> Iterator[TableAge]:
        """Yield the ages in one of its rows."""
        kinds, units = (
            [
                row.values[name]
                for name in self.columns
                if column_key(name) in names and name in row.values
            ]
            for names in (AGE_TYPES, AGE_UNITS)
        )
        for column in self.ages:
            if kinds and OTHER_TYPE.search(kinds[0]):
                problem = f"is not a gestational age: its type (age_type) is {kinds[0]}"
                column = replace(column, problem=problem, is_other=True)
            elif units and column_key(column.name) == "age":
                unit = unit_of(units[0])
                problem = (
                    "" if unit else f"found the unit {units[0]}; expected weeks or days"
                )
                column = replace(column, unit=unit or "weeks", problem=problem)
            yield TableAge(
                row.place, column, row.values[column.name], row.session is not None
            )

    @property
    def age_problem(self) -> str:
        """The reason why none of its columns gives ages, or ""."""
        if not self.ages:
            expected = f"{EXPECTED_COLUMNS} {self.path.stem}.json"
            return (
                f"has no column of gestational ages; found {', '.join(self.columns)};"
                f" expected {expected}"
            )
        problems = [
            f"{column.name}: {column.problem}" for column in self.ages if column.problem
        ]
        columns = (
            f"found the columns {', '.join(self.columns)}; instead, name the age"
            " gestational_age or scan_age"
        )
        return f"{problems[0]}; {columns}" if len(problems) == len(self.ages) else ""


def read_table_of_scans(path: Path) -> Table:
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
        expected = " or ".join(IDS)
        raise InputError(
            "has no column of ids",
            path=path,
            found=", ".join(columns),
            expected=expected,
        )
    session = next((names[key] for key in SESSIONS if key in names), None)
    common = path.stem.rpartition("_")[2].lower() + ".json"
    folders = [
        folder for folder in path.parents[:3] if folder.is_relative_to(empty.scope)
    ]
    beside = (
        file for folder in folders for file in sorted(folder.glob("*.[jJ][sS][oO][nN]"))
    )
    sidecar: Any = next(
        (
            read_json(file)
            for file in beside
            if file.name.lower() in (f"{path.stem.lower()}.json", common)
        ),
        {},
    )
    ages = age_columns(columns, sidecar, f"{path.stem}.json")
    name_parts = TABLE_NAME.fullmatch(path.name)
    is_of_scans = bool(name_parts and name_parts[3])
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
        label = (
            values[session]
            if session is not None
            else (name_parts and name_parts[2]) or ""
        )
        own_session = None if is_missing(label) else label.removeprefix("ses-")
        further = {
            key: text for key, text in values.items() if key not in (ids, session)
        }
        if is_of_scans:
            # other columns are those of files
            further = {column.name: values[column.name] for column in ages}
        rows.append(Row(f"{path.name} row {number}", name, own_session, further))
    return replace(empty, rows=rows, columns=columns, ages=ages)


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
                self.tables.append(read_table_of_scans(path))
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
    def ages_at_scans(self) -> list[TableAge]:
        """The ages that are named as at a scan."""
        return [
            age
            for age in self._ages
            if age.column.kind == "scan" and not is_missing(age.text)
        ]

    @cached_property
    def ids(self) -> dict[str, str]:
        """The last row of each subject, for messages."""
        return {
            subject: rows[-1][1].place for subject, rows in self._by_subject.items()
        }

    @cached_property
    def _ages(self) -> list[TableAge]:
        return [
            age
            for table in self.tables
            for row in table.rows
            for age in table.ages_in(row)
        ]

    @cached_property
    def _by_subject(self) -> dict[str, list[tuple[Table, Row]]]:
        rows: dict[str, list[tuple[Table, Row]]] = {}
        for table in self.tables:
            for row in table.rows:
                rows.setdefault(row.subject, []).append((table, row))
        return rows

    def rows_of(
        self, subject: str, place: Path | None = None
    ) -> list[tuple[Table, Row]]:
        """Return the rows of a subject, with their tables, in the tables that apply to
        a file (default: in all)."""
        return [
            (table, row)
            for table, row in self._by_subject.get(subject, ())
            if _applies(table, place)
        ]

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
        own = self.rows_of(subject, place)
        unread = [
            table
            for table in self.tables
            if table.problem and table.subject in (None, subject)
        ]
        unread = [table for table in unread if _applies(table, place)]
        if not own and not unread:
            return None
        sessions = list(
            dict.fromkeys(row.session for _, row in own if row.session is not None)
        )
        if session is None and len(sessions) == 1 and is_only_scan:
            (session,) = sessions
        elif session is None and sessions:
            rows = ", ".join(
                f"{row.place} ({row.session})"
                for _, row in own
                if row.session is not None
            )
            cause = (
                f"its name has no session; found {rows}; expected ses-… in the name, as"
                " in session_id"
            )
            return ScanAge(None, cause=cause)
        is_only_scan &= len({*sessions, session} - {None}) < 2
        ages: list[TableAge] = []
        values: dict[str, str] = {}
        for label in dict.fromkeys((None, session)):
            rows_of_scan = [(table, row) for table, row in own if row.session == label]
            for table in self.tables:
                if difference := _difference(
                    [row for owner, row in rows_of_scan if owner is table]
                ):
                    return ScanAge(None, cause=difference)
            is_shared = label != session and not is_only_scan
            ages += [
                replace(age, is_shared=is_shared)
                for table, row in rows_of_scan
                for age in table.ages_in(row)
            ]
            values |= {
                key: text for _, row in rows_of_scan for key, text in row.values.items()
            }
        age = choose_age(ages, self.notation, self.ages_at_scans[:1])
        # a table that cannot be read may have the age of exactly this scan
        is_certain = age.week is not None and any(age.has_session for age in ages)
        if unread := [table for table in unread if table.subject or not is_certain]:
            return ScanAge(None, cause=unread[0].problem)
        if age.week is None and not age.cause:
            return ScanAge(None, cause=_missing_age(own, ages, session, sessions))
        return replace(
            age,
            values={
                key: text for key, text in values.items() if key not in age.columns
            },
        )


def _applies(table: Table, place: Path | None) -> bool:
    return place is None or place.is_relative_to(table.scope)


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
    own: Sequence[tuple[Table, Row]],
    ages: Sequence[TableAge],
    session: str | None,
    sessions: Sequence[str],
) -> str:
    if session is not None and sessions and session not in sessions:
        found = ", ".join(
            f"{row.session} ({row.place})" for _, row in own if row.session is not None
        )
        return f"no row of its session; found {found}; expected {session}"
    for age in (age for age in ages if not is_missing(age.text)):
        found = f"{age.column.name} {age.text} ({age.place})"
        expected = (
            f"a row with session_id {session}"
            if session is not None
            else "a row for each, with session_id"
        )
        return (
            f"one age is given for several sessions; found {found}; expected {expected}"
        )
    if ages:
        return (
            f"{ages[0].column.name}: found n/a; expected {EXPECTED_AGE}"
            f" ({ages[0].place})"
        )
    return f"{own[0][0].path}: {own[0][0].age_problem}"


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
    table = read_table_of_scans(path)
    for column in table.columns:
        near = difflib.get_close_matches(
            column, KNOWN_COLUMNS, n=1, cutoff=MIN_SIMILARITY
        )
        if (
            near
            and column_key(column) not in KNOWN_COLUMNS
            and column not in {age.name for age in table.ages}
        ):
            raise InputError(
                "has a column whose name seems mistyped",
                path=path,
                found=column,
                expected=near[0],
            )
    tables = ScanTables([path, *_session_tables(table)], settings.ages)
    if all(each.age_problem for each in tables.tables):
        raise InputError(table.age_problem, path=path)
    if tables.ambiguity:
        raise InputError(tables.ambiguity, path=path)
    for first, second in merged_names(
        (row.name for row in table.rows), lambda name: name.removeprefix("sub-")
    ):
        expected = "one of them, since sub- is not part of the label"
        raise InputError(
            "has two names of one participant",
            path=path,
            found=f"{first} and {second}",
            expected=expected,
        )
    entries: list[dict[str, Any]] = []
    left_out: dict[str, dict[str, Any]] = {}
    sources: dict[str, str] = {}
    for name in dict.fromkeys(row.name for row in table.rows):
        subject = name.removeprefix("sub-")
        sessions = dict.fromkeys(
            row.session for _, row in tables.rows_of(subject) if row.session is not None
        )
        for session in sessions or [None]:
            scan = name if session is None else f"{name}_ses-{session}"
            facts = tables.facts(subject, session, len(sessions) < 2)
            assert facts is not None
            entry, problem = _entry(
                scan, name, session, facts, settings.columns, path.parent
            )
            if problem := facts.cause or problem:
                left_out[scan] = {
                    "week": facts.week,
                    "cause": f"{path}: {scan}: {problem}",
                }
            else:
                entries.append(entry)
                sources[scan] = facts.source
    by_files: dict[str, list[dict[str, Any]]] = {}
    for entry in entries:
        by_files.setdefault(
            repr([entry["subject"], *(entry.get(key) for key in SOURCES)]), []
        ).append(entry)
    for same in (group for group in by_files.values() if len(group) > 1):
        found = " and ".join(entry["id"] for entry in same)
        for entry in same:
            cause = (
                f"{path}: {entry['id']}: {found} have the same files; expected files of"
                " each session"
            )
            left_out[entry["id"]] = {"week": entry["week"], "cause": cause}
    entries = [entry for entry in entries if entry["id"] not in left_out]
    return entries, left_out, sources


def _session_tables(table: Table) -> Iterator[Path]:
    folder = table.path.parent
    names = (
        f"{name}/{name}_sessions.tsv"
        for name in dict.fromkeys(row.name for row in table.rows)
    )
    # other names could be paths out of the folder
    for name in (
        "sessions.tsv",
        *(name for name in names if SUBJECT_FOLDER.match(name)),
    ):
        if os.path.lexists(folder / name):
            yield folder / name


def _difference(rows: Sequence[Row]) -> str:
    """Return how several rows of one scan differ, or ""."""
    for row in rows[1:]:
        for column, text in row.values.items():
            if text != rows[0].values[column]:
                values = (
                    f"{column} {rows[0].values[column]} ({rows[0].place}) and {text}"
                    f" ({row.place})"
                )
                return (
                    f"several rows have this id; found {values}; expected one row for"
                    " each scan, with its session_id"
                )
    return ""


def covariates(values: Mapping[str, str]) -> dict[str, dict[str, str]]:
    """Return the key `covariates` of a scan's brain: the values of its tables without
    another meaning."""
    keys = {FILES, SIDE, *BRAIN_KEYS}
    further = {
        key: text
        for key, text in values.items()
        if key not in keys and not is_missing(text)
    }
    return {"covariates": further} if further else {}


def _entry(
    scan: str,
    name: str,
    session: str | None,
    facts: ScanAge,
    columns: Mapping[str, str],
    folder: Path,
) -> tuple[dict[str, Any], str]:
    names = {
        "id": scan,
        "subject": name,
        "session": f"ses-{session}" if session else "n/a",
    }
    added = {
        key: re.sub(r"\{(id|subject|session)\}", lambda match: names[match[1]], text)
        for key, text in columns.items()
    }
    # after the table's columns, and without replacing them
    texts = {**facts.values, **added, **facts.values}
    values = {key: text for key, text in texts.items() if not is_missing(text)}
    entry: dict[str, Any] = {
        "id": scan,
        "week": facts.week,
        "subject": name,
        **covariates(values),
    }
    if FILES in values:
        files, side = (
            [part.strip() for part in values[FILES].split(";")],
            values.get(SIDE),
        )
        limit, expected = (
            (2, "at most a left and a right hemisphere")
            if side is None
            else (1, "the file of this side")
        )
        if len(files) > limit:
            return (
                {},
                f"files: found {len(files)}, {'; '.join(files)}; expected {expected}",
            )
        values |= _file_keys(files, side)
    for column in values:
        if column not in BRAIN_KEYS:
            continue
        value: Any = values[column]
        if column in PATHS:
            parts = value.split(";") if column == "white" else [value]
            places = [own_name(path_in(folder, part.strip())) for part in parts]
            if lost := [place for place in places if not place.is_file()]:
                missing = (
                    absent_content(lost[0])
                    or f"no such file{hint_for_missing(lost[0])}"
                )
                return {}, f"{column}: {lost[0]}: {missing}"
            value = str(places[0]) if len(places) == 1 else list(map(str, places))
        *outer, last = column.split(".")
        section = entry
        for key in outer:
            section = section.setdefault(key, {})
        section[last] = value
    return entry, (
        ""
        if set(SOURCES) & set(entry)
        else f"found no data; expected files, or one of {', '.join(PATHS)}"
    )


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
