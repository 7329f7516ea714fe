"""Read what jobs wrote: messages in logs, progress of simulations, time and memory of
steps."""

import json
import logging
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

from ..io.files import AnyPath
from ..step import USAGE_COLUMNS

NEXT = r"(?!\d{4}-\d\d-\d\d |warning: |gyriflow: )"
"""Lookahead: the line does not begin another message."""
MESSAGE = re.compile(
    r"^\d{4}-\d\d-\d\d \S+ (?P<level>WARNING|ERROR) (?P<logger>\S+): "
    rf"(?P<logged>.*(?:\n{NEXT}.*)*)"
    # a simulation is a program whose output is its log
    r"|^(?:gyriflow: )?warning: (?P<warning>.+)"
    r"|^gyriflow: (?P<error>.+(?:\n {2,}.+)*)",
    re.MULTILINE,
)
OWN_LOGGERS = ("", "root", "__main__")
"""Loggers of gyriflow itself, besides those of its modules."""
RAISED = re.compile(
    r"^(\w[\w.]*(?:Error|Exception|Interrupt|Warning)\b.*)$", re.MULTILINE
)
UNSPECIFIC_ERROR = "WorkflowError"
"""Suffix of exceptions that only report that a step failed; logs of jobs on a cluster
end with them."""
LOGGED = re.compile(r"\d{4}-\d\d-\d\d \S+ (?:INFO|WARNING) ")
OUT_OF_MEMORY = (
    "it was killed, most probably because memory ran out: its log ends without a"
    " message"
)
LOG_FOLDERS = {"brains": ["subject"], "runs": ["run", "subject"], "study": []}
"""What the folders around a log name, by folder in `results`."""


class Message(NamedTuple):
    """A message of a log: "warning" or "error", its text of one or more lines, and
    whether it is gyriflow's own."""

    level: str
    text: str
    by_gyriflow: bool

    @property
    def first_line(self) -> str:
        return self.text.partition("\n")[0]


def messages_in(text: str) -> Iterator[Message]:
    """Yield the warnings and errors in a log or a part of it, without the warnings of
    libraries."""
    for match in MESSAGE.finditer(text):
        logger = match["logger"] or ""
        # Python logs warnings of libraries there
        if logger != "py.warnings":
            level = (
                match["level"] or ("warning" if match["warning"] else "error")
            ).lower()
            content = match["logged"] or match["warning"] or match["error"] or ""
            yield Message(
                level,
                content.strip(),
                logger in OWN_LOGGERS or logger.startswith("gyriflow"),
            )


def cause(text: str) -> str:
    """Return why a job failed, from its log: gyriflow's own message, the exception, or
    the last lines if not killed."""
    # the program's own error line comes before logged errors
    printed = [
        match["error"].strip() for match in MESSAGE.finditer(text) if match["error"]
    ]
    errors = printed or [
        message.text
        for message in messages_in(text)
        if message.by_gyriflow and message.level == "error"
    ]
    if errors and not errors[0].startswith("unexpected error"):
        return errors[0]
    raised = [
        line
        for line in RAISED.findall(text)
        if not line.partition(":")[0].endswith(UNSPECIFIC_ERROR)
    ]
    if raised:
        return f"unexpected {raised[-1]}"
    lines = [line for line in text.splitlines() if line.strip()]
    if lines and LOGGED.match(lines[-1]):
        return OUT_OF_MEMORY
    return "\n".join(lines[-5:])


def events_in(text: str) -> list[dict[str, Any]]:
    """Return the events in the progress file of a simulation, or a part of it:
    dictionaries with the key `event`."""
    events = []
    for line in text.splitlines():
        # a full disk may leave half a line
        with suppress(ValueError):
            events.append(json.loads(line))
    return events


def read_log(path: AnyPath) -> str:
    """Return the text of a log, or an empty string if it cannot be read."""
    try:
        return Path(path).read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""


def read_messages(path: AnyPath) -> list[tuple[str, str]]:
    """Return the distinct messages of a step's log as ("warning" or "error", first
    line)."""
    return list(
        dict.fromkeys(
            (message.level, message.first_line)
            for message in messages_in(read_log(path))
        )
    )


def gather_messages(
    folder: AnyPath,
    brains: Iterable[str],
    runs: Iterable[tuple[str, str]],
    *,
    since_s: float = 0.0,
) -> pd.DataFrame:
    """Return the warnings and errors of a study, of some of its brains, and of some
    (run, brain) pairs.

    Subject and run are empty if not applicable. Only logs written after `since_s` (s
    since the epoch) are read.
    """
    folder = Path(folder)
    known = {("", ""), *(("", brain) for brain in brains), *map(tuple, runs)}
    rows = []
    for path in sorted(folder.glob("results/*/**/logs/*.log")):
        kind, *names = path.relative_to(folder / "results").parts[:-2]
        source = {"run": "", "subject": ""} | dict(
            zip(LOG_FOLDERS.get(kind, ()), names, strict=False)
        )
        is_known = kind in LOG_FOLDERS and (source["run"], source["subject"]) in known
        if is_known and path.stat().st_mtime >= since_s:
            source["step"] = path.stem
            rows += [
                {**source, "level": level, "message": message}
                for level, message in read_messages(path)
            ]
    return pd.DataFrame(rows, columns=["subject", "run", "step", "level", "message"])


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
