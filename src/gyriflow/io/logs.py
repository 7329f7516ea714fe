"""What the steps of a workflow have said: warnings and errors in their logs."""

import re
from collections.abc import Iterable
from pathlib import Path

import pandas as pd

from .files import AnyPath

COLUMNS = ("subject", "run", "step", "level", "message")
_LINE = re.compile(r"^\d{4}-\d\d-\d\d \S+ (WARNING|ERROR) (\S+): (.*)$")
# the folding is a program whose output is its log
_SAID = re.compile(r"^(?:gyriflow: )?(warning: |gyriflow: )(.*)$")
# warnings of libraries say nothing of brains
_OF_LIBRARIES = "py.warnings"
_PLACES = (
    re.compile(r"results/brains/(?P<subject>[^/]+)/logs/(?P<step>[^/]+)\.log"),
    re.compile(r"results/brains/(?P<subject>[^/]+)/metrics/logs/(?P<step>[^/]+)\.log"),
    re.compile(r"results/runs/(?P<run>[^/]+)/(?P<subject>[^/]+)/(?:.*/)?logs/(?P<step>[^/]+)\.log"),
    re.compile(r"results/study/(?:.*/)?logs/(?P<step>[^/]+)\.log"),
)


def read_messages(path: AnyPath) -> list[tuple[str, str]]:
    """Returns ("warning" or "error", message) for each that a step's log holds, each once; none without a log."""
    try:
        lines = Path(path).read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return []
    found = []
    for line in lines:
        if match := _LINE.match(line):
            level, logger, message = match.groups()
            if logger != _OF_LIBRARIES:
                found.append((level.lower(), message))
        elif match := _SAID.match(line):
            found.append(("warning" if match[1] == "warning: " else "error", match[2]))
    return list(dict.fromkeys(found))


def gather_messages(
    folder: AnyPath, brains: Iterable[str], runs: Iterable[tuple[str, str]], *, since_s: float = 0.0
) -> pd.DataFrame:
    """Returns the warnings and errors of all steps of a study.

    Parameters
    ----------
    folder
        The working directory, with `results`.
    brains, runs
        Ids of brains, and (run, brain) pairs, whose steps count; the study's own count too.
    since_s
        Only logs that were written since this time, in s of the epoch, are read.

    Returns
    -------
    DataFrame with columns subject, run (both empty where there is none), step, level ("warning" or "error"), message
    """
    folder, known, folded = Path(folder), set(brains), {tuple(pair) for pair in runs}
    rows = []
    for path in sorted(folder.glob("results/**/logs/*.log")):
        place = path.relative_to(folder).as_posix()
        match = next((match for pattern in _PLACES if (match := pattern.fullmatch(place))), None)
        if match is None or path.stat().st_mtime < since_s:
            continue
        of = {"subject": "", "run": "", **match.groupdict()}
        if (of["run"], of["subject"]) in folded or (not of["run"] and of["subject"] in {"", *known}):
            rows += [{**of, "level": level, "message": message} for level, message in read_messages(path)]
    return pd.DataFrame(rows, columns=list(COLUMNS))
