"""Display a run on the terminal: progress bar, remaining time, warnings, failures, and
how it ended."""

import logging
import re
import time
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any, TextIO

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from ..errors import StorageError
from ..grouping import Kinds, counted
from ..io.files import write_json
from ..messages import (
    KILLED,
    OUT_OF_MEMORY,
    STOPPED,
    Message,
    messages_file,
    messages_in,
    read_events,
    read_messages,
    write_message,
)
from .cost import job_seconds
from .launch import full_disk, received_signals, session
from .status import REPORT_PAGE, STATE, format_duration, format_progress

SIGNAL_S = 0.2
"""Time to notice a signal."""
PERCENT_PER_LINE = 5
"""Without a terminal, a line is printed in place of the bar each time this much more is
done."""
SLURM = re.compile(
    r"SLURM-job '(\d+)' failed.*SLURM status is: '(?!FAILED)(\w+)'", re.DOTALL
)
SIGNAL = re.compile(r"died with <Signals\.(\w+)")
SIGNAL_CAUSES = {
    "SIGKILL": OUT_OF_MEMORY,
    **dict.fromkeys(("SIGTERM", "SIGINT", "SIGHUP"), STOPPED),
}
FAILED_JOB_PREFIXES = (
    "Exiting because a job execution failed",
    "At least one job did not",
    "WorkflowError:\nAt least one job did not",
    "RuleException:",
    "CalledProcessError",
)
"""Beginnings of Snakemake's messages about a failed job. The job's own log has the
cause."""


@dataclass
class RunningJob:
    """A running job with its predicted time and its log, beside which are its
    messages."""

    name: str
    seconds: float
    began: float
    log: Path | None
    step: dict[str, Any] | None = None


def _seconds(rule: str, wildcards: Mapping[str, str]) -> float:
    """Predict the time of a job, or return 1 for a workflow that is no study's."""
    return job_seconds(session.study, rule, wildcards) if session.study else 1.0


class RunDisplay:
    """Display of a run, driven by Snakemake's log records: lines, with a bar below them
    if the stream is a terminal."""

    def __init__(
        self,
        stream: TextIO,
        details: Path,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.console = Console(
            file=stream,
            markup=False,
            highlight=False,
            soft_wrap=True,
        )
        self.live = self.console.is_terminal and not self.console.is_dumb_terminal
        percent = TextColumn("{task.percentage:3.0f} %")
        running = TextColumn("{task.description}", markup=False)
        columns = percent, BarColumn(20), TimeRemainingColumn(), running
        self.bar = Progress(
            *columns,
            console=self.console,
            transient=True,
            disable=not self.live,
            get_time=clock,
        )
        self.bar.speed_estimate_period = 1e6
        self.bar.add_task("", total=None)
        (self.task,) = self.bar.tasks
        self.clock, self.details = clock, details
        # details are in .snakemake/log of the working directory
        self.state_file = details.parents[2] / STATE
        self.began = datetime.now()
        self.ended: datetime | None = None
        self.running: dict[int, RunningJob] = {}
        self.work_done = 0.0
        self.done = self.total = self.next_percent = 0
        self.n_failed = 0
        self.messages = Kinds()
        self.sizes: set[str] = set()
        self.failure_messages: list[str] = []
        self.has_errors = False

    def watch(self, lock: AbstractContextManager) -> None:
        """Follow the jobs and record the state of the run for `gyriflow status`, until
        it ends."""
        while self.ended is None:
            with lock:
                self.tick()
            time.sleep(1.0)

    def show(self, record: logging.LogRecord) -> None:
        """Display a log record of Snakemake's."""
        event = vars(record)
        self.has_errors |= record.levelno >= logging.ERROR
        match event.get("event"):
            case "run_info":
                jobs = dict(event["stats"] or {})
                jobs.pop("total", None)
                self.total = sum(jobs.values())
                works = [_seconds(job.rule, job.wildcards) for job in session.jobs]
                self.bar.update(self.task.id, total=sum(works) or self.total)
                n_steps = counted(self.total, "step")
                self.console.print(f"gyriflow: {n_steps} to run; log: {self.details}")
                self.bar.start()
            case "job_info":
                wildcards = dict(event["wildcards"] or {})
                log = Path(event["log"][0]) if event["log"] else None
                if log:
                    # those of an earlier try
                    messages_file(log).unlink(missing_ok=True)
                rule = event["rule_name"]
                self.running[event["jobid"]] = RunningJob(
                    " ".join([rule, *wildcards.values()]),
                    _seconds(rule, wildcards),
                    self.clock(),
                    log,
                )
            case "job_finished" if job := self.running.pop(event["job_id"], None):
                self._follow(job)
                self.work_done += job.seconds
            case "job_error":
                # a signal to all processes may have ended a job before it is noticed
                # here
                time.sleep(SIGNAL_S)
                # an interrupted job has not failed
                if not received_signals:
                    self._show_failure(event)
            case "progress":
                self.done, self.total = event["done"], event["total"]
            case _:
                text = record.getMessage().strip()
                if text.startswith("Nothing to be done"):
                    self.console.print("gyriflow: everything is up to date")
                elif record.levelno >= logging.WARNING and text.startswith(
                    FAILED_JOB_PREFIXES
                ):
                    self.failure_messages.append(text)
                elif record.levelno >= logging.WARNING and text:
                    self.console.print(text)

    def _show_failure(self, event: Mapping[str, Any]) -> None:
        job = self.running.pop(event["jobid"], None)
        if job is not None:
            self._follow(job)
        reason = self._cause(event)
        name = job.name if job else event["rule_name"]
        self.n_failed += 1
        line = f"failed  {name}: {reason}"
        if self.messages.add(name, line):
            self.console.print(
                "\n        ".join([line, *(f"log: {log}" for log in event["log"])])
            )

    def _cause(self, event: Mapping[str, Any]) -> str:
        """Return the error of a failed job: its own, or else what Snakemake says of its
        end, which is then added to its messages."""
        text = str(event["rule_msg"] or "\n".join(self.failure_messages))
        self.failure_messages.clear()
        # further ones are those of a cluster
        log = event["log"][0]
        errors = [row for row in read_messages(log) if row.level == "error"]
        slurm, signal = SLURM.search(text), SIGNAL.search(text)
        ended = ""
        if slurm:
            ended = f"Slurm ended job {slurm[1]}: {slurm[2]}"
        elif signal:
            crash = f"it crashed ({signal[1]}): please report this with its log"
            ended = SIGNAL_CAUSES.get(signal[1], crash)
        elif errors:
            return errors[0].text
        # Snakemake's text of it shows the shell command
        elif "CalledProcessError" not in text:
            ended = text
        ended = ended or full_disk(Path())
        if not ended and messages_file(log).exists():
            ended = OUT_OF_MEMORY
        ended = ended or f"it left no message in its log; see the end of {self.details}"
        code = KILLED if ended == OUT_OF_MEMORY else None
        # a disk may be full
        with suppress(OSError):
            write_message(log, Message("error", ended, exit_code=code))
        return ended

    def tick(self) -> None:
        """Read the progress of running jobs; update the bar and the recorded state."""
        done, running = self.work_done, []
        for job in self.running.values():
            self._follow(job)
            running.append(
                job.name + (f": {format_progress(job.step)}" if job.step else "")
            )
            if job.step:
                since = self.clock() - job.began
                share = since / max(since + job.step["left_s"], 1e-9)
                done += job.seconds * share
        self.bar.update(
            self.task.id,
            completed=max(done, self.task.completed),
            description="; ".join(running),
        )
        left = self.task.time_remaining
        if running and not self.live and self.task.percentage >= self.next_percent:
            self.next_percent = int(self.task.percentage) + PERCENT_PER_LINE
            remaining = f"{format_duration(left)} left  " if left else ""
            self.console.print(
                f"{self.task.percentage:3.0f} %  {remaining}{'; '.join(running)}"
            )
        if self.total:
            ended = f"{self.ended:%F %T}" if self.ended else None
            state = {
                "began": f"{self.began:%F %T}",
                "ended": ended,
                "left_s": left,
                "running": running,
                "done": self.done,
                "total": self.total,
                "interrupted": bool(received_signals),
                "details": str(self.details),
            }
            # the steps report a full disk
            with suppress(StorageError):
                write_json(self.state_file, state)

    def end(self) -> None:
        """Print how the run ended and where the report is."""
        self.ended = datetime.now()
        self.tick()
        self.bar.stop()
        for line in self.messages.others():
            self.console.print(line)
        took = format_duration((self.ended - self.began).total_seconds())
        done = f"{self.done} of {self.total} steps done"
        if received_signals:
            # the launcher says that it was interrupted
            self.console.print(f"gyriflow: {done} after {took}")
        elif self.n_failed:
            failed = f"finished after {took} with {self.n_failed} failed"
            self.console.print(
                f"gyriflow: {failed}, {done}; run the same command again to resume"
            )
        elif self.failure_messages:
            self.console.print("\n".join(self.failure_messages))
        elif self.total and not self.has_errors:
            report = (
                f"; report: {REPORT_PAGE.absolute()}" if REPORT_PAGE.is_file() else ""
            )
            # with `--until`, some steps are left
            steps = "" if self.done == self.total else f", {done}"
            self.console.print(f"gyriflow: done in {took}{steps}{report}")

    def _follow(self, job: RunningJob) -> None:
        """Show what a job has written to its messages since."""
        if job.log is None:
            return
        rows = read_events(job.log)
        for row in rows:
            match row:
                case {
                    "event": "size",
                    "elements": elements,
                    "ranks": ranks,
                    "memory_mib": mib,
                }:
                    on = counted(ranks, "rank")
                    size = (
                        f"       {job.name}: {elements} elements, {on}, about {mib} MiB"
                    )
                    if size not in self.sizes:
                        self.sizes.add(size)
                        self.console.print(size)
                case {"event": "step"}:
                    job.step = row
        for message in messages_in(rows):
            line = f"warning {job.name}: {message.first_line}"
            if message.level == "warning" and self.messages.add(job.name, line):
                self.console.print(line)
