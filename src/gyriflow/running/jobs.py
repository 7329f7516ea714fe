"""Gather what jobs wrote: messages of a study, time and memory of steps."""

import logging
import re
from collections.abc import Iterable, Mapping
from pathlib import Path

import pandas as pd

from ..io.files import AnyPath
from ..messages import study_messages
from ..step import USAGE_COLUMNS

REPORT_STEP = "html_report"
"""The step whose messages are not in the table that it shows."""


def gather_messages(
    folder: AnyPath, brains: Iterable[str], runs: Iterable[tuple[str, str]]
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

    `patterns` are regular expressions for the paths of each rule's records, with the
    groups `run` and `brain` (None if not applicable). Values are NaN if a record is
    incomplete.
    """
    folder = Path(folder)
    paths = sorted(
        path.relative_to(folder).as_posix()
        for path in folder.glob("results/**/benchmarks/*.tsv")
    )
    rows = []
    for rule, pattern in patterns.items():
        for path in paths:
            if match := re.fullmatch(pattern, path):
                wildcards = {
                    name: match.groupdict().get(name) for name in ("run", "brain")
                }
                rows.append({"rule": rule, **wildcards, **_read_record(folder / path)})
    return pd.DataFrame(rows, columns=["rule", "run", "brain", *USAGE_COLUMNS])


def _read_record(path: Path) -> dict[str, float]:
    try:
        table = pd.read_csv(path, sep="\t", dtype=str)
    except (OSError, ValueError) as error:
        logging.warning("%s cannot be read: %s", path, error)
        table = pd.DataFrame()
    numbers = table.reindex(columns=list(USAGE_COLUMNS), index=[0]).apply(
        pd.to_numeric, errors="coerce"
    )
    return numbers.loc[0].to_dict()
