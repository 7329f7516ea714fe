"""Gestational ages: numbers of weeks, and texts such as 24+3 in configurations, tables
and names of files."""

import re
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, WithJsonSchema

from .base import refused

WEEK_RANGE = (15.0, 45.0)
"""First and last valid gestational week."""
WeekNotation = Literal["decimal", "days"]
EXPECTED_AGE = "the gestational age in weeks, such as 24.3, 24+2 or 24w2d"
WEEKS_AND_DAYS = re.compile(
    r"(\d{2})(?:\+|w(?:eeks?|ks?)?,?(?:and)?)([0-6])(?:d(?:ays?)?|w(?:eeks?)?)?|(\d{2})\+?([0-6])/7"
)
NUMBER = re.compile(r"(\d+(?:[.,]\d+)?)(?:gw|w(?:eeks?|ks?)?)?")
TENTHS = re.compile(r"\d{2}[.,]([0-9])")


def read_week(
    text: str,
    unit: str = "weeks",
    notation: WeekNotation | None = None,
) -> tuple[float | None, str]:
    """Return a gestational age in weeks, rounded to two decimals as in file names, and
    the problem with it, or ''.

    By `notation`, 24.3 is a decimal (default), or 24 weeks and 3 days.
    """
    plain = re.sub(r"\s", "", text.lower())
    tenths, number = TENTHS.fullmatch(plain), NUMBER.fullmatch(plain)
    if whole := WEEKS_AND_DAYS.fullmatch(plain):
        week = int(whole[1] or whole[3]) + int(whole[2] or whole[4]) / 7
    elif number and notation == "days" and unit == "weeks" and not number[1].isdigit():
        if tenths is None or int(tenths[1]) > 6:
            return None, f"found {text}; expected weeks and 0 to 6 days, such as 24.3"
        week = int(plain[:2]) + int(tenths[1]) / 7
    elif number:
        week = float(number[1].replace(",", ".")) / (7 if unit == "days" else 1)
    else:
        return None, f"found {text or 'n/a'}; expected {EXPECTED_AGE}"
    if not WEEK_RANGE[0] <= week <= WEEK_RANGE[1]:
        return (
            None,
            (
                f"found {text} in {unit}; expected gestational weeks,"
                f" {WEEK_RANGE[0]:g} to {WEEK_RANGE[1]:g}"
            ),
        )
    return round(week, 2), ""


def week_of(value: Any) -> Any:
    """Return the number of weeks that a text gives, such as 22.14 for 22+1; other
    values unchanged."""
    if not isinstance(value, str):
        return value
    try:
        return float(value)
    except ValueError:
        week, problem = read_week(value)
    if problem:
        raise refused(problem)
    return week


_two_decimals = AfterValidator(lambda week: round(week, 2))
_InRange = Annotated[
    float,
    Field(
        ge=WEEK_RANGE[0],
        le=WEEK_RANGE[1],
    ),
]
_AgeText = Annotated[str, WithJsonSchema({"type": "string", "format": "age"})]
_LaterInRange = Annotated[
    float,
    Field(
        gt=WEEK_RANGE[0],
        le=WEEK_RANGE[1],
    ),
]
AnyWeek = Annotated[
    _InRange, BeforeValidator(week_of, json_schema_input_type=_InRange | _AgeText)
]
"""A gestational week, such as one that a curve has a value at."""
Week = Annotated[AnyWeek, _two_decimals]
"""The week of a brain, rounded to the two decimals of file names and tables: equal
weeks are equal numbers."""
EndWeek = Annotated[
    _LaterInRange,
    BeforeValidator(week_of, json_schema_input_type=_LaterInRange | _AgeText),
    _two_decimals,
]
"""The last week of a simulation, rounded likewise."""
