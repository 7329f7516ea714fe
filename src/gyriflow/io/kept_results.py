"""Results that later calls of a user need again: JSON files in the cache folder, each
named by all that it was made from."""

import os
from contextlib import suppress
from pathlib import Path
from typing import Any

from ..errors import InputError, StorageError
from .files import read_json, write_json

MAX_KEPT = 20_000
"""How many results are kept, the latest used."""


def kept_result(key: str) -> Any:
    """Return the result that was kept under a key; None if there is none, or if it is
    damaged."""
    path = _path(key)
    with suppress(InputError, OSError, KeyError, TypeError, RuntimeError):
        result = read_json(path)["result"]
        # the latest used ones are kept
        os.utime(path)
        return result
    return None


def keep_result(key: str, result: Any) -> None:
    """Keep a plain result under a key, unless the folder cannot be written. Two
    processes may keep the same."""
    with suppress(StorageError, OSError, RuntimeError):
        path = _path(key)
        # results may contain names of subjects
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        write_json(path, {"result": result})


def remove_old_results() -> None:
    """Remove the results that were not used for longest, down to `MAX_KEPT`."""
    with suppress(OSError, RuntimeError):
        paths = list(_path("").parent.iterdir())
        if len(paths) > MAX_KEPT:
            paths.sort(key=lambda path: path.stat().st_mtime_ns)
            for path in paths[:-MAX_KEPT]:
                path.unlink(missing_ok=True)


def _path(key: str) -> Path:
    base = os.environ.get("XDG_CACHE_HOME")
    cache = Path(base or Path.home() / ".cache")
    return cache / "gyriflow" / "readings" / f"{key}.json"
