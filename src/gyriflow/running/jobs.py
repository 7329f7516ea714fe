"""What the jobs of a study leave: messages in their logs, events of a folding, Snakemake's benchmark files."""

import json
import logging
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

from ..io.files import AnyPath

COLUMNS = ("subject", "run", "step", "level", "message")
NEXT = r"(?!\d{4}-\d\d-\d\d |warning: |gyriflow: )"
"""No line that begins another message."""
MESSAGE = re.compile(
    rf"^\d{{4}}-\d\d-\d\d \S+ (?P<level>WARNING|ERROR) (?P<logger>\S+): (?P<logged>.*(?:\n{NEXT}.*)*)"
    # the folding is a program whose output is its log
    r"|^(?:gyriflow: )?warning: (?P<warning>.+)|^gyriflow: (?P<error>.+(?:\n {2,}.+)*)",
    re.MULTILINE,
)
OWN = ("", "root", "__main__")
"""Who says what is gyriflow's own, besides its modules."""
RAISED = re.compile(r"^(\w[\w.]*(?:Error|Exception|Interrupt|Warning)\b.*)$", re.MULTILINE)
OF_SNAKEMAKE = "WorkflowError"
"""How the names of exceptions end that say no more than that a step has failed; logs of jobs on a cluster end so."""
LOGGED = re.compile(r"\d{4}-\d\d-\d\d \S+ (?:INFO|WARNING) ")
KILLED = "it was killed, most probably because memory ran out: its log ends without a message"
_PLACES = (
    re.compile(r"results/brains/(?P<subject>[^/]+)/(?:metrics/)?logs/(?P<step>[^/]+)\.log"),
    re.compile(r"results/runs/(?P<run>[^/]+)/(?P<subject>[^/]+)/(?:.*/)?logs/(?P<step>[^/]+)\.log"),
    re.compile(r"results/study/(?:.*/)?logs/(?P<step>[^/]+)\.log"),
)


class Message(NamedTuple):
    """A message of a log: "warning" or "error", its text of one or more lines, and whether gyriflow says it."""

    level: str
    text: str
    by_gyriflow: bool


def messages_in(text: str) -> Iterator[Message]:
    """Yield the warnings and errors in a log or a piece of it, but for warnings of libraries."""
    for match in MESSAGE.finditer(text):
        logger = match["logger"] or ""
        # where Python logs the warnings of libraries, which say nothing of brains
        if logger != "py.warnings":
            level = (match["level"] or ("warning" if match["warning"] else "error")).lower()
            content = match["logged"] or match["warning"] or match["error"] or ""
            yield Message(level, content.strip(), logger in OWN or logger.startswith("gyriflow"))


def cause(text: str) -> str:
    """Return why a job failed, from its log: gyriflow's own message, else the exception, else the last lines.

    A step that fails says so. Where its log ends without a word, it was killed.
    """
    # what the program has said last is what it says on the terminal, before what was logged
    said = [match["error"].strip() for match in MESSAGE.finditer(text) if match["error"]]
    errors = said or [message.text for message in messages_in(text) if message.by_gyriflow and message.level == "error"]
    if errors and not errors[0].startswith("unexpected error"):
        return errors[0]
    raised = [line for line in RAISED.findall(text) if not line.partition(":")[0].endswith(OF_SNAKEMAKE)]
    if raised:
        return f"unexpected {raised[-1]}"
    lines = [line for line in text.splitlines() if line.strip()]
    if lines and LOGGED.match(lines[-1]):
        return KILLED
    return "\n".join(lines[-5:])


def events_in(text: str) -> list[dict[str, Any]]:
    """Return the events in the progress file of a folding, or a piece of it: `event`, and what it tells."""
    events = []
    for line in text.splitlines():
        # a full disk may have left half a line
        with suppress(ValueError):
            events.append(json.loads(line))
    return events


@dataclass
class GrowingFile:
    """A file that a job is writing, read piece by piece; it need not be there yet."""

    path: Path
    read: int = 0

    def new_text(self) -> str:
        """Return what was written since the last call, in whole lines."""
        try:
            with self.path.open("rb") as file:
                # a job that is tried again begins its file anew
                size = file.seek(0, 2)
                self.read = file.seek(self.read if self.read <= size else 0)
                piece = file.read()
        except OSError:
            return ""
        whole = piece[: piece.rfind(b"\n") + 1]
        self.read += len(whole)
        return whole.decode("utf-8", errors="replace")


def read_log(path: AnyPath) -> str:
    """Return a whole log; nothing where it cannot be read."""
    try:
        return Path(path).read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""


def read_messages(path: AnyPath) -> list[tuple[str, str]]:
    """Return ("warning" or "error", its first line) for each message of a step's log, each once; none without one."""
    messages = [(message.level, message.text.partition("\n")[0]) for message in messages_in(read_log(path))]
    return list(dict.fromkeys(messages))


def gather_messages(
    folder: AnyPath, brains: Iterable[str], runs: Iterable[tuple[str, str]], *, since_s: float = 0.0
) -> pd.DataFrame:
    """Return the warnings and errors of a study in a folder: its own, and those of brains and (run, brain) pairs.

    Columns are subject, run (both empty where there is none), step, level ("warning" or "error"), message. Only logs
    that were written since a time, in s of the epoch, are read.
    """
    folder, ids, folded = Path(folder), set(brains), {tuple(pair) for pair in runs}
    rows = []
    for path in sorted(folder.glob("results/**/logs/*.log")):
        place = path.relative_to(folder).as_posix()
        match = next((match for pattern in _PLACES if (match := pattern.fullmatch(place))), None)
        if match is None or path.stat().st_mtime < since_s:
            continue
        of = {"subject": "", "run": "", **match.groupdict()}
        if (of["run"], of["subject"]) in folded or (not of["run"] and of["subject"] in {"", *ids}):
            rows += [{**of, "level": level, "message": message} for level, message in read_messages(path)]
    return pd.DataFrame(rows, columns=list(COLUMNS))


MEASURED = {"s": "wall_s", "cpu_time": "cpu_s", "max_rss": "memory_MiB"}
"""Columns that are read, by their names in the files; Snakemake calls 2²⁰ bytes a megabyte."""


def read_benchmarks(folder: AnyPath, patterns: Mapping[str, str]) -> pd.DataFrame:
    """Return what Snakemake measured of the jobs of rules, in a working directory, in the order of the rules.

    `patterns` are regular expressions of the paths of each rule's files in folders `benchmarks`, with groups `run` and
    `brain`. Columns are rule, run and brain (None where there is none), wall_s, cpu_s, memory_MiB; values are NaN where
    Snakemake could not measure ("NA", "-") or the file is torn.
    """
    folder = Path(folder)
    benchmarks = sorted(path.relative_to(folder).as_posix() for path in folder.glob("results/**/benchmarks/*.tsv"))
    rows = []
    for rule, pattern in patterns.items():
        for path in benchmarks:
            if match := re.fullmatch(pattern, path):
                of = {name: match.groupdict().get(name) for name in ("run", "brain")}
                rows.append({"rule": rule, **of, **_measured(folder / path)})
    return pd.DataFrame(rows, columns=["rule", "run", "brain", *MEASURED.values()])


def _measured(path: Path) -> dict[str, float]:
    try:
        table = pd.read_csv(path, sep="\t", dtype=str)
    except (OSError, ValueError) as error:
        logging.warning("%s cannot be read: %s", path, error)
        table = pd.DataFrame()
    numbers = table.reindex(columns=list(MEASURED)).apply(pd.to_numeric, errors="coerce")
    # a job that was told to repeat itself has several lines
    return {
        "wall_s": numbers["s"].sum(min_count=1),
        "cpu_s": numbers["cpu_time"].sum(min_count=1),
        "memory_MiB": numbers["max_rss"].max(),
    }
