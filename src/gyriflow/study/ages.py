"""Gestational ages of scans: the columns that give them, their units, and ages written in cells and file names."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from ..settings.participants import WeekNotation
from ..settings.varying import WEEK_RANGE

MISSING_VALUES = frozenset(("", "n/a"))
"""Missing values in BIDS."""
UNITS = {
    **dict.fromkeys(("weeks", "week", "wks", "wk", "w", "gw", "gestational weeks"), "weeks"),
    **dict.fromkeys(("days", "day", "d"), "days"),
}
UNIT_ENDING = re.compile(r"(?<=[a-z])_(?:in_)?(weeks?|wks?|w|days?|d|months?|mo|years?|yrs?|y)$")
_AGE = r"(?:age|ga|pma|gestational_age|post_?menstrual_age)"
_SCAN = r"(?:scan|mri|mr|imaging|acquisition|session|visit|exam)"
AT_SCAN = re.compile(rf"{_SCAN}_{_AGE}|{_AGE}_(?:at_)?{_SCAN}|pma|post_?menstrual_age")
GESTATIONAL = re.compile(r"gestational_age|gest_age|gestation|ga|gw|weeks?|gestational_weeks?")
Kind = Literal["scan", "gestational", "age"]
KINDS: dict[Kind, re.Pattern[str]] = {"scan": AT_SCAN, "gestational": GESTATIONAL, "age": re.compile("age")}
"""Names of columns by the kind of their ages: at the scan, gestational, or plain."""
OTHER_AGE = re.compile(
    r".*(birth|delivery).*|(post_?natal|chronological|corrected|(?:post_?)?concept\w*)(?:_age)?|pna|pca"
)
"""Ages that are not gestational ages at the scan."""
OTHER_REFERENCE = re.compile(r"birth|deliver|born|natal|chronolog|correct|concept", re.IGNORECASE)
EXPECTED_COLUMNS = "scan_age, gestational_age, ga, pma or week, or age with Units weeks or days in"
EXPECTED_AGE = "the gestational age in weeks, such as 24.3, 24+2 or 24w2d"
WEEKS_AND_DAYS = re.compile(r"(\d{2})(?:\+([0-6])|w([0-6])d?)")
NUMBER = re.compile(r"\d+(?:[.,]\d+)?")
TENTHS = re.compile(r"\d{2}[.,]([0-9])")
MIN_AMBIGUOUS_AGES = 3
"""Number of ages in tenths of a week with digits from 0 to 6 that is enough to suspect days."""
MAX_DIFFERENCE_WEEKS = 0.1
"""Two ages of a scan agree if they differ by rounding."""
WEEK_NAME = re.compile(
    r"(?<![A-Za-z])(?:weeks?|wk|ga|gw)[-_]?(?P<age>\d{2}(?:\.\d+|\+[0-6]|w[0-6]d)?)(?!\d)(?=(?P<more>.*))",
    re.IGNORECASE,
)
AMBIGUOUS_ENDING = re.compile(r"[_+-]?[wdp]?\d+[dw]?(?![A-Za-z0-9])|[+-]\d", re.IGNORECASE)
"""Text after the weeks in a name that may be days, a decimal or another week."""


@dataclass(frozen=True)
class AgeColumn:
    """A column of ages, with its unit, and the problem if it cannot be used."""

    name: str
    kind: Kind
    unit: str
    problem: str


@dataclass(frozen=True)
class TableAge:
    """An age in a table: its place (table and row), column and text.

    `has_session` is whether the row names a session, `is_shared` whether it could be of several scans of the subject.
    """

    place: str
    column: AgeColumn
    text: str
    has_session: bool
    is_shared: bool = False


@dataclass(frozen=True)
class ScanAge:
    """The age of a scan in weeks with its source and columns, or None with the cause."""

    week: float | None
    source: str = ""
    cause: str = ""
    columns: frozenset[str] = frozenset()


def column_key(name: str) -> str:
    """Return the name of a column in lower case, with _ between its words."""
    return re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")


def age_columns(names: Iterable[str], sidecar: Any, sidecar_name: str) -> list[AgeColumn]:
    """Return the columns with ages of scans; `sidecar` is the content of the table's JSON file.

    Ages at birth and ages since birth or conception are not ages of scans. If they are named like one, they have a
    problem, otherwise they are not returned.
    """
    keys = sidecar.items() if isinstance(sidecar, dict) else ()
    described = {column_key(str(key)): value for key, value in keys if isinstance(value, dict)}
    columns = []
    for name in names:
        key = column_key(name)
        ending = UNIT_ENDING.search(key)
        base = key[: ending.start()] if ending else key
        if OTHER_AGE.fullmatch(base):
            continue
        for kind in (kind for kind, pattern in KINDS.items() if pattern.fullmatch(base)):
            kind = "gestational" if kind == "age" and ending else kind
            unit_and_problem = _unit(kind, ending[1] if ending else "", described.get(key, {}), sidecar_name)
            columns.append(AgeColumn(name, kind, *unit_and_problem))
    return columns


def _unit(kind: str, ending: str, described: Mapping[str, Any], sidecar_name: str) -> tuple[str, str]:
    unit = str(described.get("Units", "")).strip().lower()
    names = [text for text in (ending, unit) if text]
    units = {UNITS.get(text) for text in names} or {None if kind == "age" else "weeks"}
    text = " ".join(str(described.get(key, "")) for key in ("LongName", "Description"))
    reference = str(described.get("AgeReference", "")) or ("" if re.search("scan|MRI|imaging", text) else text)
    if len(units) > 1 or None in units:
        found = f"found the unit {' and '.join(names)}" if names else "has no unit"
        return "weeks", f"{found}; expected Units weeks or days in {sidecar_name}"
    if OTHER_REFERENCE.search(reference):
        return "weeks", f"is not a gestational age at the scan: {sidecar_name} has {reference.strip()!r}"
    return str(units.pop()), ""


def choose_age(ages: Sequence[TableAge], notation: WeekNotation | None) -> ScanAge:
    """Return the age of a scan from all its ages in tables.

    Ages at the scan take precedence, since the table's gestational age is then the one at birth; next are ages of the
    scan's session. If all are missing, or if two differ, the age is None, with the cause.
    """
    ages = [age for age in ages if age.text not in MISSING_VALUES]
    used = [age for age in ages if not age.is_shared]
    if not used:
        return ScanAge(None)
    at_scan = [age for age in used if age.column.kind == "scan"]
    used = at_scan or [age for age in used if age.has_session] or used
    # a plain age may be the mother's
    used = at_scan or [age for age in used if age.column.kind == "gestational"] or used
    weeks = []
    for age in used:
        week, problem = read_week(age.text, age.column.unit, notation)
        if problem := age.column.problem or problem:
            return ScanAge(None, cause=f"{age.column.name}: {problem} ({age.place})")
        weeks.append(week or 0.0)
    if max(weeks) - min(weeks) > MAX_DIFFERENCE_WEEKS:
        values = " and ".join(f"{age.text} ({age.place}, {age.column.name})" for age in used)
        remedy = " Give each scan a row with its session_id." if len({age.place for age in used}) > 1 else ""
        return ScanAge(None, cause=f"found two ages, {values}; expected one.{remedy}")
    at_birth = [f"{age.column.name} {age.text}" for age in ages if at_scan and age.column.kind == "gestational"]
    source = f"{used[0].place.partition(' row')[0]}, {used[0].column.name}"
    source += f" ({', '.join(dict.fromkeys(at_birth))} is at birth)" if at_birth else ""
    return ScanAge(weeks[0], source, columns=frozenset(age.column.name for age in used))


def read_week(text: str, unit: str = "weeks", notation: WeekNotation | None = None) -> tuple[float | None, str]:
    """Return a gestational age in weeks, rounded to two decimals as in file names, and the problem with it, or ''.

    By `notation`, 24.3 is a decimal (default), or 24 weeks and 3 days.
    """
    tenths = TENTHS.fullmatch(text)
    if whole := WEEKS_AND_DAYS.fullmatch(text):
        week = int(whole[1]) + int(whole[2] or whole[3]) / 7
    elif notation == "days" and unit == "weeks" and NUMBER.fullmatch(text) and not text.isdigit():
        if tenths is None or int(tenths[1]) > 6:
            return None, f"found {text}; expected weeks and 0 to 6 days, such as 24.3"
        week = int(text[:2]) + int(tenths[1]) / 7
    elif NUMBER.fullmatch(text):
        week = float(text.replace(",", ".")) / (7 if unit == "days" else 1)
    else:
        return None, f"found {text or 'n/a'}; expected {EXPECTED_AGE}"
    if not WEEK_RANGE[0] <= week <= WEEK_RANGE[1]:
        return None, f"found {text}; expected gestational weeks, {WEEK_RANGE[0]:g} to {WEEK_RANGE[1]:g}"
    return round(week, 2), ""


def may_be_days(texts: Iterable[str]) -> list[str]:
    """Return examples if the decimals of all ages in weeks may be days: tenths from 0 to 6, not only halves."""
    decimals = [(text, TENTHS.fullmatch(text)) for text in texts if re.search("[.,]", text)]
    tenths = [(text, match[1]) for text, match in decimals if match and match[1] in "0123456"]
    several = len({digit for _, digit in tenths} - {"0"}) > 1
    return [text for text, _ in tenths[:3]] if len(decimals) == len(tenths) >= MIN_AMBIGUOUS_AGES and several else []


def week_in_name(parts: Sequence[str]) -> ScanAge:
    """Return the age that a file's name or else its folders give, such as week24, GA24.3, week24+3 or GA24w3d."""
    for part in reversed(parts):
        matches = list(WEEK_NAME.finditer(part))
        for match in matches:
            if ending := AMBIGUOUS_ENDING.match(match["more"]):
                found = f"found {match[0]}{ending[0]}; expected one such as week24.4 or week24+3"
                return ScanAge(None, cause=f"the name gives an ambiguous age: {found}")
        weeks = {match["age"]: read_week(match["age"].lower()) for match in matches}
        if len({week for week, _ in weeks.values()}) > 1:
            return ScanAge(None, cause=f"the name gives two ages: found {' and '.join(weeks)}; expected one")
        for text, (week, problem) in weeks.items():
            return ScanAge(week, f"name ({text})", f"the name: {problem}" if problem else "")
    return ScanAge(None)
