"""Keeps what programs print off the terminal: it goes to a file."""

import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

OF_PROFILES = "for setting default command line arguments."
"""How the line ends that Snakemake prints of its profiles before any logger is there."""


class Terminal(io.TextIOWrapper):
    """A stream to the terminal that leaves Snakemake's line on its profiles to the log."""

    def __init__(self, number: int) -> None:
        # line by line, so that messages of both streams keep their order
        super().__init__(os.fdopen(number, "wb", buffering=0), line_buffering=True, errors="replace")
        self._left_out = False

    def write(self, text: str) -> int:
        """Writes a text, but for that line: it and the line break that `print` sends after it go to the log."""
        if text.endswith(OF_PROFILES) or (self._left_out and text == "\n"):
            self._left_out = text != "\n"
            # the standard error is the log here
            return os.write(2, text.encode())
        self._left_out = False
        return super().write(text)


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
    sys.stdout, sys.stderr = (Terminal(os.dup(number)) for number in kept)
    try:
        yield
    finally:
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
        for number, original in zip((1, 2), kept, strict=True):
            os.dup2(original, number)
            os.close(original)
        sys.stdout, sys.stderr = before
