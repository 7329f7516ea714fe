"""Messages of steps as data: warnings and errors, one JSON object a line, in a file
beside the step's log. Time and memory of the step, and the progress of a simulation are
in the same file."""

import json
import logging
import traceback
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass
from operator import attrgetter
from pathlib import Path
from typing import Any

from .errors import GyriflowError

INTERRUPTED = 130
KILLED = 137
"""Exit codes of programs that were interrupted or killed."""
STOPPED = "it was stopped"
OUT_OF_MEMORY = "it was killed, most probably because memory ran out"
OWN_LOGGERS = ("root", "gyriflow", "__main__")
FOLDERS = {"brains": ["brain"], "runs": ["run", "brain"]}
"""What the folders around a log name, by folder in `results`."""
REPORT_STEP = "html_report"


@dataclass(frozen=True)
class Message:
    """A warning or an error of a step.

    `text` is what people read: the file, the problem, what was found and expected, and
    a remedy. An error also has these one by one, as far as they are known, and its exit
    code. Step, brain and run are those of the log, "" if not applicable.
    """

    level: str
    text: str
    step: str = ""
    brain: str = ""
    run: str = ""
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
    if isinstance(error, GyriflowError):
        return Message(
            "error",
            str(error),
            exit_code=error.exit_code,
            **error.facts,
        )
    if isinstance(error, KeyboardInterrupt):
        return Message("error", STOPPED, exit_code=INTERRUPTED)
    if isinstance(error, MemoryError):
        cause = f" ({error})" if str(error) else ""
        text = f"memory ran out{cause}. Free memory, or run fewer jobs at once"
        return Message("error", text, exit_code=KILLED)
    raised = "".join(traceback.format_exception_only(error)).strip()
    return Message("error", f"unexpected {raised}", exit_code=1)


def messages_file(log: str | Path) -> Path:
    """Return the file of the messages of the step that has this log."""
    return Path(log).with_suffix(".jsonl")


def place_of(log: Path) -> dict[str, str]:
    """Return the step, brain and run of a log with a path in `results`, "" if not
    applicable."""
    place = {"step": log.stem, "brain": "", "run": ""}
    if log.parts[0] == "results":
        _, kind, *names = log.parts
        place |= zip(
            FOLDERS.get(kind, []),
            names,
            strict=False,
        )
    return place


def write_message(log: str | Path, message: Message) -> None:
    """Add a message to those of the step that has this log, a path in `results`."""
    row = asdict(message) | place_of(Path(log))
    known = {name: value for name, value in row.items() if value}
    write_event(log, known)


def write_event(log: str | Path, row: Mapping[str, Any]) -> None:
    """Add a line to those of the step that has this log; one that is no message has the
    key `event`."""
    with messages_file(log).open("a", encoding="utf-8") as file:
        file.write(json.dumps(row) + "\n")


def read_events(log: str | Path) -> list[dict[str, Any]]:
    """Return the lines that the step with this log has written, messages and
    events."""
    rows = []
    # a step may have written none yet
    with suppress(OSError):
        for line in messages_file(log).read_text(encoding="utf-8").splitlines():
            # a full disk may leave half a line
            with suppress(ValueError):
                rows.append(json.loads(line))
    return rows


def read_messages(log: str | Path) -> list[Message]:
    """Return the distinct messages of the step that has this log."""
    return messages_in(read_events(log))


def messages_in(rows: Iterable[Mapping[str, Any]]) -> list[Message]:
    """Return the distinct messages among the lines that a step has written."""
    messages = []
    for row in rows:
        # progress, and lines of another version, have other keys
        with suppress(TypeError):
            messages.append(Message(**row))
    return list(dict.fromkeys(messages))


def messages_files(directory: Path, since_s: float = 0.0) -> list[Path]:
    """Return the files of messages in a working directory that were written after a
    time (s since the epoch), the first one first."""
    written = []
    for path in (directory / "results").rglob("*.jsonl"):
        time_s = path.stat().st_mtime
        if time_s >= since_s:
            written.append((time_s, path))
    return [path for _, path in sorted(written)]


def study_messages(directory: Path, since_s: float = 0.0) -> list[Message]:
    """Return the messages of the steps of a working directory that wrote any after a
    time (s since the epoch), the first step first."""
    messages = []
    for path in messages_files(directory, since_s):
        messages += read_messages(path)
    return messages


def reported_messages(
    directory: Path,
    brains: Iterable[str],
    runs: Iterable[Iterable[str]],
) -> list[Message]:
    """Return the messages of a study, of some of its brains, and of some (run, brain)
    pairs, by run, brain and step; without those of the report, which shows them."""
    places = {
        ("", ""),
        *(("", brain) for brain in brains),
        *map(tuple, runs),
    }
    found = []
    for message in study_messages(directory):
        is_known = (message.run, message.brain) in places
        if is_known and message.step != REPORT_STEP:
            found.append(message)
    return sorted(found, key=attrgetter("run", "brain", "step"))


class MessageHandler(logging.Handler):
    """Writes the warnings, errors and progress that a step logs to its messages, which
    begin empty. Those of libraries stay in the log.

    A record with the attribute `data`, a `Message` or an event, is written as that.
    """

    def __init__(self, log: str | Path) -> None:
        super().__init__()
        self.log = log
        messages_file(log).write_text("", encoding="utf-8")

    def emit(self, record: logging.LogRecord) -> None:
        """Write a record."""
        data = getattr(record, "data", None)
        is_own = record.name.partition(".")[0] in OWN_LOGGERS
        if data is None and is_own and record.levelno >= logging.WARNING:
            data = Message(record.levelname.lower(), record.getMessage())
        try:
            if isinstance(data, Message):
                write_message(self.log, data)
            elif data:
                write_event(self.log, data)
        except OSError:
            self.handleError(record)
