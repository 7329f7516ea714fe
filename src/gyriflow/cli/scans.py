"""The table of scans with which `init`, `check` and the BIDS app end."""

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from tabulate import tabulate

from ..grouping import Kinds, counted
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
    kinds = Kinds()
    yield heading
    for line, row in zip(lines, rows, strict=True):
        yield line
        for text in row.reasons:
            reason = " ".join(text.split())
            if kinds.add(
                row.scan,
                f"{row.scan}: {reason}",
            ):
                yield f"    {reason}"
    yield from kinds.others()
    counts = Counter(row.verdict for row in rows)
    n_usable = len(rows)
    unusable = []
    for verdict, text in UNUSABLE.items():
        if counts[verdict]:
            unusable.append(f"{counts[verdict]} {text}")
            n_usable -= counts[verdict]
    total = counted(len(rows), "scan")
    if unusable:
        yield f"{n_usable} of {total}; {', '.join(unusable)}"
    else:
        yield total


def _measured_verdicts(directory: Path | None) -> dict[str, tuple[str, str]]:
    """Return verdict and cause of each brain of a study from its quality table, by id;
    empty if there is none."""
    if directory is None:
        return {}
    path = directory / "results" / "study" / "quality.csv"
    if not path.is_file():
        return {}
    verdicts = {}
    for _, row in read_table(path).fillna("").iterrows():
        cause = str(row.get("cause", ""))
        verdicts[str(row["subject"])] = (str(row["verdict"]), cause)
    return verdicts


def found_rows(found: FoundScans, directory: Path | None = None) -> Iterator[ScanRow]:
    """Yield the rows of recognised scans, with the verdicts on those that were measured
    in a working directory."""
    verdicts = _measured_verdicts(directory)
    for brain in found.brains:
        scan = brain.entry["id"]
        week = brain.entry["week"]
        scheme = brain.entry.get("scheme", UNSET)
        reasons = [*brain.causes, *brain.warnings]
        if brain.is_unreadable and brain.causes:
            verdict = "not read"
        elif brain.problem or brain.contradiction:
            verdict = "refused"
        elif brain.causes:
            verdict = "fill in"
        elif scan in verdicts:
            verdict, cause = verdicts[scan]
            if cause:
                reasons.append(cause)
        else:
            verdict = "warning" if brain.warnings else "ok"
        names = [file.rpartition("/")[2] for file in brain.files.split(", ")]
        yield ScanRow(
            scan=scan,
            age="–" if week == UNSET else f"{week:g}",
            age_source=brain.age_source or "–",
            data=", ".join(names),
            scheme="–" if scheme == UNSET else scheme,
            verdict=verdict,
            reasons=reasons,
        )
