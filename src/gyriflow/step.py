"""Run a step of the workflow: its log, short error messages, its exit code, and the
time and memory that it took.

`python -m gyriflow.step CODE LOG` ends a failed shell step: it explains the exit code
and exits with it, or with 5 for a bus error.
"""

import logging
import os
import sys
import time
import traceback
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

import psutil

from .errors import GyriflowError, StorageError

EXIT_FILE = "GYRIFLOW_EXIT_FILE"
"""Environment variable with the path of the file for the first failed step's exit
code."""
INTERRUPTED = 130
KILLED = 137
KILLED_MESSAGE = (
    "gyriflow: the program was killed, most probably because memory ran out; see the"
    " memory predicted above"
)

BUS_ERROR_CODES = (7, 135)
"""Exit codes of mpiexec and of a shell for a program that a bus error stopped."""
SHARED_MEMORY_MESSAGE = (
    "gyriflow: the program was stopped by a bus error, most probably because /dev/shm"
    " is full: MPI needs 6 MB of it for each rank. In a container: --shm-size 1g"
)


def record_exit_code(code: int) -> None:
    """Record an exit code for the launcher, if there is one. The first of several
    failures counts."""
    path = os.environ.get(EXIT_FILE)
    if path:
        # the file exists if another step failed before; without it, Snakemake's own
        # code is used
        with suppress(OSError), Path(path).open("x") as file:
            file.write(str(code))


def recorded_exit_code(path: Path) -> int | None:
    """Return the exit code of the first failed step, or None if none was recorded."""
    with suppress(OSError, ValueError):
        return int(path.read_text())
    return None


class Usage(NamedTuple):
    """Wall time since a program began, CPU time and peak memory, those of its ended
    children included."""

    wall_s: float
    cpu_s: float
    memory_mib: float


USAGE_COLUMNS = ("wall_s", "cpu_s", "memory_MiB")
"""Columns of the table of a step's `Usage`."""


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
    """Write what a step has used to a table, which lies in the folder `benchmarks` next
    to that of its log."""
    log = Path(log)
    # no step of the workflow has its log elsewhere
    folder = next((folder for folder in log.parents if folder.name == "logs"), None)
    if folder is None:
        return
    path = folder.with_name("benchmarks") / log.relative_to(folder).with_suffix(".tsv")
    rows = ["\t".join(USAGE_COLUMNS), "\t".join(f"{value:.2f}" for value in used)]
    # a step that has made its results does not fail for this
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("\n".join(rows) + "\n")


@contextmanager
def step(log: str, *inputs: str) -> Iterator[None]:
    """Run a step and write its messages to the file `log`.

    A GyriflowError ends the program with its exit code and one message, on the terminal
    and in the log. Any other error ends it with a traceback. The message begins with
    the step's `inputs` if the error names no file.
    """
    form = "%(asctime)s %(levelname)s %(name)s: %(message)s"
    try:
        logging.basicConfig(
            level=logging.INFO, format=form, filename=log, filemode="w", force=True
        )
    except OSError as error:
        print(f"gyriflow: {log}: cannot be written: {error.strerror}", file=sys.stderr)
        record_exit_code(StorageError.exit_code)
        sys.exit(StorageError.exit_code)
    logging.captureWarnings(True)
    try:
        yield
    except (GyriflowError, MemoryError) as error:
        if isinstance(error, GyriflowError):
            message, code, named = str(error), error.exit_code, error.names_file
        else:
            message = (
                f"memory ran out ({error}). Free memory, or run fewer jobs at once"
            )
            code = KILLED
            named = False
        if inputs and not named:
            message = f"{', '.join(inputs)}: {message}"
        logging.error("%s", message)
        print(f"gyriflow: {message}", file=sys.stderr)
    except KeyboardInterrupt:
        code = INTERRUPTED
    except Exception:
        logging.exception("unexpected error")
        traceback.print_exc()
        code = 1
    else:
        record_usage(log, usage())
        return
    record_exit_code(code)
    sys.exit(code)


def _end_shell_step(code: int, log: str) -> int:
    message = ""
    if code == KILLED:
        message = KILLED_MESSAGE
    elif code in BUS_ERROR_CODES:
        message = SHARED_MEMORY_MESSAGE
        code = StorageError.exit_code
    if message:
        print(message, file=sys.stderr)
        with Path(log).open("a") as file:
            file.write(message + "\n")
    record_exit_code(code)
    return code


if __name__ == "__main__":
    sys.exit(_end_shell_step(int(sys.argv[1]), sys.argv[2]))
