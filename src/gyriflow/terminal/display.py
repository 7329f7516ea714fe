"""The lines that a run writes on the terminal, as its jobs begin, go on and end."""

import os
import shutil
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any, TextIO

from .logs import FoldingStep, GrowingLog, cause, ended_by_slurm, last_step, size_in, warnings_in
from .stages import subject
from .time_left import LEAST_SHARE, Pace, as_duration, as_seconds

MINUTE = 60.0
CLEAR = "\r\x1b[K"
"""Goes to the beginning of the terminal's line and empties it."""
STATE = Path(".snakemake", "gyriflow-run.json")
"""Where, in a working directory, the state of its live or last run is."""
USUAL_REPORT = Path("results", "report", "report.html")


@dataclass
class Job:
    """A job that has begun."""

    rule: str
    stage: str
    subject: str
    outputs: Sequence[str]
    began: float
    log: GrowingLog | None
    step: FoldingStep | None = None
    told: float = 0.0

    @property
    def what(self) -> str:
        """The stage and what it works on, as one phrase."""
        return f"{self.stage}, {self.subject}"

    @property
    def now(self) -> str:
        """What the job is at."""
        return self.what + (f": GW {self.step.week:.2f} of {self.step.end_week:g}" if self.step else "")

    @property
    def brief(self) -> str:
        """The same in a few words."""
        about = self.subject.replace("run ", "").replace("brain ", "").replace(", ", "/")
        return f"{self.stage} {about}" + (f" GW {self.step.week:.1f}" if self.step else "")


@dataclass
class RunDisplay:
    """What a run tells, written to a stream: a line a stage and subject, weeks, warnings, failures, and the end.

    On a terminal a last line, which is written over, shows what is running; elsewhere no control codes are written.

    Parameters
    ----------
    stream
        Where lines are written.
    stage_of : {rule: stage}
        Stages of the rules.
    typical_s : {rule: seconds}
        What jobs of a rule usually take.
    details
        The file that holds everything else, named at the beginning and where something fails.
    clock
        Seconds; another one in tests.
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
        self.waiting: Counter[str] = Counter()
        self.running: dict[int, Job] = {}
        self.pace = Pace(self.typical_s)
        self.cores = 1
        self.done = self.total = 0
        self.failed: list[dict[str, Any]] = []
        self.began_at = _now()
        self.ended_at: str | None = None
        self.errors = 0
        self.told: set[tuple[str, ...]] = set()
        self.report: str | None = None
        self.up_to_date = self.interrupted = False
        self._live_shown = False

    # --- what happens -----------------------------------------------------------------------------------------

    def plan(self, jobs: Mapping[str, int], cores: int | None) -> None:
        """Says how much is to be done."""
        self.waiting = Counter({rule: count for rule, count in jobs.items() if rule in self.stage_of})
        self.total = sum(jobs.values())
        self.cores = cores or self.cores
        steps = f"{self.total} step{'s' if self.total != 1 else ''}"
        self.line(f"gyriflow: {steps} to do" + (f"; all details: {self.details}" if self.details else ""))

    def job_begins(
        self, number: int, rule: str, wildcards: Mapping[str, str], outputs: Sequence[str], log: str | None
    ) -> None:
        """Takes note of a job, and names its stage and subject when they are new."""
        if rule not in self.stage_of or not outputs:
            return
        stage, about = self.stage_of[rule], subject(wildcards)
        self.running[number] = Job(
            rule, stage, about, outputs, self.clock(), GrowingLog(Path(log).absolute()) if log else None
        )
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
        self.pace.finished(job.rule, self.clock() - job.began)
        self.report = next((path for path in job.outputs if Path(path).name == USUAL_REPORT.name), self.report)

    def job_fails(self, number: int, rule: str, logs: Sequence[str], otherwise: str = "") -> None:
        """Says what failed and why, after its last warnings; `otherwise` is told where the job's log is silent."""
        job = self.running.pop(number, None)
        if self.interrupted:
            # it was stopped
            return
        if job is not None:
            self._follow(job)
        what = job.what if job else rule
        text = "".join(GrowingLog(Path(log)).all_text() for log in logs)
        why = ended_by_slurm(otherwise, rule) or cause(text) or otherwise or "it left no message"
        self.failed.append({"what": what, "why": why, "logs": [str(Path(log).absolute()) for log in logs]})
        first, *rest = why.splitlines()
        self.line(f"failed  {what}: {first}")
        for more in rest:
            self.line(f"        {more}")
        for log in logs:
            self.line(f"        log: {log}")

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
            self.line("gyriflow: everything is up to date" + _place(USUAL_REPORT))
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

    # --- how it is written ------------------------------------------------------------------------------------

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
        self._live_shown = True

    def time_left(self) -> float | None:
        """Returns the seconds left of the run, or None as long as that would be a guess."""
        if self.pace.share_done(self.waiting) < LEAST_SHARE:
            return None
        now = self.clock()
        running = [
            (job.rule, now - job.began, as_seconds(job.step.left) if job.step else None)
            for job in self.running.values()
        ]
        return self.pace.left(self.waiting, running, self.cores)

    def _follow(self, job: Job) -> None:
        text = job.log.new_text() if job.log else ""
        for warning in warnings_in(text):
            if ("warning", job.subject, warning) not in self.told:
                self.told.add(("warning", job.subject, warning))
                self.line(f"warning {job.what}: {warning}")
        if size := size_in(text):
            self.line(self._row(job.stage, f"{job.subject}: {size}"))
        before, job.step = job.step, last_step(text) or job.step
        if job.step is None or job.step == before:
            return
        new_week = before is not None and int(job.step.week + 1e-6) > int(before.week + 1e-6)
        overdue = not self.live and self.clock() - max(job.told, job.began) > MINUTE
        if new_week or overdue:
            job.told = self.clock()
            self.line(
                self._row(
                    job.stage,
                    f"{job.subject}: GW {job.step.week:.2f} of {job.step.end_week:g}, {job.step.left} left of this run",
                )
            )

    def _row(self, stage: str, text: str) -> str:
        left = None if self.live else self.time_left()
        rest = f"  (about {as_duration(left)} left in all)" if left is not None else ""
        return f"{self._share()}  {stage:<12} {text}{rest}"

    def _share(self) -> str:
        return f"{100 * self.done // self.total if self.total else 0:3d} %"

    def _clear(self) -> None:
        if self._live_shown:
            self.stream.write(CLEAR)
            self._live_shown = False


def _place(report: Path) -> str:
    """Returns where the report is, as the end of a sentence; nothing where there is none."""
    return f"; report: {report.absolute()}" if report.is_file() else ""


def _now() -> str:
    return f"{datetime.now():%Y-%m-%d %H:%M:%S}"
