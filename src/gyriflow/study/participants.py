"""Tables of participants and their sessions in the format of BIDS."""

import difflib
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..formats import is_volume
from ..io.files import read_json, read_tab_separated
from ..settings.base import located, path_in
from ..settings.brains import SOURCES
from ..settings.participants import ParticipantsSettings
from ..settings.varying import WEEK_RANGE

IDS = ("participant_id", "id")
"""Possible names of the column of participants."""
SESSION = "session_id"
AGE = "age"
UNIT_OF_AGE = {
    **dict.fromkeys(("gestational_age", "week", "gestational_age_weeks", "age_weeks"), "weeks"),
    **dict.fromkeys(("gestational_age_days", "age_days"), "days"),
}
"""Possible names of the column of gestational age, and units; `age` needs a unit in the table's sidecar."""
UNITS = ("weeks", "days")
MISSING_VALUES = frozenset(("", "n/a"))
"""Missing values in BIDS."""
SUBJECT_NAME = re.compile(r"sub-[A-Za-z0-9]{1,100}")
WEEKS_AND_DAYS = re.compile(r"(\d{2})(?:\+([0-6])|w([0-6])d)")
NUMBER = re.compile(r"\d+(?:\.\d+)?")


@dataclass(frozen=True)
class Scan:
    """A row of a table of participants, or of one of their sessions.

    The subject is the participant; the session is None if the row has none. The week is None if the age cannot be used;
    `cause` gives the reason. Values are the row's texts by column; the age was read from the column `age_column`.
    """

    id: str
    subject: str
    session: str | None
    week: float | None
    cause: str
    values: Mapping[str, str]
    age_column: str


@dataclass(frozen=True)
class _Table:
    path: Path
    rows: list[dict[str, str]]
    column: str
    unit: str


def read_scans(path: Path, further: Mapping[str, str] | None = None) -> list[Scan]:
    """Return the scans of a participants.tsv, and of its participants' sessions, `sub-01/sub-01_sessions.tsv`.

    A participant with sessions has a scan for each, whose id is `sub-01_ses-1`. `further` are values for all rows;
    `{id}`, `{subject}` and `{session}` in them are replaced by the row's. InputError if a table cannot be read, or has
    no column of ids or gestational ages.
    """
    table = _read(path)
    ids = next((name for name in IDS if name in table.rows[0]), None)
    if ids is None:
        raise _lacks(table, "ids", IDS)
    scans = []
    for row in table.rows:
        name, place = row[ids], path.parent / row[ids]
        file = place / f"{name}_sessions.tsv"
        # other names could be paths out of the folder
        sessions = _read(file) if SUBJECT_NAME.fullmatch(name) and file.is_file() else None
        # a table of sessions without ages does not help
        ages = sessions if sessions is not None and sessions.column else table
        if not ages.column:
            raise _lacks(ages, "gestational ages", (*UNIT_OF_AGE, f"{AGE} with Units in {path.stem}.json"))
        for session in ages.rows if ages is sessions else [row]:
            scans.append(_scan(name, dict(further or {}) | row | session, ages, further or {}))
    return scans


def _scan(name: str, values: dict[str, str], table: _Table, further: Mapping[str, str]) -> Scan:
    label = values.get(SESSION, "n/a")
    session = None if label in MISSING_VALUES else label if label.startswith("ses-") else f"ses-{label}"
    own_id = f"{name}_{session}" if session else name
    for key, text in further.items():
        if values[key] == text:
            values[key] = text.replace("{id}", own_id).replace("{subject}", name).replace("{session}", session or label)
    week, cause = read_week(values.get(table.column, ""), table.unit)
    cause = cause and f"{table.column}: {cause}"
    return Scan(own_id, name, session, week, cause, values, table.column)


def read_week(text: str, unit: str = "weeks") -> tuple[float | None, str]:
    """Return a gestational age in weeks, rounded to the two decimals of file names, and the problem with it, or ''."""
    if whole := WEEKS_AND_DAYS.fullmatch(text):
        week = int(whole[1]) + int(whole[2] or whole[3]) / 7
    elif NUMBER.fullmatch(text):
        week = float(text) / (7 if unit == "days" else 1)
    else:
        return None, f"found {text or 'n/a'}; expected the gestational age in weeks, such as 24.3, 24+2 or 24w2d"
    if not WEEK_RANGE[0] <= week <= WEEK_RANGE[1]:
        return None, f"found {text}; expected gestational weeks, {WEEK_RANGE[0]:g} to {WEEK_RANGE[1]:g}"
    return round(week, 2), ""


def _read(path: Path) -> _Table:
    rows = read_tab_separated(path)
    units = {name: unit for name, unit in UNIT_OF_AGE.items() if name in rows[0]}
    places = (path.with_suffix(".json"), path.parents[1] / f"{path.stem.rpartition('_')[2]}.json")
    sidecar: Any = next((read_json(place) for place in places if place.is_file()), {})
    for name in (*units, *(name for name in (AGE,) if name in rows[0])):
        described = sidecar.get(name) if isinstance(sidecar, dict) else None
        unit = str(described.get("Units", "")).lower() if isinstance(described, dict) else ""
        if unit in UNITS:
            units[name] = unit
    column = next(iter(units), "")
    return _Table(path, rows, column, units.get(column, ""))


def _lacks(table: _Table, what: str, names: Sequence[str]) -> InputError:
    columns, expected = ", ".join(table.rows[0]), " or ".join(names)
    return InputError(f"has no column of {what}", path=table.path, found=columns, expected=expected)


# brains of a configuration

PATHS = ("labels", "image", "pial", "white", "hemispheres.left", "hemispheres.right", "hemisphere.file")
"""Columns that are keys of brains with paths, inner keys with dots."""
BRAIN_KEYS = (*PATHS, "population", "subject", "scheme", "affine_from", "coordinates", "hemisphere.side")
"""All columns that are keys of brains, except ids and age."""
FILES, SIDE = "files", "side"
"""Columns of files of any source, and of their hemisphere."""
FIELDS = {*IDS, SESSION, *UNIT_OF_AGE, AGE, FILES, SIDE, *BRAIN_KEYS}
MIN_SIMILARITY = 0.85
"""Minimum similarity of an unknown column to a known one to be reported as mistyped."""


def participants_brains(
    settings: ParticipantsSettings, folder: Path
) -> tuple[list[dict[str, Any]], dict[str, dict[str, Any]], list[str]]:
    """Return the entries of `brains` made from a table, the rows that cannot be used by id, and problems.

    Each unusable row has `week`, its age if it is known, and `cause`, the reason. A problem is an unusable row with the
    id of another row. `folder` is the configuration's. InputError if the table cannot be read or lacks a column that
    every row needs.
    """
    path = located(folder, settings.file)
    scans = read_scans(path, settings.columns)
    for column in scans[0].values:
        if column not in FIELDS and (near := difflib.get_close_matches(column, FIELDS, n=1, cutoff=MIN_SIMILARITY)):
            raise InputError("has a column whose name seems mistyped", path=path, found=column, expected=near[0])
    counts = Counter(scan.id for scan in scans)
    entries: list[dict[str, Any]] = []
    left_out: dict[str, dict[str, Any]] = {}
    problems: list[str] = []
    for scan in scans:
        entry, problem = _entry(scan, path.parent)
        text = f"{path}: {scan.id}: {scan.cause or problem}"
        if not (scan.cause or problem):
            entries.append(entry)
        elif counts[scan.id] > 1 and scan.id not in MISSING_VALUES:
            problems.append(f"{text} ({counts[scan.id]} rows have this id; ids must be unique)")
        else:
            left_out[scan.id] = {"week": scan.week, "cause": text}
    return entries, left_out, problems


def covariates(scan: Scan) -> dict[str, dict[str, str]]:
    """Return the key `covariates` of a scan's brain: the columns of its table without another meaning."""
    keys = {*IDS, SESSION, FILES, SIDE, *BRAIN_KEYS, scan.age_column}
    values = {key: value for key, value in scan.values.items() if key not in keys and value not in MISSING_VALUES}
    return {"covariates": values} if values else {}


def _entry(scan: Scan, folder: Path) -> tuple[dict[str, Any], str]:
    values = {key: value for key, value in scan.values.items() if value not in MISSING_VALUES}
    entry: dict[str, Any] = {"id": scan.id, "week": scan.week, "subject": scan.subject} | covariates(scan)
    if FILES in values:
        files, side = [part.strip() for part in values[FILES].split(";")], values.get(SIDE)
        most, expected = (2, "at most a left and a right hemisphere") if side is None else (1, "the file of this side")
        if len(files) > most:
            return {}, f"files: found {len(files)}, {'; '.join(files)}; expected {expected}"
        values |= _file_keys(files, side)
    for column in values:
        if column not in BRAIN_KEYS:
            continue
        value: Any = values[column]
        if column in PATHS:
            parts = value.split(";") if column == "white" else [value]
            places = [path_in(folder, part.strip()).resolve() for part in parts]
            if lost := [place for place in places if not place.is_file()]:
                return {}, f"{column}: no such file: {lost[0]}"
            value = str(places[0]) if len(places) == 1 else list(map(str, places))
        *outer, last = column.split(".")
        section = entry
        for key in outer:
            section = section.setdefault(key, {})
        section[last] = value
    return entry, "" if set(SOURCES) & set(entry) else f"found no data; expected files, or one of {', '.join(PATHS)}"


def _file_keys(files: list[str], side: str | None) -> dict[str, str]:
    if side is not None:
        return {"hemisphere.file": files[0], "hemisphere.side": side}
    if len(files) == 2:
        return {"hemispheres.left": files[0], "hemispheres.right": files[1]}
    return {"labels" if is_volume(files[0]) else "pial": files[0]}
