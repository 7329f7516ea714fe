"""The lines that a run writes on the terminal as its jobs begin, go on and end, and how long it will still take."""

import os
import re
import shutil
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from functools import cache
from pathlib import Path
from statistics import mean
from typing import Any, TextIO

from ..io.jobs import KILLED, GrowingFile, cause, events_in, messages_in, read_log
from ..step import KILLED as KILLED_CODE
from ..step import record_exit_code

MINUTE = 60.0
NO_RESULTS = "the configuration asks for no results of this stage"
QUIET = 5 * MINUTE
"""After so long without a word of it, a job that runs is named again, where no live line shows it."""
LEAST_SHARE = 0.05
"""No time left is given before this share of the expected time has passed: it would be a guess."""
CLEAR = "\r\x1b[K"
"""Goes to the beginning of the terminal's line and empties it."""
STATE = Path(".snakemake", "gyriflow-run.json")
"""Where, in a working directory, the state of its live or last run is."""
REPORT = Path("results", "report", "report.html")
OF_FILES = {
    "input": "inputs",
    "retrieve": "download",
    "validation": "validation",
    "onset": "validation",
    "validation_figures": "figures",
    "influence_figures": "figures",
    "study": "metrics",
    "regions": "metrics",
    "run_figures": "figures",
    "study_figures": "figures",
}
"""Stages of rule files that are not named after theirs."""
ORDER = (
    *("download", "inputs", "surface", "quality", "mesh", "growth", "registration", "folding", "metrics", "validation"),
    *("studies", "calibration", "figures", "report"),
)
"""Stages in the order in which data flow."""
DRAWN = "figures"
"""The stage of rules that stand in no file of rules: those of the registry of figures."""
RULE = re.compile(r"^(?:checkpoint|(?:use )?rule) (?:\w+ as )?(\w+)(?::| with:)", flags=re.MULTILINE)
"""The line on which a rule or a checkpoint begins."""
SLURM = re.compile(r"SLURM-job '(\d+)' failed.*SLURM status is: '(\w+)'", re.DOTALL)
"""How the executor for Slurm says in which state a job has ended."""
SIGNAL = re.compile(r"died with <Signals\.(\w+)")
"""How Snakemake says which signal has ended the program of a job."""
STATES = {
    "CANCELLED": "it was cancelled",
    "TIMEOUT": "its time ran out: more is given by --set-resources {rule}:runtime=MINUTES",
    "OUT_OF_MEMORY": "its memory ran out: more is given by --set-resources {rule}:mem_mb=MIB",
    "NODE_FAIL": "its node was lost",
    "BOOT_FAIL": "its node did not start",
    "DEADLINE": "its deadline passed",
}
"""What states of Slurm mean that say more than the job's log; a program that has failed by itself says why there."""


@cache
def stages(rules: Path) -> dict[str, str]:
    """Returns the stage of each rule in a folder of rule files: the file's, but a rule `…_figure` is of the figures."""
    found = {}
    for file in sorted(rules.glob("*.smk")):
        stage = OF_FILES.get(file.stem, file.stem)
        for name in RULE.findall(file.read_text()):
            found[name] = DRAWN if name.endswith("_figure") else stage
    return found


def where_of(wildcards: Mapping[str, str]) -> Mapping[str, str]:
    """Returns a job's wildcards, with the run and the brain in the place of the folder `where`."""
    if where := wildcards.get("where"):
        kind, *names = where.split("/")
        return {"brain": names[0]} if kind == "brains" else {"run": names[0], "brain": names[1]}
    return wildcards


def subject(wildcards: Mapping[str, str]) -> str:
    """Returns the brain or run that a job works on, by its wildcards; the study if they name none."""
    wildcards = where_of(wildcards)
    if {"earlier", "later"} <= set(wildcards):
        return f"brain {wildcards['earlier']} to {wildcards['later']}"
    if file := wildcards.get("file"):
        return Path(file).name
    parts = [f"{kind} {wildcards[kind]}" for kind in ("run", "brain") if kind in wildcards]
    return ", ".join(parts) or "study"


def ended_by_slurm(message: str, rule: str) -> str:
    """Returns what Slurm has done to a job, from the executor's message on it; empty where it did nothing."""
    found = SLURM.search(message)
    return f"Slurm job {found[1]}: {STATES[found[2]].format(rule=rule)}" if found and found[2] in STATES else ""


def ended_by_signal(message: str) -> str:
    """Returns what a signal has done to a job, from Snakemake's message on it; empty where it did nothing."""
    found = SIGNAL.search(message)
    crashed = f"it crashed ({found[1]}): please report this with its log" if found else ""
    return KILLED if found and found[1] == "SIGKILL" else crashed


def as_duration(seconds: float) -> str:
    """Returns a duration in words, no more exact than an estimate is."""
    if seconds < 90:
        return f"{max(5 * round(seconds / 5), 5)} s"
    if seconds < 90 * 60:
        return f"{round(seconds / 60)} min"
    return f"{seconds / 3600:.1f} h" if seconds < 36 * 3600 else f"{seconds / 86400:.1f} days"


Running = tuple[str, float, float | None]


@dataclass
class Pace:
    """What jobs of each rule take, in seconds: as measured elsewhere, and as measured in this run.

    `typical` is what jobs took in earlier runs; a rule that it does not know takes as long as the middle of those it
    knows. Jobs that wait are given as {rule: number of jobs}; those that run as (rule, seconds since it began, seconds
    left as the job itself says or None).
    """

    typical: Mapping[str, float]
    taken: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))

    def expected(self, rule: str) -> float:
        """Returns what a job of a rule is likely to take, in seconds."""
        if rule in self.taken:
            return mean(self.taken[rule])
        known = sorted(self.typical.values())
        middle = known[len(known) // 2] if known else 1.0
        usual = sum(len(times) * self.typical.get(other, middle) for other, times in self.taken.items())
        slowness = sum(map(sum, self.taken.values())) / usual if usual > 0 else 1.0
        return self.typical.get(rule, middle) * slowness

    def ahead(self, waiting: Mapping[str, int], running: Sequence[Running]) -> tuple[float, float]:
        """Returns the seconds that all jobs are likely to take yet, and those of the longest one that runs."""
        left = [max(self.expected(rule) - since, 0.0) if own is None else own for rule, since, own in running]
        waits = sum(count * self.expected(rule) for rule, count in waiting.items())
        return sum(left) + waits, max(left, default=0.0)

    def share(self, waiting: Mapping[str, int], running: Sequence[Running] = ()) -> float:
        """Returns the share of the expected time of all jobs that has passed."""
        spent = sum(map(sum, self.taken.values())) + sum(since for _, since, _ in running)
        whole = spent + self.ahead(waiting, running)[0]
        return spent / whole if whole > 0 else 0.0


@dataclass
class Job:
    """A job that has begun."""

    rule: str
    stage: str
    subject: str
    outputs: Sequence[str]
    began: float
    told: float
    log: GrowingFile | None
    progress: GrowingFile | None
    step: dict[str, Any] | None = None

    @property
    def what(self) -> str:
        """The stage and what it works on, as one phrase."""
        return f"{self.stage}, {self.subject}"

    @property
    def now(self) -> str:
        """What the job is at."""
        return self.what + (f": {at_week(self.step)}" if self.step else "")

    @property
    def brief(self) -> str:
        """The same in a few words."""
        about = self.subject.replace("run ", "").replace("brain ", "").replace(", ", "/")
        return f"{self.stage} {about}" + (f" GW {self.step['week']:.1f}" if self.step else "")


@dataclass
class RunDisplay:
    """What a run tells, written to a stream: a line a stage and subject, weeks, warnings, failures, and the end.

    On a terminal a last line, which is written over, shows what is running; elsewhere no control codes are written.

    It knows the stages of rules, what their jobs usually take (s), and the file with all `details`.
    """

    stream: TextIO
    stage_of: Mapping[str, str]
    typical_s: Mapping[str, float]
    details: str | None = None
    clock: Callable[[], float] = time.monotonic
    began: float = field(init=False)

    def __post_init__(self) -> None:
        self.began = self.clock()
        self.live = self.stream.isatty() and os.environ.get("TERM") != "dumb"
        self.live_shown = False
        self.waiting: Counter[str] = Counter()
        self.running: dict[int, Job] = {}
        self.pace = Pace(self.typical_s)
        self.cores = 1
        self.done = self.total = self.percent = 0
        self.failed: list[dict[str, Any]] = []
        self.began_at = _now()
        self.ended_at: str | None = None
        self.errors = 0
        self.told: set[tuple[str, ...]] = set()
        self.report: str | None = None
        self.up_to_date = self.interrupted = False

    def plan(self, jobs: Mapping[str, int], cores: int | None) -> None:
        """Says how much is to be done."""
        self.waiting = Counter({rule: count for rule, count in jobs.items() if rule != "all"})
        self.total = sum(jobs.values())
        self.cores = cores or self.cores
        steps = f"{self.total} step{'s' if self.total != 1 else ''}"
        self.line(f"gyriflow: {steps} to do" + (f"; all details: {self.details}" if self.details else ""))

    def job_begins(
        self, number: int, rule: str, wildcards: Mapping[str, str], outputs: Sequence[str], log: str | None
    ) -> None:
        """Takes note of a job, and names its stage and subject when they are new."""
        if not outputs:
            return
        stage, about = self.stage_of.get(rule, DRAWN), subject(wildcards)
        now, path = self.clock(), Path(log).absolute() if log else None
        files = (GrowingFile(path), GrowingFile(path.with_suffix(".jsonl"))) if path else (None, None)
        self.running[number] = Job(rule, stage, about, outputs, now, now, *files)
        self.waiting[rule] -= 1
        if (stage, about) not in self.told:
            self.told.add((stage, about))
            self.line(self._row(stage, about))
        self.refresh()

    def job_ends(self, number: int) -> None:
        """Takes note of a job that is done, after its last warnings."""
        job = self.running.get(number)
        if job is None:
            return
        self._follow(job)
        del self.running[number]
        self.pace.taken[job.rule].append(self.clock() - job.began)
        self.report = next((path for path in job.outputs if Path(path).name == REPORT.name), self.report)

    def job_fails(self, number: int, rule: str, logs: Sequence[str], otherwise: str = "") -> None:
        """Says what failed and why, after its last warnings; `otherwise` is told where the job's log is silent."""
        job = self.running.pop(number, None)
        if self.interrupted:
            # it was stopped
            return
        if job is not None:
            self._follow(job)
        what = job.what if job else rule
        text = "".join(map(read_log, logs))
        by_others = ended_by_slurm(otherwise, rule) or ended_by_signal(otherwise)
        why = by_others or cause(text) or otherwise or "it left no message"
        if why == KILLED:
            record_exit_code(KILLED_CODE)
        self.failed.append({"what": what, "why": why, "logs": [str(Path(log).absolute()) for log in logs]})
        first, *rest = why.splitlines()
        self.line(f"failed  {what}: {first}")
        for more in (*rest, *(f"log: {log}" for log in logs)):
            self.line(f"        {more}")

    def progress(self, done: int, total: int) -> None:
        """Takes note of how many steps are done."""
        self.done, self.total = done, total
        self.refresh()

    def message(self, text: str) -> None:
        """Passes on a warning or an error that is of no job."""
        self.errors += 1
        self.line(text)

    def tick(self) -> None:
        """Looks at the logs of running jobs: new warnings, weeks of foldings."""
        for job in list(self.running.values()):
            self._follow(job)
        self.refresh()

    def end(self) -> None:
        """Says how it ended, and where the report is."""
        self._clear()
        self.ended_at = _now()
        took = as_duration(self.clock() - self.began)
        if self.interrupted:
            self.line(f"gyriflow: stopped after {took}, {self.done} of {self.total} steps are done")
        elif self.failed:
            count, left = len(self.failed), self.total - self.done
            self.line(
                f"gyriflow: {count} step{'s' if count > 1 else ''} failed after {took}, {left} "
                f"{'are' if left > 1 else 'is'} not done; once the cause is mended, the same command goes on from here"
            )
        elif self.up_to_date:
            self.line("gyriflow: everything is up to date" + _place(REPORT))
        elif self.total and self.done == self.total and not self.errors and not self.told:
            self.line(f"gyriflow: nothing was to be done: {NO_RESULTS}")
        elif self.total and self.done == self.total and not self.errors:
            self.line(f"gyriflow: done in {took}" + (_place(Path(self.report)) if self.report else ""))

    def state(self) -> dict[str, Any]:
        """Returns how far the run is, in plain types."""
        return {
            "began": self.began_at,
            "ended": self.ended_at,
            "done": self.done,
            "total": self.total,
            "left_s": self.time_left() if self.total else None,
            "running": [job.now for job in self.running.values()],
            "failed": self.failed,
            "interrupted": self.interrupted,
            "details": self.details,
        }

    def line(self, text: str) -> None:
        """Writes a line above the live one."""
        self._clear()
        self.stream.write(text + "\n")
        self.stream.flush()

    def refresh(self) -> None:
        """Writes the live line anew, where the stream is a terminal."""
        if not self.live or not self.total:
            return
        left = self.time_left()
        text = f"{self._share()}  " + (f"{as_duration(left)} left  " if left is not None else "")
        text += ", ".join(job.brief for job in self.running.values())
        self._clear()
        self.stream.write(text[: shutil.get_terminal_size().columns - 1])
        self.stream.flush()
        self.live_shown = True

    def time_left(self) -> float | None:
        """Returns the seconds left of the run, or None as long as that would be a guess."""
        if self.pace.share(self.waiting) < LEAST_SHARE:
            return None
        ahead, longest = self.pace.ahead(self.waiting, self._on_their_way())
        return max(ahead / max(self.cores, 1), longest)

    def _on_their_way(self) -> list[Running]:
        now = self.clock()
        return [(job.rule, now - job.began, job.step["left_s"] if job.step else None) for job in self.running.values()]

    def _follow(self, job: Job) -> None:
        """Tells what a job has said since the last look: warnings, and of a folding its size and weeks."""
        before = job.step
        for event in events_in(job.progress.new_text()) if job.progress else ():
            match event:
                case {"event": "warning", "message": str(text)}:
                    self._warn(job, text)
                case {"event": "size", "elements": elements, "unknowns": unknowns, "ranks": ranks, "memory_mib": mib}:
                    size = f"{elements} elements, {unknowns} unknowns, {ranks} ranks, about {mib} MiB"
                    self.line(self._row(job.stage, f"{job.subject}: {size}"))
                case {"event": "step"}:
                    job.step = event
        for message in messages_in(job.log.new_text()) if job.log else ():
            if message.own and message.level == "warning":
                self._warn(job, message.text.partition("\n")[0])
        now, step = self.clock(), job.step
        silent = now - job.told if not self.live else 0.0
        if step is not None and step != before:
            new_week = before is not None and int(step["week"] + 1e-6) > int(before["week"] + 1e-6)
            if new_week or silent > MINUTE:
                job.told = now
                left = f", {as_duration(step['left_s'])} left of this run" if step["left_s"] >= 1 else ""
                self.line(self._row(job.stage, f"{job.subject}: {at_week(step)}{left}"))
        elif silent > QUIET:
            job.told = now
            self.line(self._row(job.stage, f"{job.subject}: running for {as_duration(now - job.began)}"))

    def _warn(self, job: Job, text: str) -> None:
        if ("warning", job.subject, text) not in self.told:
            self.told.add(("warning", job.subject, text))
            self.line(f"warning {job.what}: {text}")

    def _row(self, stage: str, text: str) -> str:
        left = None if self.live else self.time_left()
        rest = f"  (about {as_duration(left)} left in all)" if left is not None else ""
        return f"{self._share()}  {stage:<12} {text}{rest}"

    def _share(self) -> str:
        """Returns how far the run is, by the time that its jobs take; it never goes back."""
        if self.total and self.done == self.total:
            self.percent = 100
        elif self.total:
            self.percent = max(self.percent, min(int(100 * self.pace.share(self.waiting, self._on_their_way())), 99))
        return f"{self.percent:3d} %"

    def _clear(self) -> None:
        if self.live_shown:
            self.stream.write(CLEAR)
            self.live_shown = False


def at_week(step: Mapping[str, Any]) -> str:
    """Returns how far a folding is, by one of its events."""
    return f"GW {step['week']:.2f} of {step['end_week']:g}"


def _place(report: Path) -> str:
    """Returns where the report is, as the end of a sentence; nothing where there is none."""
    return f"; report: {report.absolute()}" if report.is_file() else ""


def _now() -> str:
    return f"{datetime.now():%Y-%m-%d %H:%M:%S}"
