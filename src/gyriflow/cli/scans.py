"""The table of scans with which `init`, `check` and the BIDS app end."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from tabulate import tabulate

from ..grouping import Kinds
from ..io.files import read_table
from .recognition import UNSET, FoundScans

HEADINGS = ("scan", "age", "from", "data", "scheme", "verdict")
UNUSABLE = {
    "not read": "could not be read",
    "refused": "cannot be used",
    "fill in": "to fill in",
}
"""Verdicts on scans that cannot be used yet, and their words in the last line."""


class ScanRow(NamedTuple):
    """A scan in the table, with the reasons for its verdict."""

    scan: str
    age: str
    age_source: str
    data: str
    scheme: str
    verdict: str
    reasons: Sequence[str] = ()


def scan_lines(scans: Iterable[ScanRow]) -> Iterator[str]:
    """Yield the lines of a table of scans, and at the end how many of them can be
    used."""
    rows = list(scans)
    table = tabulate(
        [row[:6] for row in rows],
        headers=HEADINGS,
        tablefmt="plain",
        disable_numparse=True,
    )
    heading, *lines = table.splitlines()
    shown = Kinds()
    yield heading
    for line, row in zip(lines, rows, strict=True):
        yield line
        for reason in (" ".join(text.split()) for text in row.reasons):
            if shown.add(row.scan, f"{row.scan}: {reason}"):
                yield f"    {reason}"
    yield from shown.others()
    counts = Counter(row.verdict for row in rows)
    unusable = [
        f"{counts[verdict]} {text}"
        for verdict, text in UNUSABLE.items()
        if counts[verdict]
    ]
    usable = sum(row.verdict not in UNUSABLE for row in rows)
    total = f"{len(rows)} scan{'s' if len(rows) != 1 else ''}"
    yield f"{usable} of {total}; {', '.join(unusable)}" if unusable else total


def measured_verdicts(directory: Path) -> dict[str, tuple[str, str]]:
    """Return verdict and cause of each brain of a study from its quality table, by id;
    empty if there is none."""
    path = directory / "results" / "study" / "quality.csv"
    if not path.is_file():
        return {}
    table = read_table(path).fillna("")
    return {
        str(row["subject"]): (str(row["verdict"]), str(row.get("cause", "")))
        for _, row in table.iterrows()
    }


def found_rows(
    found: FoundScans, verdicts: Mapping[str, tuple[str, str]]
) -> Iterator[ScanRow]:
    """Yield the rows of recognised scans; `verdicts` has verdict and cause of those
    that were run, by id."""
    for brain in found.brains:
        week, scheme = brain.entry["week"], brain.entry.get("scheme", UNSET)
        reasons = [*brain.causes, *brain.warnings]
        if brain.causes:
            is_refused = brain.problem or brain.contradiction
            verdict = (
                "not read"
                if brain.is_unreadable
                else "refused"
                if is_refused
                else "fill in"
            )
        else:
            verdict, cause = verdicts.get(
                brain.entry["id"], ("warning" if brain.warnings else "ok", "")
            )
            reasons += [cause] if cause else []
        data = ", ".join(file.rpartition("/")[2] for file in brain.files.split(", "))
        age = "–" if week == UNSET else f"{week:g}"
        scheme = "–" if scheme == UNSET else scheme
        yield ScanRow(
            brain.entry["id"],
            age,
            brain.age_source or "–",
            data,
            scheme,
            verdict,
            reasons,
        )
