"""Keeps what programs print off the terminal: it goes to a file."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def prints_go_to(log: Path) -> Iterator[None]:
    """Has all that this process's libraries and children print go to the end of a file.

    Python's own `sys.stdout` and `sys.stderr` stay on the terminal, or wherever they were.
    """
    log.parent.mkdir(parents=True, exist_ok=True)
    before = sys.stdout, sys.stderr
    for stream in before:
        stream.flush()
    kept = [os.dup(1), os.dup(2)]
    # kept for those who own the log: it may hold names of subjects
    file = os.open(log, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o600)
    for number in (1, 2):
        os.dup2(file, number)
    os.close(file)
    # line by line, so that messages of both streams keep their order
    sys.stdout, sys.stderr = (os.fdopen(os.dup(number), "w", buffering=1, errors="replace") for number in kept)
    try:
        yield
    finally:
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
        for number, original in zip((1, 2), kept, strict=True):
            os.dup2(original, number)
            os.close(original)
        sys.stdout, sys.stderr = before
