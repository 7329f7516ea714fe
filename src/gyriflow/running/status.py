"""Progress of a study, read from its working directory: the live or last run, and the
results so far."""

from collections.abc import Iterator, Mapping
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from typing import Any

from tabulate import tabulate

from ..errors import InputError, StorageError
from ..io.files import read_json
from ..messages import INTERRUPTED, messages_files, read_events, read_messages
from ..shipped import CONFIG
from ..study.paths import PLAN
from ..study.records import Simulation
from ..study.tables import read_rows
from ..units import week_tag
from .launch import hold_lock

STATE = Path(".snakemake", "gyriflow-run.json")
"""State of the live or last run, in the working directory."""
REPORT_PAGE = Path("results", "report", "report.html")
BRAIN_RESULTS = {
    "surface": "surface/pial.surf.gii",
    "mesh": "mesh/brain.xdmf",
    "metrics": "metrics/metrics.csv",
}
RUN_RESULTS = {
    "surfaces": "surfaces/week-*/pial.surf.gii",
    "metrics": "metrics/week-*/metrics.csv",
    "figures": "figures/*.png",
}
MISSING = "-"


def status(directory: Path) -> Iterator[str]:
    """Yield lines about the progress of the study in a working directory; InputError if
    there is none."""
    results, state = directory / "results", None
    with suppress(InputError):
        state = read_json(directory / STATE)
    planned = _planned(directory)
    if not results.is_dir() and state is None and not (directory / CONFIG).is_file():
        raise InputError(
            "contains no study",
            path=directory.resolve(),
            expected=f"results/ or {CONFIG} in it",
        )
    is_live = False
    # this user has no run in a directory that cannot be written
    with suppress(StorageError):
        if (directory / ".snakemake" / "gyriflow.lock").is_file():
            lock = hold_lock(directory)
            is_live = lock is None
            if lock:
                lock.close()
    yield from _lines(directory, state, is_live)
    brains = [
        {"brain": folder.name}
        | {
            name: "done" if (folder / file).is_file() else MISSING
            for name, file in BRAIN_RESULTS.items()
        }
        for folder in _folders(results / "brains")
    ]
    started = {
        (run.name, folder.name)
        for run in _folders(results / "runs")
        for folder in _folders(run)
    }
    runs = [
        _row(run, results / "runs" / run / brain)
        for run, brain in [*planned, *sorted(started - set(planned))]
    ]
    for rows in (brains, runs):
        if rows:
            yield "\n" + tabulate(
                rows,
                headers="keys",
                tablefmt="plain",
                disable_numparse=True,
            )
    if (directory / REPORT_PAGE).is_file():
        yield f"\nreport: {(directory / REPORT_PAGE).absolute()}"


def format_duration(seconds: float) -> str:
    """Format a duration, rounded as an estimate."""
    if seconds < 90:
        return f"{max(5 * round(seconds / 5), 5)} s"
    if seconds < 90 * 60:
        return f"{round(seconds / 60)} min"
    return (
        f"{seconds / 3600:.1f} h"
        if seconds < 36 * 3600
        else f"{seconds / 86400:.1f} days"
    )


def format_progress(step: Mapping[str, Any]) -> str:
    """Format the progress of a simulation from one of its step events."""
    return f"GW {step['week']:.2f} of {step['end_week']:g}"


def _planned(directory: Path) -> list[tuple[str, str]]:
    """Return run and start brain of each planned simulation of `runs`."""
    # there is no plan before the first run, or one of another version
    with suppress(InputError, ValueError, KeyError):
        simulations = read_rows(directory / PLAN / "simulations.csv", Simulation)
        return [row.key for row in simulations if not row.may_diverge]
    return []


def _lines(
    directory: Path,
    state: dict[str, Any] | None,
    live: bool,
) -> Iterator[str]:
    if state is None:
        yield "a run is in progress" if live else "nothing is running"
        return
    steps = f"{state['done']} of {state['total']} steps done"
    if live:
        left = (
            f", about {format_duration(state['left_s'])} left"
            if state["left_s"] is not None
            else ""
        )
        yield f"running since {state['began']}: {steps}{left}"
        yield from (f"  running: {job}" for job in state["running"])
    elif state["interrupted"]:
        yield (
            f"interrupted at {state['ended']}, {steps}; run the same command again to"
            " resume"
        )
    elif state["ended"] is None:
        yield (
            f"interrupted: the run of {state['began']} ended abruptly, {steps}; run the"
            " same command again to resume"
        )
    else:
        yield f"last run: {state['began']} to {state['ended']}, {steps}"
    began_s = datetime.fromisoformat(state["began"]).timestamp()
    for path in messages_files(directory, began_s):
        for message in read_messages(path):
            if message.level == "error" and message.exit_code != INTERRUPTED:
                place = message.step, message.run, message.brain
                job = " ".join(filter(None, place))
                yield f"  failed: {job}: {message.text}"
                yield f"          log: {path.with_suffix('.log').absolute()}"
    yield f"  details: {state['details']}"


def _row(run: str, folder: Path) -> dict[str, str]:
    counts = {
        name: str(len(list(folder.glob(pattern))) or MISSING)
        for name, pattern in RUN_RESULTS.items()
    }
    return {
        "run": run,
        "brain": folder.name,
        "folding": _simulation_progress(folder),
    } | counts


def _simulation_progress(folder: Path) -> str:
    with suppress(InputError, KeyError, IndexError):
        summary = read_json(folder / "folding" / "summary.json")
        return f"done, GW {week_tag(summary['weeks'][-1])}"
    events = read_events(folder / "logs" / "simulate.log")
    steps = [event for event in events if event.get("event") == "step"]
    return format_progress(steps[-1]) if steps else MISSING


def _folders(folder: Path) -> list[Path]:
    paths = folder.iterdir() if folder.is_dir() else []
    return sorted(path for path in paths if path.is_dir())
