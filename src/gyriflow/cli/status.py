"""How far a study is, from its working directory alone: the run that is live or was the last, and the results there."""

import json
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from tabulate import tabulate

from ..config import load
from ..errors import InputError, StorageError
from ..io.files import read_json
from ..io.jobs import events_in, read_log
from ..io.yaml_files import read_yaml
from ..shipped import CONFIG
from ..study import resolve
from ..units import week_tag
from .launch import hold_lock
from .provenance import STUDY

STATE = Path(".snakemake", "gyriflow-run.json")
"""Where, in a working directory, the state of its live or last run is."""
REPORT = Path("results", "report", "report.html")
BRAIN_FILES = {"surface": "surface/pial.surf.gii", "mesh": "mesh/brain.xdmf", "metrics": "metrics/metrics.csv"}
OF_BRAINS = ("brain", *BRAIN_FILES)
OF_RUNS = ("run", "brain", "folding", "surfaces", "metrics", "figures")
DONE, NOT_YET = "done", "-"


class Status(NamedTuple):
    """What is known of a study: lines on its run, a table of brains, a table of runs, and the report if it is there."""

    run: list[str]
    brains: list[list[str]]
    runs: list[list[str]]
    report: Path | None


def status(directory: Path) -> Status:
    """Returns how far the study in a working directory is; InputError where there is none."""
    results = directory / "results"
    state = run_state(directory)
    configured = _configured(directory)
    if not results.is_dir() and state is None and not configured:
        raise InputError("holds no study", path=directory.resolve(), expected=f"results/ or {CONFIG} in it")
    brains = [
        [folder.name, *(DONE if (folder / file).is_file() else NOT_YET for file in BRAIN_FILES.values())]
        for folder in _folders(results / "brains")
    ]
    begun = {(run.name, folder.name) for run in _folders(results / "runs") for folder in _folders(run)}
    names = [*configured, *sorted(begun - set(configured))]
    runs = [_row(run, results / "runs" / run / brain) for run, brain in names]
    report = directory / REPORT
    return Status(_lines(directory, state), brains, runs, report if report.is_file() else None)


def as_duration(seconds: float) -> str:
    """Return a duration in words, no more exact than an estimate is."""
    if seconds < 90:
        return f"{max(5 * round(seconds / 5), 5)} s"
    if seconds < 90 * 60:
        return f"{round(seconds / 60)} min"
    return f"{seconds / 3600:.1f} h" if seconds < 36 * 3600 else f"{seconds / 86400:.1f} days"


def at_week(step: Mapping[str, Any]) -> str:
    """Return how far a folding is, by one of its events."""
    return f"GW {step['week']:.2f} of {step['end_week']:g}"


def _configured(directory: Path) -> list[tuple[str, str]]:
    """Returns the runs, each with its start brain, of the configuration whose results a working directory has."""
    path = directory / CONFIG
    # what is wrong with a configuration is for the command that runs it to say
    with suppress(InputError):
        if (record := directory / STUDY).is_file():
            path = Path(read_json(record)["configuration"][-1])
        if path.is_file():
            return resolve(load(read_yaml(path), path.resolve().parent)).pairs
    return []


def run_state(directory: Path) -> dict[str, Any] | None:
    """Returns what the live or last run left of its state, or None where no run did."""
    try:
        return read_json(directory / STATE)
    except InputError:
        return None


def is_live(directory: Path) -> bool:
    """Returns whether a run works in a directory at this moment."""
    if not (directory / ".snakemake" / "gyriflow.lock").is_file():
        return False
    # a directory that cannot be written has no run of this user
    with suppress(StorageError):
        lock = hold_lock(directory)
        if lock is None:
            return True
        lock.close()
    return False


def _lines(directory: Path, state: dict[str, Any] | None) -> list[str]:
    live = is_live(directory)
    if state is None:
        return ["a run is live" if live else "nothing is running"]
    steps = f"{state['done']} of {state['total']} steps done"
    left = f", about {as_duration(state['left_s'])} left" if live and state["left_s"] is not None else ""
    if live:
        lines = [f"running since {state['began']}: {steps}{left}"]
        lines += [f"  now: {job}" for job in state["running"]]
    elif state["interrupted"]:
        lines = [f"interrupted at {state['ended']}, {steps}; the same command goes on"]
    elif state["ended"] is None:
        lines = [f"interrupted: the run of {state['began']} ended without notice, {steps}; the same command goes on"]
    else:
        lines = [f"last run: {state['began']} to {state['ended']}, {steps}"]
    for failure in state["failed"]:
        lines.append(f"  failed: {failure['what']}: {failure['why']}")
        lines += [f"          log: {log}" for log in failure["logs"]]
    if state["details"]:
        lines.append(f"  details: {state['details']}")
    return lines


def _row(run: str, folder: Path) -> list[str]:
    made = ("surfaces/week-*/pial.surf.gii", "metrics/week-*/metrics.csv", "figures/*.png")
    counts = [len(list(folder.glob(pattern))) for pattern in made]
    return [run, folder.name, _folding(folder), *(str(count) if count else NOT_YET for count in counts)]


def _folding(folder: Path) -> str:
    """Returns how far a folding is: `done, GW 23.00`, `GW 21.43 of 23`, or that it has not begun."""
    with suppress(InputError, KeyError, IndexError):
        return f"{DONE}, GW {week_tag(read_json(folder / 'folding' / 'summary.json')['weeks'][-1])}"
    steps = [event for event in events_in(read_log(folder / "logs" / "simulate.jsonl")) if event["event"] == "step"]
    return at_week(steps[-1]) if steps else NOT_YET


def _folders(folder: Path) -> list[Path]:
    return sorted(path for path in folder.iterdir() if path.is_dir()) if folder.is_dir() else []


def as_text(found: Status) -> Iterator[str]:
    """Yields the lines of a status."""
    yield from found.run
    for head, rows in ((OF_BRAINS, found.brains), (OF_RUNS, found.runs)):
        if rows:
            yield "\n" + tabulate(rows, head, tablefmt="plain", disable_numparse=True)
    if found.report:
        yield f"\nreport: {found.report.absolute()}"


def as_json(found: Status) -> str:
    """Returns a status as JSON, for programs: a mapping for each brain and each run."""
    brains = [dict(zip(OF_BRAINS, row, strict=True)) for row in found.brains]
    runs = [dict(zip(OF_RUNS, row, strict=True)) for row in found.runs]
    report = str(found.report or "")
    return json.dumps(
        {"run": found.run, "brains": brains, "runs": runs, "report": report}, indent=2, ensure_ascii=False
    )


def report_of(directory: Path) -> Path:
    """Returns the report of the study in a working directory; InputError where it has none."""
    for report in (directory / REPORT, directory / "report" / REPORT.name):
        if report.is_file():
            return report.absolute()
    raise InputError(
        "has no report yet", path=directory.resolve(), expected=str(REPORT), remedy="Run the study first: gyriflow run"
    )
