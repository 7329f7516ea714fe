"""Processes below a program that a test started, and their end."""

import os
import signal
import subprocess
import time
from contextlib import suppress
from pathlib import Path


def ran(
    *command, timeout_s: float = 300, **options
) -> subprocess.CompletedProcess[str]:
    """Run a program to its end and return how it ended, with what it printed."""
    return subprocess.run(
        command,
        capture_output=True,
        text=True,
        timeout=timeout_s,
        check=False,
        **options,
    )


def below(pid: int) -> list[int]:
    """Return the ids of all processes that a process started, and of those that these
    did."""
    listed = ran("pgrep", "-P", str(pid)).stdout
    children = [int(child) for child in listed.split()]
    return children + [other for child in children for other in below(child)]


def command_of(pid: int) -> list[str]:
    """Return the words of a process' command line, none where it has ended."""
    with suppress(OSError):
        return Path(f"/proc/{pid}/cmdline").read_text().split("\0")[:-1]
    return []


def all_end(pids: list[int], within_s: float = 10) -> bool:
    """Return whether processes end in time."""
    deadline = time.monotonic() + within_s
    while any(map(command_of, pids)) and time.monotonic() < deadline:
        time.sleep(0.05)
    return not any(map(command_of, pids))


def kill(pids: list[int]) -> None:
    """Kill processes, and return once they have ended."""
    for pid in pids:
        with suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)
    all_end(pids)
