"""Gather what jobs wrote: messages of a study, time and memory of steps."""

import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from ..io.files import AnyPath
from ..messages import read_events, study_messages
from ..step import USAGE_COLUMNS

REPORT_STEP = "html_report"
"""The step whose messages are not in the table that it shows."""


def gather_messages(
    folder: AnyPath,
    brains: Iterable[str],
    runs: Iterable[tuple[str, str]],
) -> pd.DataFrame:
    """Return the warnings and errors of a study, of some of its brains, and of some
    (run, brain) pairs, without those of the report.

    Subject and run are empty if not applicable.
    """
    known = {("", ""), *(("", brain) for brain in brains), *map(tuple, runs)}
    rows = []
    for message in study_messages(Path(folder)):
        place = (message.brain, message.run, message.step)
        is_known = (message.run, message.brain) in known
        if is_known and message.step != REPORT_STEP:
            rows.append((*place, message.level, message.first_line))
    columns = ["subject", "run", "step", "level", "message"]
    table = pd.DataFrame(rows, columns=columns).drop_duplicates()
    order = ["run", "subject", "step"]
    return table.sort_values(order, kind="stable", ignore_index=True)


def read_usage(folder: AnyPath, patterns: Mapping[str, str]) -> pd.DataFrame:
    """Return time and memory of jobs as their steps have recorded them, in the order of
    the rules.

    `patterns` are regular expressions for the paths of each rule's messages, with the
    groups `run` and `brain` (None if not applicable).
    """
    folder = Path(folder)
    paths = sorted((folder / "results").rglob("logs/**/*.jsonl"))
    names = {path.relative_to(folder).as_posix(): path for path in paths}
    rows = []
    for rule, pattern in patterns.items():
        for name, path in names.items():
            match = re.fullmatch(pattern, name)
            used = usage_in(read_events(path)) if match else None
            if match and used:
                places = {key: match.groupdict().get(key) for key in ("run", "brain")}
                rows.append({"rule": rule, **places, **used})
    return pd.DataFrame(rows, columns=["rule", "run", "brain", *USAGE_COLUMNS])


def usage_in(rows: Iterable[Mapping[str, Any]]) -> dict[str, float] | None:
    """Return time and memory among the lines that a step has written; None if it has
    not ended."""
    for row in rows:
        if row.get("event") == "usage":
            return {name: float(row[name]) for name in USAGE_COLUMNS}
    return None
