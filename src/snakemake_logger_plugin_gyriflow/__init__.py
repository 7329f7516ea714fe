"""Snakemake's logger plugin `gyriflow`: a quiet terminal (`--logger gyriflow`), the default of `./run snakemake`."""

import logging
import sys
import threading
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from snakemake_interface_logger_plugins.base import LogHandlerBase
from snakemake_interface_logger_plugins.common import LogEvent
from snakemake_interface_logger_plugins.settings import LogHandlerSettingsBase

LOOK_EVERY_S = 1.0
OPTION = {"env_var": False, "required": False}
NOTHING_TO_DO = "Nothing to be done"
INTERRUPTED = ("Terminating processes on user request", "Cancelling snakemake on user request")
OF_FAILED_JOBS = (
    "Exiting because a job execution failed",
    "At least one job did not complete successfully",
    "WorkflowError:\nAt least one job did not complete successfully",
    "RuleException:",
    "CalledProcessError",
)
"""How Snakemake's further messages on a failed job begin, some before and some after it; its log says more."""


@dataclass
class LogHandlerSettings(LogHandlerSettingsBase):
    """The plugin's options, `--logger-gyriflow-details FILE` and `--logger-gyriflow-plan FILE`."""

    details: str = field(
        default="", metadata=OPTION | {"help": "File for all that Snakemake says, besides its own log"}
    )
    plan: str = field(default="", metadata=OPTION | {"help": "File for the jobs of a dry run, as JSON"})


class LogHandler(LogHandlerBase):
    """Turns Snakemake's records into the few lines of a `RunDisplay`."""

    def __post_init__(self) -> None:
        # every job's process imports this module, and few need more of it
        from snakemake.logging import DefaultFormatter

        from gyriflow.cli.cost import typical_seconds
        from gyriflow.cli.terminal import STATE, RunDisplay, stages
        from gyriflow.shipped import SHIPPED

        settings = self.settings if isinstance(self.settings, LogHandlerSettings) else LogHandlerSettings()
        details = settings.details
        self.plan_file = settings.plan
        self.planned: list[dict[str, Any]] = []
        self.file = logging.FileHandler(details) if details else None
        if self.file:
            self.file.setFormatter(DefaultFormatter(self.common_settings.quiet, show_failed_logs=True))
        stage_of = stages(SHIPPED / "workflow" / "rules")
        self.display = RunDisplay(sys.stderr, stage_of, typical_seconds(), details or None)
        # the details are in .snakemake/log of the working directory, which is not the current one yet
        self.state_file = Path(details).parents[2] / STATE if details else None
        self.cores: int | None = None
        self.of_failed_jobs: list[str] = []
        self.ended = threading.Event()
        self.watch = threading.Thread(target=self._look, daemon=True)
        self.watch.start()

    def _look(self) -> None:
        while not self.ended.wait(LOOK_EVERY_S):
            with self.lock:  # type: ignore[union-attr]  # made by logging.Handler
                self.display.tick()
                self._save_state()

    def _save_state(self) -> None:
        """Leaves how far the run is for `gyriflow status`; a full disk is the steps' to report."""
        from gyriflow.errors import StorageError
        from gyriflow.io.files import write_json

        if self.state_file and self.display.total:
            with suppress(StorageError):
                write_json(self.state_file, self.display.state())

    def emit(self, record: logging.LogRecord) -> None:
        """Hands a record on, to the file as it is and to the terminal where a reader needs it."""
        try:
            if self.file and record.levelno >= logging.INFO and getattr(record, "event", None) != LogEvent.SHELLCMD:
                self.file.emit(record)
            self._tell(record)
        except Exception:
            self.handleError(record)

    def _tell(self, record: logging.LogRecord) -> None:
        said: dict[str, Any] = vars(record)
        if self.plan_file:
            if said.get("event") == LogEvent.JOB_INFO:
                job = {name: said[name] for name in ("threads", "reason")}
                wildcards, output = dict(said["wildcards"] or {}), list(said["output"])
                self.planned.append(job | {"rule": said["rule_name"], "wildcards": wildcards, "output": output})
            return
        match said.get("event"):
            case LogEvent.RESOURCES_INFO if said.get("cores"):
                self.cores = int(said["cores"])
            case LogEvent.RUN_INFO:
                jobs = said.get("stats") or {}
                self.display.plan({rule: count for rule, count in jobs.items() if rule != "total"}, self.cores)
            case LogEvent.JOB_INFO:
                log = next(iter(said["log"]), None)
                self.display.job_begins(said["jobid"], said["rule_name"], said["wildcards"] or {}, said["output"], log)
            case LogEvent.JOB_FINISHED:
                self.display.job_ends(said["job_id"])
            case LogEvent.JOB_ERROR:
                otherwise = str(said["rule_msg"] or "\n".join(self.of_failed_jobs))
                self.of_failed_jobs.clear()
                self.display.job_fails(said["jobid"], said["rule_name"], said["log"], otherwise)
            case LogEvent.PROGRESS:
                self.display.progress(said["done"], said["total"])
            case _:
                self._pass_on(record)

    def _pass_on(self, record: logging.LogRecord) -> None:
        """Passes warnings and errors on; those of failed jobs are kept for the case that no job is named."""
        text = record.getMessage().strip()
        if text.startswith(NOTHING_TO_DO):
            self.display.up_to_date = True
        elif text.startswith(INTERRUPTED):
            self.display.interrupted = True
        elif record.levelno >= logging.WARNING and text:
            if text.startswith(OF_FAILED_JOBS):
                self.of_failed_jobs.append(text)
            else:
                self.display.message(text)

    def close(self) -> None:
        """Says how the run ended."""
        if not self.ended.is_set():
            self.ended.set()
            if self.plan_file:
                from gyriflow.io.files import write_json

                write_json(self.plan_file, self.planned)
            # a terminal that is gone has nobody who reads
            with suppress(OSError, ValueError):
                if not self.display.failed and not self.display.interrupted:
                    for text in self.of_failed_jobs:
                        self.display.message(text)
                self.display.end()
            self._save_state()
            if self.file:
                self.file.close()
        super().close()

    @property
    def writes_to_stream(self) -> bool:
        """It takes the place of Snakemake's own messages on the terminal, but for those of a dry run."""
        return not self.plan_file

    # it chooses by itself, writes its own lines, and its file is none of Snakemake's logs
    has_filter = has_formatter = True
    writes_to_file = needs_rulegraph = False
