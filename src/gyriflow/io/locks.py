"""Locks of files between processes, if the file system has them."""

import fcntl
import sys
from typing import IO

UNLOCKABLE: set[str] = set()
"""Files that could not be locked, since their file system has no locks."""


def lock_file(file: IO, *, wait: bool = False) -> bool:
    """Lock an open file until it is closed (`wait` for it, or return False); without locks, warn once and go on."""
    try:
        fcntl.flock(file, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    except BlockingIOError:
        return False
    except OSError as error:
        if not UNLOCKABLE:
            problem = f"this file system has no locks ({error.strerror}): start one run in a folder at a time"
            print(f"gyriflow: warning: {file.name}: {problem}", file=sys.stderr)
        UNLOCKABLE.add(file.name)
    return True
