"""Run a step of the workflow: its log, its messages, its exit code, and the time and
memory that it took.

`python -m gyriflow.step CODE LOG` ends a failed shell step: it explains the exit code
if the program has not, and exits with it, or with 5 for a bus error.
"""

import logging
import re
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import psutil

from .errors import StorageError
from .memory import collect_rarely
from .messages import (
    INTERRUPTED,
    KILLED,
    OUT_OF_MEMORY,
    STOPPED,
    Message,
    MessageHandler,
    error_message,
    place_of,
    read_events,
    read_messages,
    write_event,
    write_message,
)

BUS_ERROR = Message(
    "error",
    "the program was stopped by a bus error, most probably because /dev/shm is full:"
    " MPI needs 6 MB of it for each rank. In a container: --shm-size 1g",
    exit_code=StorageError.exit_code,
)
OUT_OF_MEMORY_MESSAGE = Message(
    "error",
    f"{OUT_OF_MEMORY}; see the memory predicted above",
    exit_code=KILLED,
)
ENDINGS = {
    # of mpiexec the numbers of signals, of a shell 128 more
    7: BUS_ERROR,
    9: OUT_OF_MEMORY_MESSAGE,
    128 + 7: BUS_ERROR,
    KILLED: OUT_OF_MEMORY_MESSAGE,
    INTERRUPTED: Message("error", STOPPED, exit_code=INTERRUPTED),
}
"""Messages of programs that could leave none, by their exit codes."""
N_LAST_LINES = 5
"""Lines at the end of a log that stand for the message of a program that has none."""


class Usage(NamedTuple):
    """Wall time since a program began, CPU time and peak memory, those of its ended
    children included."""

    wall_s: float
    cpu_s: float
    memory_mib: float


USAGE_COLUMNS = ("wall_s", "cpu_s", "memory_MiB")
"""Names of a step's `Usage` in its messages and in tables."""


def usage() -> Usage:
    """Return what this program has used, as the system counts it; on Windows without
    its children."""
    wall_s = time.time() - psutil.Process().create_time()
    if sys.platform == "win32":
        memory = psutil.Process().memory_info().peak_wset
        return Usage(wall_s, time.process_time(), memory / 2**20)
    import resource

    own = resource.getrusage(resource.RUSAGE_SELF)
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu_s = own.ru_utime + own.ru_stime + children.ru_utime + children.ru_stime
    # macOS counts bytes, Linux KiB
    per_mib = 2**20 if sys.platform == "darwin" else 2**10
    memory_mib = max(own.ru_maxrss, children.ru_maxrss) / per_mib
    return Usage(wall_s, cpu_s, memory_mib)


def record_usage(log: str | Path, used: Usage) -> None:
    """Add what a step has used to its messages."""
    values = [round(value, 2) for value in used]
    row = {"event": "usage"} | dict(zip(USAGE_COLUMNS, values, strict=True))
    # a step that has made its results does not fail for this
    with suppress(OSError):
        write_event(log, row)


def read_usage(directory: Path) -> list[dict[str, Any]]:
    """Return the rule, brain, run and `USAGE_COLUMNS` of the steps of a working
    directory that have ended; brain and run are "" if not applicable."""
    rows = []
    for path in sorted((directory / "results").rglob("logs/**/*.jsonl")):
        log = path.relative_to(directory)
        # wildcards follow the rule, after a dot
        rule = re.sub(r".*/logs/(\w+).*", r"\1", log.as_posix())
        for row in read_events(path):
            if row.get("event") == "usage":
                used = {name: float(row[name]) for name in USAGE_COLUMNS}
                rows.append(place_of(log) | {"rule": rule} | used)
    return rows


@contextmanager
def step(log: str, *inputs: str) -> Iterator[None]:
    """Run a step; write what it logs to the file `log`, and its warnings and errors to
    its messages.

    An error ends the program with its exit code and one message. It is in the log, with
    its traceback if it is unexpected; in the messages beside the log, from which
    `running/terminal.py` shows it; and on stderr, which a launched run keeps in
    `.snakemake/log`. The message of an error that names no file begins with the step's
    `inputs`.
    """
    collect_rarely()
    form = "%(asctime)s %(levelname)s %(name)s: %(message)s"
    handlers = [logging.FileHandler(log, mode="w"), MessageHandler(log)]
    logging.basicConfig(
        level=logging.INFO,
        format=form,
        handlers=handlers,
        force=True,
    )
    logging.captureWarnings(True)
    try:
        yield
    except (Exception, KeyboardInterrupt) as error:
        message = error_message(error)
        is_unexpected = message.exit_code == 1
        is_of_inputs = message.exit_code not in (1, INTERRUPTED)
        if inputs and is_of_inputs and not message.file:
            file = ", ".join(inputs)
            message = replace(
                message,
                text=f"{file}: {message.text}",
                file=file,
            )
        # `MessageHandler` writes `data` to the messages
        logging.error(
            "%s", message.text, exc_info=is_unexpected, extra={"data": message}
        )
        print(f"gyriflow: {message.text}", file=sys.stderr)
        sys.exit(message.exit_code)
    record_usage(log, usage())


def _end_shell_step(code: int, log: str) -> int:
    """Write the message of a failed program that has written none, and return the exit
    code of its step."""
    message = ENDINGS.get(code)
    if message:
        with Path(log).open("a") as file:
            print(f"gyriflow: {message.text}", file=file)
    elif any(row.level == "error" for row in read_messages(log)):
        return code
    else:
        lines = [
            line
            for line in Path(log).read_text(encoding="utf-8").splitlines()
            if line.strip()
        ]
        text = "\n".join(lines[-N_LAST_LINES:]) or f"it ended with exit code {code}"
        message = Message("error", text, exit_code=code)
    write_message(log, message)
    return message.exit_code or code


if __name__ == "__main__":
    sys.exit(_end_shell_step(int(sys.argv[1]), sys.argv[2]))
