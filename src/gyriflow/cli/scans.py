"""The table of scans with which `init`, `check` and the BIDS app end."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from ..io.files import read_table
from .recognition import UNSET, FoundBrain, Recognised

HEADINGS = ("scan", "age", "from", "data", "scheme", "verdict")


class ScanRow(NamedTuple):
    """A scan in the table, with the reasons for its verdict."""

    scan: str
    age: str
    age_source: str
    data: str
    scheme: str
    verdict: str
    reasons: Sequence[str] = ()


def scan_lines(rows: Sequence[ScanRow]) -> Iterator[str]:
    """Yield the lines of a table of scans, and at the end how many of them can be used."""
    table: list[Sequence[str]] = [HEADINGS, *([str(text) for text in row[: len(HEADINGS)]] for row in rows)]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    lines = ["  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)).rstrip() for row in table]
    yield lines[0]
    for line, row in zip(lines[1:], rows, strict=True):
        yield line
        yield from (f"    {' '.join(reason.split())}" for reason in row.reasons)
    unread, refused, open_values = (sum(row.verdict == verdict for row in rows) for verdict in VERDICTS)
    usable = len(rows) - unread - refused - open_values
    counts = [f"{unread} could not be read"] * (unread > 0) + [f"{refused} cannot be used"] * (refused > 0)
    counts += [f"{open_values} to fill in"] * (open_values > 0)
    total = f"{len(rows)} scan{'s' if len(rows) != 1 else ''}"
    yield f"{usable} of {total}; {', '.join(counts)}" if counts else total


VERDICTS = ("not read", "refused", "fill in")
"""Verdicts on scans that are not usable as they are."""


def measured_verdicts(directory: Path) -> dict[str, tuple[str, str]]:
    """Return verdict and cause of each brain of a study from its quality table, by id; empty if there is none."""
    path = directory / "results" / "study" / "quality.csv"
    if not path.is_file():
        return {}
    table = read_table(path).fillna("")
    return {str(row["subject"]): (str(row["verdict"]), str(row.get("cause", ""))) for _, row in table.iterrows()}


def found_rows(found: Recognised, measured: dict[str, tuple[str, str]] | None = None) -> list[ScanRow]:
    """Return the rows of recognised scans; `measured` has verdict and cause of those that were run, by id."""
    return [_row(brain, (measured or {}).get(brain.entry["id"])) for brain in found.brains]


def _row(brain: FoundBrain, measured: tuple[str, str] | None) -> ScanRow:
    entry = brain.entry
    week, scheme = entry["week"], entry.get("scheme", "–")
    reasons = [*brain.causes, *brain.warnings]
    verdict = "not read" if brain.unreadable else "refused" if brain.problem or brain.contradiction else "ok"
    verdict = "fill in" if verdict == "ok" and brain.notes else verdict
    if measured and verdict == "ok":
        verdict, cause = measured
        reasons += [cause] if cause else []
    elif verdict == "ok" and brain.warnings:
        verdict = "warning"
    data = ", ".join(file.rpartition("/")[2] for file in brain.files.split(", "))
    age = "–" if week == UNSET else f"{week:g}"
    return ScanRow(
        entry["id"], age, brain.age_source or "–", data, "–" if scheme == UNSET else scheme, verdict, reasons
    )
