"""Messages of steps as data: warnings and errors, one JSON object a line, in a file
beside the step's log. The progress of a simulation is in the same file."""

import json
import logging
import traceback
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from .errors import GyriflowError

INTERRUPTED = 130
KILLED = 137
"""Exit codes of programs that were interrupted or killed."""
STOPPED = "it was stopped"
FOLDERS = {"brains": ["brain"], "runs": ["run", "brain"]}
"""What the folders around a log name, by folder in `results`."""


@dataclass(frozen=True)
class Message:
    """A warning or an error of a step.

    `text` is what people read: the file, the problem, what was found and expected, and
    a remedy. An error also has these one by one, as far as they are known, and its exit
    code. `library` is the library that warns, "" for gyriflow. Step, brain and run are
    those of the log, "" if not applicable.
    """

    level: str
    text: str
    step: str = ""
    brain: str = ""
    run: str = ""
    library: str = ""
    file: str = ""
    found: str = ""
    expected: str = ""
    remedy: str = ""
    exit_code: int | None = None

    @property
    def first_line(self) -> str:
        return self.text.partition("\n")[0]


def error_message(error: BaseException) -> Message:
    """Return the message of an exception that ends a step; unexpected ones have exit
    code 1."""
    match error:
        case GyriflowError():
            code = error.exit_code
            return Message("error", str(error), **error.facts, exit_code=code)
        case MemoryError():
            remedy = "Free memory, or run fewer jobs at once"
            text = f"memory ran out ({error}). {remedy}"
            return Message("error", text, remedy=remedy, exit_code=KILLED)
        case KeyboardInterrupt():
            return Message("error", STOPPED, exit_code=INTERRUPTED)
    raised = traceback.format_exception_only(error)[-1].strip()
    return Message("error", f"unexpected {raised}", exit_code=1)


def messages_file(log: str | Path) -> Path:
    """Return the file of the messages of the step that has this log."""
    return Path(log).with_suffix(".jsonl")


def write_message(log: str | Path, message: Message) -> None:
    """Add a message to those of the step that has this log, a path in `results`."""
    path = Path(log)
    place = {"step": path.stem}
    if path.parts[0] == "results":
        place |= zip(FOLDERS.get(path.parts[1], []), path.parts[2:], strict=False)
    known = {name: value for name, value in asdict(message).items() if value}
    _append(log, known | place)


def read_messages(log: str | Path) -> list[Message]:
    """Return the distinct messages of the step that has this log."""
    names = {field.name for field in fields(Message)}
    messages = []
    for row in _rows(messages_file(log)):
        if "level" in row:
            messages.append(Message(**{name: row[name] for name in names & {*row}}))
    return list(dict.fromkeys(messages))


def read_progress(log: str | Path) -> list[dict[str, Any]]:
    """Return the events of the simulation that has this log: dictionaries with the key
    `event`."""
    return [row for row in _rows(messages_file(log)) if "event" in row]


def read_failures(directory: Path, since_s: float) -> list[Message]:
    """Return the errors of the steps in a working directory that failed after a time (s
    since the epoch), the first one first."""
    times = {}
    for path in (directory / "results").rglob("*.jsonl"):
        time_s = path.stat().st_mtime
        if time_s >= since_s:
            times[path] = time_s
    errors = []
    for path in sorted(times, key=times.__getitem__):
        errors += [row for row in read_messages(path) if row.level == "error"]
    return errors


class MessageHandler(logging.Handler):
    """Writes logged warnings, errors and progress to the messages of a step, which
    begin empty.

    A record with the attribute `data`, a `Message` or an event, is written as that.
    """

    def __init__(self, log: str | Path) -> None:
        super().__init__()
        self.log = log
        messages_file(log).write_text("")

    def emit(self, record: logging.LogRecord) -> None:
        """Write a record."""
        data = getattr(record, "data", None)
        try:
            if isinstance(data, Mapping):
                _append(self.log, data)
            elif record.levelno >= logging.WARNING and record.name != "py.warnings":
                write_message(self.log, data or _logged_message(record))
        except OSError:
            self.handleError(record)


def _logged_message(record: logging.LogRecord) -> Message:
    level = "error" if record.levelno >= logging.ERROR else "warning"
    is_own = record.name.partition(".")[0] in ("root", "gyriflow", "__main__")
    library = "" if is_own else record.name
    return Message(level, record.getMessage(), library=library)


def _append(log: str | Path, row: Mapping[str, Any]) -> None:
    with messages_file(log).open("a") as file:
        file.write(json.dumps(row) + "\n")


def _rows(path: Path) -> list[dict[str, Any]]:
    rows = []
    with suppress(OSError):
        for line in path.read_text().splitlines():
            # a full disk may leave half a line
            with suppress(ValueError):
                rows.append(json.loads(line))
    return rows
