"""When a program looks for memory that it does not need any more."""

import atexit
import gc
import os
import sys

NEW_OBJECTS = 50_000
"""Number of new objects after which Python looks for those that only refer to each
other."""
REPORTING = ("dolfinx", "igl")
"""Packages bound by nanobind, which reports all that is left at the end as leaks."""


def collect_rarely() -> None:
    """Let Python look for objects that only refer to each other rarely, and not at all
    when the program ends.

    Imports and plans make many objects and hardly any of these. With Python's own
    number a fifth of a check's time goes into looking for them, and up to a second at
    the end of each step, where the system takes back all memory anyway.
    """
    gc.set_threshold(NEW_OBJECTS)
    # what is registered first runs last
    atexit.register(_leave_to_the_system)


def _leave_to_the_system() -> None:
    gc.freeze()
    if any(name in sys.modules for name in REPORTING):
        sys.stderr.flush()
        os.closerange(2, 3)
