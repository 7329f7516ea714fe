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
"""The one name of the column with the gestational age that is the mother's, or that after birth, in many tables."""
SURE_AGES = ("gestational_age", "week")
"""Names of that column which are believed whatever others are there."""
IN_WEEKS = (
    *(*SURE_AGES, "ga", "ga_weeks", "gestational_weeks", "gestational_age_weeks", "scan_age", "weeks", "age_at_scan"),
    AGE,
)
IN_DAYS = ("gestational_age_days", "gestational_days", "ga_days", "scan_age_days", "age_days")
AGES = (*IN_WEEKS, *IN_DAYS)
"""All names of that column, in small letters or capitals."""
NOTHING = frozenset(("", "n/a"))
"""What stands for no value in BIDS."""
SUBJECT = re.compile(r"sub-[A-Za-z0-9]{1,100}")
DAYS = "days"
UNITS = {
    **dict.fromkeys(("w", "wk", "wks", "week", "weeks", "gw"), "weeks"),
    **dict.fromkeys(("d", "day", "days"), DAYS),
}
"""The units of a gestational age, by how sidecars call them."""
GESTATIONAL = re.compile(r"gestation|post[- ]?menstrual", re.IGNORECASE)
OF_BIRTH = re.compile(r"birth|deliver|born", re.IGNORECASE)
WEEKS_AND_DAYS = re.compile(r"(\d{2})\s*(?:\+|w(?:(?:ee)?ks?)?\s*\+?)\s*([0-6])\s*(?:/\s*7|d(?:ays?)?)?", re.IGNORECASE)
NUMBER = re.compile(r"(\d+(?:\.\d*)?)\s*(?:(w(?:(?:ee)?ks?)?)|(d(?:ays?)?))?", re.IGNORECASE)


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


def read_scans(path: Path, further: Mapping[str, str] | None = None, ids: Sequence[str] = IDS) -> list[Scan]:
    """Returns the scans of a participants.tsv, and of the sessions.tsv beside it or in its participants' folders.

    A participant with sessions has a scan for each, whose id is `sub-01_ses-1`. `further` are values for all rows, in
    which `{id}`, `{subject}` and `{session}` are the row's. InputError where a table cannot be read, has no column of
    ids or gestational ages, or several that may be the age.
    """
    rows = [dict(further or {}) | row for row in read_tab_separated(path)]
    id_column = _required(path, list(rows[0]), ids, "ids")
    sessions = _sessions(path.parent, [row[id_column] for row in rows])
    # no age is needed here of those who have sessions
    whole = [] if all(row[id_column] in sessions for row in rows) else [_Ages(path, rows)]
    scans = []
    for row in rows:
        name = row[id_column]
        for table, session in sessions.get(name) or [(table, row) for table in whole]:
            # a session's own values stand for the participant's
            values = row | session
            label = values.get(SESSION, "n/a")
            known = label not in NOTHING
            label = label if label.startswith("ses-") or not known else f"ses-{label}"
            own_id = f"{name}_{label}" if known else name
            for key, text in (further or {}).items():
                if values[key] == text:
                    filled = text.replace("{id}", own_id).replace("{subject}", name)
                    values[key] = filled.replace("{session}", label)
            week, cause = table.week(session.get(table.column))
            subject, own_session = (name, label) if known else (None, None)
            scans.append(Scan(own_id, subject, own_session, week, cause, values, table.column))
    return scans


def _sessions(folder: Path, participants: Sequence[str]) -> dict[str, list[tuple["_Ages", dict[str, str]]]]:
    """Returns the sessions of participants that tables of their own are of, each with the ages of its table.

    Sessions of one table for all are told apart by its column of ids.
    """
    found: dict[str, list[tuple[_Ages, dict[str, str]]]] = {}
    whole = folder / "sessions.tsv"
    if whole.is_file():
        rows = read_tab_separated(whole)
        column, ages = _required(whole, list(rows[0]), IDS, "ids"), _Ages(whole, rows)
        for row in rows:
            found.setdefault(row[column], []).append((ages, row))
    for name in participants:
        path = folder / name / f"{name}_sessions.tsv"
        # any other name leads elsewhere; without a column of ages the table says nothing that is asked here
        if SUBJECT.fullmatch(name) and path.is_file() and (aged := _Ages.of_sessions(path)):
            found[name] = [(aged, row) for row in aged.rows]
    return found


class _Ages:
    """The column of a table that has the gestational age, and how it is written there."""

    def __init__(self, path: Path, rows: Sequence[dict[str, str]]) -> None:
        self.path, self.rows = path, list(rows)
        self.said = _sidecar(path)
        self.column = self._find()

    @classmethod
    def of_sessions(cls, path: Path) -> "_Ages | None":
        """Returns the ages of a table of sessions; None where it has none."""
        rows = read_tab_separated(path)
        _required(path, list(rows[0]), (SESSION,), "sessions")
        aged = any(name.lower() in AGES or _describes_age(_sidecar(path).get(name)) for name in rows[0])
        return cls(path, rows) if aged else None

    def week(self, text: str | None) -> tuple[float | None, str]:
        """Returns the gestational age in weeks and what is wrong with it, empty where nothing is."""
        first, last = WEEKS
        whole = WEEKS_AND_DAYS.fullmatch(text or "")
        number = NUMBER.fullmatch(text or "")
        if whole:
            week = int(whole[1]) + int(whole[2]) / 7
        elif number:
            days = number[3] or (not number[2] and self._unit(self.column) == DAYS)
            week = float(number[1]) / (7 if days else 1)
        else:
            expected = "the gestational age in weeks, such as 24.3, 24+2 or 24w2d"
            return None, f"{self.column}: found {text or 'n/a'}; expected {expected}"
        if not first <= week <= last:
            remedy = 'not days or years; for days, "Units": "days" in the sidecar'
            return None, f"{self.column}: found {text}; expected gestational weeks, {first:g} to {last:g} ({remedy})"
        # names of files have two decimals of a week
        return round(week, 2), ""

    def _unit(self, column: str) -> str | None:
        """Returns the unit of a column by its sidecar or its name; None where the sidecar has one of no such age."""
        unit = str((self.said.get(column) or {}).get("Units", "")).strip().lower()
        return UNITS.get(unit) if unit else DAYS if column.lower() in IN_DAYS else "weeks"

    def _find(self) -> str:
        """Returns the name of the column; InputError where none is, or several that do not say the same."""
        columns = list(self.rows[0])
        described = [name for name in columns if _describes_age(self.said.get(name))]
        named = [name for name in SURE_AGES if name in columns][:1] or [
            column for name in AGES for column in columns if column.lower() == name
        ]
        found = [name for name in described or named if self._unit(name)]
        if not found:
            other = f"; {' and '.join(named)} in other units, as the sidecar says" if named else ""
            raise InputError(
                "has no column of gestational ages", path=self.path, found=", ".join(columns) + other,
                expected=f"{' or '.join(AGES)}, or one that its sidecar (.json) describes as gestational age",
            )  # fmt: skip
        weeks = {}
        for self.column in found:
            weeks[self.column] = [self.week(row[self.column])[0] for row in self.rows]
        remedy = f"Call that of the gestational age in weeks {SURE_AGES[0]}; it is taken whatever others are there."
        if any(other != weeks[found[0]] for other in weeks.values()):
            raise InputError(
                "has several columns that may be the gestational age, which differ", path=self.path,
                found=" and ".join(found), expected="one of them", remedy=remedy,
            )  # fmt: skip
        ages = [row[found[0]] for row in self.rows if row[found[0]] not in NOTHING]
        if found[0].lower() == AGE and found[0] not in self.said and ages and all(age.isdecimal() for age in ages):
            raise InputError(
                f"has a column {found[0]} that may be the gestational age in weeks or the mother's in years",
                path=self.path,
                found=", ".join(list(dict.fromkeys(ages))[:5]),
                remedy=f'Call it {SURE_AGES[0]}, or say in {self.path.with_suffix(".json").name} {{"{found[0]}": '
                '{"Description": "gestational age", "Units": "weeks"}}.',
            )
        return found[0]


def _sidecar(path: Path) -> dict[str, Any]:
    """Returns what the sidecar of a table says of its columns: that beside it, or one for all above its folder."""
    kind = path.stem.rpartition("_")[2]
    places = [path.with_suffix(".json"), *(folder / f"{kind}.json" for folder in path.parents[:2])]
    found: Any = next((read_json(place) for place in places if place.is_file()), {})
    return {name: said for name, said in found.items() if isinstance(said, dict)} if isinstance(found, dict) else {}


def _describes_age(said: Mapping[str, Any] | None) -> bool:
    """Returns whether a sidecar describes a column as the gestational age, in weeks or days."""
    words = " ".join(str((said or {}).get(key, "")) for key in ("LongName", "Description"))
    return (
        bool(GESTATIONAL.search(words))
        and not OF_BIRTH.search(words)
        and str((said or {}).get("Units", "weeks")).strip().lower() in UNITS
    )


def _required(path: Path, columns: Sequence[str], names: Sequence[str], what: str) -> str:
    """Returns the first of some names that a table's columns have; InputError where they have none."""
    by_name = {column.lower(): column for column in columns}
    for name in names:
        if name in by_name:
            return by_name[name]
    raise InputError(f"has no column of {what}", path=path, found=", ".join(columns), expected=" or ".join(names))
