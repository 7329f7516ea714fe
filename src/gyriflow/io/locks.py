"""Locks of files between processes, if the file system has them."""

import sys
from typing import IO

if sys.platform == "win32":
    import msvcrt
    import time
else:
    import fcntl

UNLOCKABLE: set[str] = set()
"""Files that could not be locked, since their file system has no locks."""


def lock_file(file: IO, *, wait: bool = False) -> bool:
    """Lock an open file until it is closed (`wait` for it, or return False); without
    locks, warn once and go on."""
    try:
        _lock(file, wait)
    except BlockingIOError:
        return False
    except OSError as error:
        if not UNLOCKABLE:
            problem = (
                f"this file system has no locks ({error.strerror}): start one run in a"
                " folder at a time"
            )
            print(
                f"gyriflow: warning: {file.name}: {problem}",
                file=sys.stderr,
            )
        UNLOCKABLE.add(file.name)
    return True


if sys.platform == "win32":

    def _lock(file: IO, wait: bool) -> None:
        # of the first byte; its own waiting gives up after ten seconds
        file.seek(0)
        while True:
            try:
                msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
                return
            except PermissionError:
                if not wait:
                    raise BlockingIOError from None
            time.sleep(0.1)

else:

    def _lock(file: IO, wait: bool) -> None:
        fcntl.flock(
            file,
            fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB),
        )
