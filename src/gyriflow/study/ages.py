"""Gestational ages of scans: the columns that give them, and ages in names of files."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from ..errors import InputError
from ..settings.weeks import TENTHS, WeekNotation, read_week

MISSING_VALUES = frozenset(("", "n/a", "na", "nan", "none", "null", "-"))
"""Missing values, in lower case: those of BIDS and of R and Python."""
AT_SCAN = frozenset(
    (
        "scan_age",
        "scan_ga",
        "age_at_scan",
        "ga_at_scan",
        "gestational_age_at_scan",
        "age_at_mri",
        "pma",
        "postmenstrual_age",
    )
)
"""Columns of the age at the scan, without the unit at their end."""
GESTATIONAL = frozenset(
    ("gestational_age", "ga", "gestational", "week", "weeks", "day", "days")
)
"""Columns whose age may be that at the scan or at birth, likewise."""
UNIT_ENDING = re.compile(r"(^|_)(weeks?|wks?|days?)$")
UNITS = {
    "week": "weeks",
    "weeks": "weeks",
    "wk": "weeks",
    "wks": "weeks",
    "w": "weeks",
    "gw": "weeks",
    "completed weeks": "weeks",
    "gestational weeks": "weeks",
    "day": "days",
    "days": "days",
    "d": "days",
}
AGE_WORDS = frozenset(
    (
        "age",
        "ga",
        "gw",
        "gest",
        "gestation",
        "gestational",
        "pma",
        "postmenstrual",
        "menstrual",
        "pna",
        "pca",
        "week",
        "weeks",
    )
)
"""Words in names of columns that may be of another age."""
SCAN_WORDS = re.compile(r"scan|mri?(_|$)|imaging|acq|session|visit|exam|menstrual|pma")
"""Further words in those that may be of the age at the scan."""
NOT_AT_SCAN = re.compile(
    r"mother|maternal|father|paternal|parent|at_birth|at_delivery|^birth|^delivery"
)
"""Names of columns whose ages cannot be taken for those at the scan."""
OTHER_AGE = re.compile(
    r"(?<![a-z])(post|neo)[- ]?natal|chronolog|correct|concept|(?<!un)born|birth"
    r"|deliver|mother|maternal|\b(dob|pna|pca|term|months?|years?)\b",
    re.IGNORECASE,
)
"""Words for another age than the gestational one at the scan."""
MIN_AMBIGUOUS_AGES = 3
"""Number of ages in tenths of a week with digits from 0 to 6 that is enough to suspect
days."""
MAX_DIFFERENCE_WEEKS = 0.1
"""Two ages of a scan agree if they differ by rounding."""
WEEK_NAME = re.compile(
    r"(?<![A-Za-z])(?:weeks?|wk|ga|gw)[-_]?(?P<age>\d{2}(?:[.,]\d+|\+[0-6]|w[0-6]d?)?)(?!\d)(?=(?P<more>.*))",
    re.IGNORECASE,
)
AMBIGUOUS_ENDING = re.compile(
    r"(?!_\d+([._]\d+)?(mm|um|T)(?![a-z]))(?:[_+-]?(?:w|d|p|wk)?|\.+|to|and)\d+[dw]?(?![a-z0-9])|[+-]\d",
    re.IGNORECASE,
)
"""Text after the weeks in a name that may be days, a decimal or another week."""


@dataclass(frozen=True)
class AgeColumn:
    """A column of ages with its unit, or the problem in its description.

    Its name may be that of an age at the scan, of a gestational age, or of an `other`
    age.
    """

    name: str
    kind: Literal["scan", "gestational", "other"]
    unit: str
    problem: str


@dataclass(frozen=True)
class TableAge:
    """A cell of a column of ages: its place (table and row), column and text."""

    place: str
    column: AgeColumn
    text: str

    def __str__(self) -> str:
        return f"{self.column.name} {self.text or 'n/a'} ({self.place})"


@dataclass(frozen=True)
class ScanAge:
    """The age of a scan in weeks with its source, or None with the cause.

    `named` is its text if it is from a name. `values` are the other values of the scan
    in tables by column.
    """

    week: float | None
    source: str = ""
    cause: str = ""
    named: str = ""
    values: Mapping[str, str] = field(default_factory=dict)


def column_key(name: str) -> str:
    """Return the name of a column in lower case, with _ between its words."""
    words = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower()
    return re.sub(r"[^a-z0-9]+", "_", words).strip("_")


def is_missing(text: str) -> bool:
    """Return whether a cell has no value."""
    return text.lower() in MISSING_VALUES


def age_column(
    name: str,
    facts: Any,
    sidecar_name: str,
) -> AgeColumn | None:
    """Return a column of ages, or None for other columns; `facts` is its description in
    the table's JSON file."""
    key = column_key(name)
    base = UNIT_ENDING.sub("", key) or key
    unit, problem = _unit(key, facts, sidecar_name)
    if base in AT_SCAN:
        return AgeColumn(name, "scan", unit, problem)
    if base in GESTATIONAL:
        return AgeColumn(name, "gestational", unit, problem)
    if not AGE_WORDS & set(key.split("_")) or NOT_AT_SCAN.search(key):
        return None
    if SCAN_WORDS.search(key):
        problem = "its name is not one for the age at the scan; expected scan_age"
        return AgeColumn(name, "scan", unit, problem)
    return AgeColumn(name, "other", unit, problem)


def _unit(
    key: str,
    facts: Any,
    sidecar_name: str,
) -> tuple[str, str]:
    """Return the unit of a column, and the problem in its description or ""."""
    if not isinstance(facts, dict):
        facts = {"Description": facts}
    ending = UNIT_ENDING.search(key)
    names = [ending[2]] if ending else []
    for field_name, value in facts.items():
        if value and str(field_name).lower() in ("unit", "units"):
            names.append(str(value))
    units = {UNITS.get(name.lower().strip(" .")) for name in names} or {"weeks"}
    unit = units.pop()
    text = " ".join(map(str, facts.values()))
    if units or unit is None:
        problem = f"has the unit {' and '.join(names)}"
    elif OTHER_AGE.search(text):
        problem = f"is described as {text!r}"
    else:
        return unit, ""
    expected = "the gestational age at the scan, in weeks or days"
    return "weeks", f"{problem} in {sidecar_name}; expected {expected}"


def read_ages(ages: Sequence[TableAge], notation: WeekNotation | None) -> ScanAge:
    """Return the age that all cells of a scan give; None, with the cause, if one cannot
    be read or two differ."""
    weeks = []
    for age in ages:
        week, problem = read_week(
            age.text,
            age.column.unit,
            notation,
        )
        problem = age.column.problem or problem
        if week is None or problem:
            return ScanAge(
                None,
                cause=f"{age.column.name}: {problem} ({age.place})",
            )
        weeks.append(week)
    if max(weeks) - min(weeks) > MAX_DIFFERENCE_WEEKS:
        found = " and ".join(map(str, ages))
        cause = (
            f"found two ages, {found}; expected one: in a row for each session_id, and"
            " as scan_age if the other is at birth"
        )
        return ScanAge(None, cause=cause)
    return ScanAge(
        weeks[0],
        f"{ages[0].place}, {ages[0].column.name}",
    )


def require_clear_decimals(
    texts: Iterable[str],
    notation: WeekNotation | None,
    path: Path,
) -> None:
    """Raise InputError if ages such as 24.3 may mean 24 weeks and 3 days.

    They may without a `notation`, if there are at least `MIN_AMBIGUOUS_AGES` decimals,
    all are tenths from 0 to 6, and not all are .0 or .5.
    """
    decimals = [text for text in texts if re.search("[.,]", text)]
    matches = [TENTHS.fullmatch(text) for text in decimals]
    digits = {match[1] for match in matches if match}
    are_halves = digits <= {"0", "5"}
    may_be_days = all(matches) and digits <= set("0123456") and not are_halves
    if notation or len(decimals) < MIN_AMBIGUOUS_AGES or not may_be_days:
        return
    choice = (
        "--decimal-weeks or --weeks-days (in a configuration, participants.ages:"
        " decimal or days)"
    )
    raise InputError(
        f"ages such as {', '.join(decimals[:3])} may be decimals, or weeks and days;"
        f" choose {choice}",
        path=path,
    )


def week_in_name(parts: Sequence[str], notation: WeekNotation | None = None) -> ScanAge:
    """Return the age that the names of a file and its folders give, such as week24,
    GA24.3, week24+3 or GA24w3d."""
    found: dict[str, tuple[float | None, str]] = {}
    unclear = ""
    for part in reversed(parts):
        for match in WEEK_NAME.finditer(part):
            text = match["age"]
            ending = AMBIGUOUS_ENDING.match(match["more"])
            if ending is None:
                found[text] = read_week(text, notation=notation)
            elif not found and not unclear:
                # folders may be of several weeks
                unclear = f"{match[0]}{ending[0]}"
    if unclear:
        cause = (
            f"the name gives an ambiguous age: found {unclear}; expected one such as"
            " week24.4 or week24+3"
        )
        return ScanAge(None, cause=cause)
    if len({week for week, _ in found.values()}) > 1:
        names = " and ".join(found)
        cause = f"the names give several ages: found {names}; expected one"
        return ScanAge(None, cause=cause)
    for text, (week, problem) in found.items():
        cause = f"the name: {problem}" if problem else ""
        return ScanAge(
            week,
            f"name ({text})",
            cause,
            named=text,
        )
    return ScanAge(None)
