"""What a run writes on the terminal: a bar with the time left and what is running, warnings, failures and the end."""

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
from ..io.files import write_json
from ..step import KILLED as KILLED_CODE
from ..step import record_exit_code
from .jobs import KILLED, GrowingFile, cause, events_in, messages_in, read_log
from .status import REPORT, STATE, as_duration, at_week

WEIGHTS = {"simulate": 40.0, "simulate_member": 20.0, "tetrahedralise": 15.0, "register": 7.0, "validation": 7.0}
"""How much longer than most the jobs of some rules take, for the bar and the time left."""
EVERY_PERCENT = 5
"""Where there is no terminal, a line each so many percent takes the place of the bar."""
SLURM = re.compile(r"SLURM-job '(\d+)' failed.*SLURM status is: '(?!FAILED)(\w+)'", re.DOTALL)
SIGNAL = re.compile(r"died with <Signals\.(\w+)")
ENDED_BY = {"SIGKILL": KILLED, **dict.fromkeys(("SIGTERM", "SIGINT", "SIGHUP"), "it was stopped")}
INTERRUPTED = ("Terminating processes on user request", "Cancelling snakemake on user request")
OF_FAILED_JOBS = (
    *("Exiting because a job execution failed", "At least one job did not", "WorkflowError:\nAt least one job did not"),
    *("RuleException:", "CalledProcessError"),
)
"""How Snakemake's further messages on a failed job begin, some before and some after it; its log says more."""


@dataclass
class Job:
    """A job that is running, with the files that it writes."""

    rule: str
    what: str
    began: float
    log: Path | None
    events: GrowingFile | None
    step: dict[str, Any] | None = None


class RunDisplay:
    """The display of a run by Snakemake's log records: lines, and below them a bar where the stream is a terminal."""

    def __init__(self, stream: TextIO, details: Path, clock: Callable[[], float] = time.monotonic) -> None:
        self.console = Console(file=stream, markup=False, highlight=False, soft_wrap=True)
        self.live = self.console.is_terminal and not self.console.is_dumb_terminal
        percent, running = TextColumn("{task.percentage:3.0f} %"), TextColumn("{task.description}", markup=False)
        columns = percent, BarColumn(20), TimeRemainingColumn(), running
        self.bar = Progress(*columns, console=self.console, transient=True, disable=not self.live, get_time=clock)
        self.bar.speed_estimate_period = 1e6
        self.bar.add_task("", total=None)
        (self.task,) = self.bar.tasks
        self.clock, self.details = clock, details
        # details are in .snakemake/log of the working directory
        self.state_file = details.parents[2] / STATE
        self.began = datetime.now()
        self.ended: datetime | None = None
        self.running: dict[int, Job] = {}
        self.work_done = 0.0
        self.done = self.total = self.next_percent = 0
        self.failed: list[dict[str, Any]] = []
        self.warned: set[tuple[str, str]] = set()
        self.of_failed_jobs: list[str] = []
        self.interrupted = False

    def watch(self, lock: AbstractContextManager) -> None:
        """Follow the jobs, and keep the state of the run for `gyriflow status`, until the run ends."""
        while self.ended is None:
            with lock:
                self.tick()
            time.sleep(1.0)

    def show(self, record: logging.LogRecord) -> None:
        """Show what a record of Snakemake's says."""
        said = vars(record)
        match said.get("event"):
            case "run_info":
                jobs = {rule: count for rule, count in (said["stats"] or {}).items() if rule != "total"}
                self.total = sum(jobs.values())
                self.bar.update(self.task.id, total=sum(count * WEIGHTS.get(rule, 1) for rule, count in jobs.items()))
                self.console.print(f"gyriflow: {self.total} steps to do; details in {self.details}")
                self.bar.start()
            case "job_info":
                wildcards = " ".join((said["wildcards"] or {}).values())
                log = Path(said["log"][0]).absolute() if said["log"] else None
                events = GrowingFile(log.with_suffix(".jsonl")) if log else None
                what = f"{said['rule_name']} {wildcards}".strip()
                self.running[said["jobid"]] = Job(said["rule_name"], what, self.clock(), log, events)
            case "job_finished" if job := self.running.pop(said["job_id"], None):
                self._tell_warnings(job)
                self.work_done += WEIGHTS.get(job.rule, 1.0)
            case "job_error":
                # what was stopped has not failed
                if not self.interrupted:
                    self._fail(said)
            case "progress":
                self.done, self.total = said["done"], said["total"]
            case _:
                text = record.getMessage().strip()
                self.interrupted |= text.startswith(INTERRUPTED)
                if text.startswith("Nothing to be done"):
                    self.console.print("gyriflow: everything is up to date")
                elif record.levelno >= logging.WARNING and text.startswith(OF_FAILED_JOBS):
                    self.of_failed_jobs.append(text)
                elif record.levelno >= logging.WARNING and text:
                    self.console.print(text)

    def _fail(self, said: Mapping[str, Any]) -> None:
        job = self.running.pop(said["jobid"], None)
        if job is not None:
            self._tell_warnings(job)
        message = str(said["rule_msg"] or "\n".join(self.of_failed_jobs))
        self.of_failed_jobs.clear()
        slurm, signal = SLURM.search(message), SIGNAL.search(message)
        if slurm:
            why = f"Slurm ended its job {slurm[1]}: {slurm[2]}"
        elif signal:
            why = ENDED_BY.get(signal[1], f"it crashed ({signal[1]}): please report this with its log")
        else:
            why = cause("".join(map(read_log, said["log"]))) or message or "it left no message"
        if why == KILLED:
            record_exit_code(KILLED_CODE)
        what = job.what if job else said["rule_name"]
        self.failed.append({"what": what, "why": why, "logs": [str(Path(log).absolute()) for log in said["log"]]})
        self.console.print("\n        ".join([f"failed  {what}: {why}", *(f"log: {log}" for log in said["log"])]))

    def tick(self) -> None:
        """Read what running jobs have written, and bring the bar and the state of the run up to date."""
        done, now = self.work_done, []
        for job in self.running.values():
            self._follow(job)
            now.append(job.what + (f": {at_week(job.step)}" if job.step else ""))
            if job.step:
                since = self.clock() - job.began
                done += WEIGHTS.get(job.rule, 1.0) * since / max(since + job.step["left_s"], 1e-9)
        self.bar.update(self.task.id, completed=max(done, self.task.completed), description="; ".join(now))
        left = self.task.time_remaining
        if now and not self.live and self.task.percentage >= self.next_percent:
            self.next_percent = int(self.task.percentage) + EVERY_PERCENT
            words = f"{as_duration(left)} left  " if left else ""
            self.console.print(f"{self.task.percentage:3.0f} %  {words}{'; '.join(now)}")
        if self.total:
            ended = f"{self.ended:%F %T}" if self.ended else None
            state: dict[str, Any] = {"began": f"{self.began:%F %T}", "ended": ended, "left_s": left, "running": now}
            state |= {"done": self.done, "total": self.total, "failed": self.failed, "interrupted": self.interrupted}
            state["details"] = str(self.details)
            # a full disk is the steps' to report
            with suppress(StorageError):
                write_json(self.state_file, state)

    def end(self) -> None:
        """Say how the run ended, and where the report is."""
        self.ended = datetime.now()
        self.tick()
        self.bar.stop()
        took = as_duration((self.ended - self.began).total_seconds())
        done = f"{self.done} of {self.total} steps done"
        if self.interrupted:
            self.console.print(f"gyriflow: stopped after {took}, {done}")
        elif self.failed:
            failed = f"finished after {took} with {len(self.failed)} failed"
            self.console.print(f"gyriflow: {failed}, {done}; run the same command again to resume")
        elif self.of_failed_jobs:
            self.console.print("\n".join(self.of_failed_jobs))
        elif self.total and self.done == self.total:
            report = f"; report: {REPORT.absolute()}" if REPORT.is_file() else ""
            self.console.print(f"gyriflow: done in {took}{report}")

    def _follow(self, job: Job) -> None:
        for event in events_in(job.events.new_text()) if job.events else ():
            match event:
                case {"event": "warning", "message": str(text)}:
                    self._warn(job, text)
                case {"event": "size", "elements": elements, "ranks": ranks, "memory_mib": mib}:
                    on = f"{ranks} rank{'s' if ranks > 1 else ''}"
                    self.console.print(f"       {job.what}: {elements} elements, {on}, about {mib} MiB")
                case {"event": "step"}:
                    job.step = event

    def _tell_warnings(self, job: Job) -> None:
        self._follow(job)
        for message in messages_in(read_log(job.log)) if job.log else ():
            if message.by_gyriflow and message.level == "warning":
                self._warn(job, message.text.partition("\n")[0])

    def _warn(self, job: Job, text: str) -> None:
        if (job.what, text) not in self.warned:
            self.warned.add((job.what, text))
            self.console.print(f"warning {job.what}: {text}")
