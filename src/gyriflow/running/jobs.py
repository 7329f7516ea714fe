"""Gather what jobs wrote: messages of a study, time and memory of steps."""

import logging
import re
from collections.abc import Iterable, Mapping
from pathlib import Path

import pandas as pd

from ..io.files import AnyPath
from ..messages import read_messages
from ..step import USAGE_COLUMNS
from ..study.paths import REPORT


def gather_messages(
    folder: AnyPath, brains: Iterable[str], runs: Iterable[tuple[str, str]]
) -> pd.DataFrame:
    """Return the warnings and errors of a study, of some of its brains, and of some
    (run, brain) pairs, without those of the report.

    Subject and run are empty if not applicable.
    """
    folder = Path(folder)
    known = {("", ""), *(("", brain) for brain in brains), *map(tuple, runs)}
    rows = []
    for path in sorted(folder.glob("results/*/**/*.jsonl")):
        for message in read_messages(path):
            is_known = (message.run, message.brain) in known
            if is_known and not path.is_relative_to(folder / REPORT):
                rows.append(
                    {
                        "subject": message.brain,
                        "run": message.run,
                        "step": message.step,
                        "level": message.level,
                        "message": message.first_line,
                    }
                )
    table = pd.DataFrame(rows, columns=["subject", "run", "step", "level", "message"])
    return table.drop_duplicates(ignore_index=True)


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
