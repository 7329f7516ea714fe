"""Gestational ages of scans: the columns that give them, their units, and ages written
in cells and file names."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from ..settings.weeks import TENTHS, WeekNotation, read_week

MISSING_VALUES = frozenset(("", "n/a", "na", "nan", "none", "null", "-"))
"""Missing values, in lower case: those of BIDS and of R and Python."""
WEEKS_UNIT = re.compile(
    r"((completed|gestational|post-?menstrual) )?(weeks?|wks?|w|gw)\b.*"
)
DAYS_UNIT = re.compile(r"days?|d")
UNIT_WORDS = frozenset(
    (
        "week",
        "weeks",
        "wk",
        "wks",
        "w",
        "day",
        "days",
        "d",
        "month",
        "months",
        "mo",
        "year",
        "years",
    )
)
SCAN_WORDS = frozenset(
    (
        "scan",
        "scanning",
        "mri",
        "mr",
        "imaging",
        "acquisition",
        "acq",
        "session",
        "visit",
        "exam",
        "examination",
    )
)
AGE_WORDS = frozenset(
    ("age", "ga", "pma", "gw", "gestational", "gestation", "gest", "week", "weeks")
)
OTHER_WORDS = frozenset(
    (
        "postnatal",
        "chronological",
        "corrected",
        "conception",
        "postconception",
        "postconceptional",
        "pna",
        "pca",
    )
)
"""Words in names of columns whose ages are not gestational ages at the scan."""
PARENT_WORDS = frozenset(
    ["mother", "maternal", "father", "paternal", "parental", "parent"]
)
Kind = Literal["scan", "gestational", "age", "postnatal"]
SINCE_BIRTH = (
    r"(?<![a-z])(post|neo)[- ]?natal|chronolog"
    r"|(since|after|from) (the )?(birth|delivery|term)|mother|maternal"
)
OTHER_TYPE = re.compile(
    rf"{SINCE_BIRTH}|birth|born|deliver|\bdob\b|correct|concept|\bpna\b|\bpca\b|\bterm\b",
    re.IGNORECASE,
)
"""References and types of ages that are not gestational ages at the scan."""
OTHER_DESCRIPTION = {
    "scan": re.compile(
        r"mother|maternal|(?<![a-z])(post|neo)[- ]?natal age|chronological age",
        re.IGNORECASE,
    ),
    "gestational": re.compile(rf"{SINCE_BIRTH}|at (birth|delivery)", re.IGNORECASE),
    "age": OTHER_TYPE,
}
EXPECTED_COLUMNS = (
    "scan_age, gestational_age, ga, pma or week, or age with Units weeks or days in"
)
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
    """A column of ages, with its unit, and the problem if it cannot be used.

    `is_other` is whether the problem is that its ages are not gestational ones at the
    scan.
    """

    name: str
    kind: Kind
    unit: str
    problem: str
    is_other: bool = False


@dataclass(frozen=True)
class TableAge:
    """An age in a table: its place (table and row), column and text.

    `has_session` is whether the row names a session, `is_shared` whether it could be of
    several scans of the subject.
    """

    place: str
    column: AgeColumn
    text: str
    has_session: bool
    is_shared: bool = False


@dataclass(frozen=True)
class ScanAge:
    """The age of a scan in weeks with its source and columns, or None with the cause.

    `named` is its text if it is from a name. `values` are the other values of the scan
    in tables by column.
    """

    week: float | None
    source: str = ""
    cause: str = ""
    columns: frozenset[str] = frozenset()
    named: str = ""
    values: Mapping[str, str] = field(default_factory=dict)


def column_key(name: str) -> str:
    """Return the name of a column in lower case, with _ between its words."""
    return re.sub(
        r"[^a-z0-9]+", "_", re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower()
    ).strip("_")


def is_missing(text: str) -> bool:
    """Return whether a cell has no value."""
    return text.lower() in MISSING_VALUES


def _kind(words: Sequence[str]) -> Kind | None:
    """Return the kind of the ages in a column, from the words of its name."""
    joined, distinct = "_".join(words), set(words)
    if distinct & PARENT_WORDS or distinct & {"birth", "delivery", "born"}:
        return None
    if not (
        distinct & AGE_WORDS or "menstrual" in joined or distinct <= {"day", "days"}
    ):
        return "postnatal" if distinct & {"pna", "pca"} else None
    if distinct & OTHER_WORDS or "post_natal" in joined or "post_concept" in joined:
        return "postnatal"
    if distinct & SCAN_WORDS or "pma" in distinct or "menstrual" in joined:
        return "scan"
    if distinct == {"age"}:
        return "age"
    if distinct <= AGE_WORDS | UNIT_WORDS and distinct - {"d", "w", "y", "mo"}:
        return "gestational"
    return None


def age_columns(
    names: Iterable[str], sidecar: Any, sidecar_name: str
) -> list[AgeColumn]:
    """Return the columns with ages of scans; `sidecar` is the content of the table's
    JSON file.

    Ages at birth are not returned. Ages since birth or conception are `postnatal`, or
    have a problem if only the sidecar describes them so.
    """
    keys = sidecar.items() if isinstance(sidecar, dict) else ()
    described = {column_key(str(key)): value for key, value in keys}
    columns = []
    for name in names:
        key = column_key(name)
        words = key.split("_")
        kind = _kind(words)
        if kind is None:
            continue
        facts = described.get(key, {})
        if not isinstance(facts, dict):
            facts = {"Description": facts}
        last = words[-1]
        has_unit = last.startswith("day") or (len(words) > 1 and last in UNIT_WORDS)
        ending = last if has_unit else ""
        unit, problem, is_other = _unit(kind, ending, facts, sidecar_name)
        columns.append(AgeColumn(name, kind, unit, problem, is_other))
    return columns


def _unit(
    kind: Kind, ending: str, described: Mapping[str, Any], sidecar_name: str
) -> tuple[str, str, bool]:
    """Return the unit of a column, its problem or "", and whether that is another age
    than at the scan."""
    facts = {column_key(key): str(value).strip() for key, value in described.items()}
    text = (
        f"{facts.get('long_name', facts.get('longname', ''))}"
        f" {facts.get('description', '')}"
    )
    in_text = re.search(r"\b(months?|years?)\b", text, re.IGNORECASE)
    named = [
        ending,
        facts.get("units", facts.get("unit", "")),
        in_text[0] if in_text else "",
    ]
    names = [name for name in named if name]
    units = {unit_of(name) for name in names} or {None if kind == "age" else "weeks"}
    reference = facts.get("age_reference", facts.get("agereference", ""))
    if len(units) > 1 or None in units:
        found = f"found the unit {' and '.join(names)}" if names else "has no unit"
        return (
            "weeks",
            f"{found}; expected Units weeks or days in {sidecar_name}",
            False,
        )
    is_other = (
        kind in OTHER_DESCRIPTION
        and OTHER_DESCRIPTION[kind].search(text)
        and "plus" not in text
    )
    if is_other or OTHER_TYPE.search(reference):
        found = reference or text.strip()
        return (
            "weeks",
            f"is not a gestational age at the scan: {sidecar_name} has {found!r}",
            True,
        )
    return str(units.pop()), "", False


def unit_of(name: str) -> str | None:
    """Return the unit with a name, weeks or days, or None."""
    name = name.lower().strip(" .")
    if WEEKS_UNIT.fullmatch(name):
        return "weeks"
    return "days" if DAYS_UNIT.fullmatch(name) else None


def choose_age(
    ages: Sequence[TableAge],
    notation: WeekNotation | None,
    marks: Sequence[TableAge] = (),
) -> ScanAge:
    """Return the age of a scan from all its ages in tables; `marks` are ages at the
    scan of other scans.

    Ages at the scan take precedence, since a gestational age in addition is the one at
    birth, also if they are missing or given for other scans only; next are ages of the
    scan's session. If all are missing, or if two differ, the age is None, with the
    cause.
    """
    present = [age for age in ages if not is_missing(age.text)]
    own = [age for age in present if not age.is_shared]
    at_scan = [age for age in own if age.column.kind == "scan"]
    # next those of the session; a plain age may be the mother's
    used = [age for age in own if age.column.kind != "postnatal"]
    used = [age for age in used if age.has_session] or used
    used = at_scan or [age for age in used if age.column.kind == "gestational"] or used
    if not used:
        found = " and ".join(
            f"{age.column.name} {age.text} ({age.place})" for age in own
        )
        return ScanAge(
            None,
            cause=(
                f"found {found}; expected the age at the scan, such as scan_age"
                if own
                else ""
            ),
        )
    later = [age for age in ages if _shows_birth(age) and age not in used] or marks
    if not at_scan and later and not any(age.column.problem for age in used):
        found = " and ".join(
            f"{age.column.name} {age.text or 'n/a'} ({age.place})"
            for age in (*used, *later)
        )
        cause = (
            f"found {found}: the gestational age is probably at birth; expected the age"
            " at the scan as scan_age"
        )
        return ScanAge(None, cause=cause)
    days = [age for age in used if age.column.unit == "days" and age.text in "0123456"]
    wholes = [age for age in used if age not in days]
    weeks = []
    for age in wholes if days and all(age.text.isdigit() for age in wholes) else used:
        week, problem = read_week(age.text, age.column.unit, notation)
        if problem := age.column.problem or problem:
            return ScanAge(None, cause=f"{age.column.name}: {problem} ({age.place})")
        weeks.append((week or 0.0) + (int(days[0].text) / 7 if days else 0.0))
    if max(weeks) - min(weeks) > MAX_DIFFERENCE_WEEKS:
        values = " and ".join(
            f"{age.text} ({age.place}, {age.column.name})" for age in used
        )
        remedy = (
            " Give each scan a row with its session_id."
            if len({age.place for age in used}) > 1
            else ""
        )
        return ScanAge(None, cause=f"found two ages, {values}; expected one.{remedy}")
    at_birth = [
        f"{age.column.name} {age.text}"
        for age in present
        if at_scan and age.column.kind == "gestational"
    ]
    source = f"{used[0].place.partition(' row')[0]}, {used[0].column.name}"
    source += f" ({', '.join(dict.fromkeys(at_birth))} is at birth)" if at_birth else ""
    return ScanAge(
        round(weeks[0], 2), source, columns=frozenset(age.column.name for age in used)
    )


def _shows_birth(age: TableAge) -> bool:
    """Return whether an age (at the scan or since birth) shows that a gestational one
    is at birth."""
    is_since_birth = age.column.kind == "postnatal" or age.column.is_other
    return age.column.kind == "scan" or (is_since_birth and not is_missing(age.text))


def may_be_days(texts: Iterable[str]) -> list[str]:
    """Return examples if the decimals of all ages in weeks may be days: tenths from 0
    to 6, not only halves."""
    examples = []
    digits = set()
    for text in texts:
        if not re.search("[.,]", text):
            continue
        match = TENTHS.fullmatch(text)
        if match is None or match[1] not in "0123456":
            return []
        examples.append(text)
        digits.add(match[1])
    if len(examples) < MIN_AMBIGUOUS_AGES or digits <= {"0", "5"}:
        return []
    return examples[:3]


def week_in_name(parts: Sequence[str], notation: WeekNotation | None = None) -> ScanAge:
    """Return the age that the names of a file and its folders give, such as week24,
    GA24.3, week24+3 or GA24w3d."""
    found: dict[str, tuple[float | None, str]] = {}
    unclear = ""
    for part in reversed(parts):
        for match in WEEK_NAME.finditer(part):
            if ending := AMBIGUOUS_ENDING.match(match["more"]):
                # folders may be of several weeks
                unclear = unclear or ("" if found else f"{match[0]}{ending[0]}")
            else:
                found.setdefault(
                    match["age"], read_week(match["age"], notation=notation)
                )
    if unclear:
        cause = (
            f"the name gives an ambiguous age: found {unclear}; expected one such as"
            " week24.4 or week24+3"
        )
        return ScanAge(None, cause=cause)
    if len({week for week, _ in found.values()}) > 1:
        return ScanAge(
            None,
            cause=(
                f"the names give several ages: found {' and '.join(found)};"
                " expected one"
            ),
        )
    for text, (week, problem) in found.items():
        return ScanAge(
            week,
            f"name ({text})",
            f"the name: {problem}" if problem else "",
            named=text,
        )
    return ScanAge(None)
