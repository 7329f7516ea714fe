"""Tables of participants and their sessions, as BIDS has them: who was scanned, and at which gestational age."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..io.files import read_json, read_tab_separated
from ..parameters.varying import WEEKS

IDS = ("participant_id", "id")
"""Names of the column with the participants."""
SESSION = "session_id"
AGE = "age"
UNIT_OF_AGE = {
    **dict.fromkeys(("gestational_age", "week", "gestational_age_weeks", "age_weeks"), "weeks"),
    **dict.fromkeys(("gestational_age_days", "age_days"), "days"),
}
"""Names of the column with the gestational age, and their units; `age` needs a unit in the table's sidecar."""
UNITS = ("weeks", "days")
NOTHING = frozenset(("", "n/a"))
"""What stands for no value in BIDS."""
SUBJECT = re.compile(r"sub-[A-Za-z0-9]{1,100}")
WEEKS_AND_DAYS = re.compile(r"(\d{2})(?:\+([0-6])|w([0-6])d)")
NUMBER = re.compile(r"\d+(?:\.\d+)?")


@dataclass(frozen=True)
class Scan:
    """A row of a table of participants, or of one of their sessions.

    The subject is the participant, None where the row is of no session. The week is None where the age cannot be
    used, and the cause says why. Values are the row's texts by column; `age_column` is the one the age was taken from.
    """

    id: str
    subject: str | None
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

    A participant with sessions has a scan for each, whose id is `sub-01_ses-1`. `further` are values for all rows, in
    which `{id}`, `{subject}` and `{session}` are the row's. InputError where a table cannot be read, or has no column
    of ids or gestational ages.
    """
    table = _read(path)
    ids = next((name for name in IDS if name in table.rows[0]), None)
    if ids is None:
        raise _lacks(table, "ids", IDS)
    scans = []
    for row in table.rows:
        name, place = row[ids], path.parent / row[ids]
        file = place / f"{name}_sessions.tsv"
        # any other name leads elsewhere
        sessions = _read(file) if SUBJECT.fullmatch(name) and file.is_file() else None
        # sessions without ages say nothing that is asked here
        own = sessions if sessions is not None and sessions.column else table
        if not own.column:
            raise _lacks(own, "gestational ages", (*UNIT_OF_AGE, f"{AGE} with Units in {path.stem}.json"))
        for session in own.rows if own is sessions else [row]:
            scans.append(_scan(name, dict(further or {}) | row | session, own, further or {}))
    return scans


def _scan(name: str, values: dict[str, str], table: _Table, further: Mapping[str, str]) -> Scan:
    label = values.get(SESSION, "n/a")
    session = None if label in NOTHING else label if label.startswith("ses-") else f"ses-{label}"
    own_id = f"{name}_{session}" if session else name
    for key, text in further.items():
        if values[key] == text:
            values[key] = text.replace("{id}", own_id).replace("{subject}", name).replace("{session}", session or label)
    week, cause = read_week(values.get(table.column, ""), table.unit)
    cause = cause and f"{table.column}: {cause}"
    return Scan(own_id, name if session else None, session, week, cause, values, table.column)


def read_week(text: str, unit: str = "weeks") -> tuple[float | None, str]:
    """Return a gestational age in weeks, to the two decimals of file names, and what is wrong with it."""
    if whole := WEEKS_AND_DAYS.fullmatch(text):
        week = int(whole[1]) + int(whole[2] or whole[3]) / 7
    elif NUMBER.fullmatch(text):
        week = float(text) / (7 if unit == "days" else 1)
    else:
        return None, f"found {text or 'n/a'}; expected the gestational age in weeks, such as 24.3, 24+2 or 24w2d"
    if not WEEKS[0] <= week <= WEEKS[1]:
        return None, f"found {text}; expected gestational weeks, {WEEKS[0]:g} to {WEEKS[1]:g}"
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
    found, expected = ", ".join(table.rows[0]), " or ".join(names)
    return InputError(f"has no column of {what}", path=table.path, found=found, expected=expected)
