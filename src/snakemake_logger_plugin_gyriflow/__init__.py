"""Snakemake's logger plugin `gyriflow`: a quiet terminal (`--logger gyriflow`), the
default of `./run snakemake`."""

import logging
import sys
import threading
from dataclasses import dataclass, field
from pathlib import Path

from snakemake_interface_logger_plugins.base import LogHandlerBase
from snakemake_interface_logger_plugins.settings import LogHandlerSettingsBase

OPTION = {
    "help": "File in .snakemake/log for all messages of Snakemake",
    "env_var": False,
    "required": True,
}


@dataclass
class LogHandlerSettings(LogHandlerSettingsBase):
    """The plugin's option, `--logger-gyriflow-details FILE`."""

    details: str = field(default="", metadata=OPTION)


class LogHandler(LogHandlerBase):
    """Write Snakemake's records to a file, and show them on the terminal."""

    def __post_init__(self) -> None:
        # every job's process imports this module, and few need more of it
        from snakemake.logging import DefaultFormatter

        from gyriflow.running.terminal import RunDisplay

        details = Path(getattr(self.settings, "details", ""))
        self.file = logging.FileHandler(details)
        self.file.setFormatter(
            DefaultFormatter(self.common_settings.quiet, show_failed_logs=True)
        )
        self.display = RunDisplay(sys.stderr, details)
        # the lock is held while a record is handled, too
        threading.Thread(
            target=self.display.watch,
            args=[self.lock],
            daemon=True,
        ).start()

    def emit(self, record: logging.LogRecord) -> None:
        """Hand a record on to the file and to the display."""
        try:
            if (
                record.levelno >= logging.INFO
                and getattr(record, "event", None) != "shellcmd"
            ):
                self.file.emit(record)
            self.display.show(record)
        except Exception:
            self.handleError(record)

    def close(self) -> None:
        """Say how the run ended."""
        if self.display.ended is None:
            self.display.end()
            self.file.close()
        super().close()

    # it chooses by itself, writes its own lines, and its file is none of Snakemake's
    # logs
    writes_to_stream = has_filter = has_formatter = True
    writes_to_file = needs_rulegraph = False
