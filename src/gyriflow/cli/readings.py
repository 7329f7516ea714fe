"""Read the files of many scans on all cores, and keep what was found in the user's
cache folder: reading a scan takes a second, at each call."""

import logging
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field
from functools import partial
from logging.handlers import BufferingHandler
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from ..code_hash import code_hash
from ..errors import GyriflowError, InputError, StorageError
from ..io.files import contents, read_json, write_json
from ..io.origins import joined_contents, origin_key
from ..running.machine import available_cores
from ..settings.schemes import SCHEME_FILES
from ..version import version

MIN_IN_POOL = 16
"""From so many scans on they are read by several processes, each of which takes two
seconds to start."""
PRELOADED = ("gyriflow.anatomy.labels", "gyriflow.io.volumes")
"""Modules with which label volumes are read."""
MAX_KEPT = 20_000
"""How many results are kept, the latest used."""


@dataclass(frozen=True)
class Reading:
    """The results of reading the files of a scan, until an `error` refused them;
    `warnings` are those of the log."""

    values: list[Any] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    error: str = ""


@dataclass(frozen=True)
class ScanFiles:
    """The files of a scan, and plain settings or models with which they are read."""

    files: Sequence[str]
    settings: tuple[Any, ...] = ()


def readings(
    read: Callable[..., Iterable[Any]], scans: Sequence[ScanFiles]
) -> list[Reading]:
    """Return what a function finds in the files of each scan.

    `read` is a function of a module. It takes the files of a scan and each of its
    settings, yields plain values, and raises GyriflowError for files that it refuses.
    What was found in the same files by the same code is not read again.
    """
    keys = _keys(read, scans)
    results: list[Reading | None] = [_kept(key) for key in keys]
    missing = [number for number, result in enumerate(results) if result is None]
    new = _on_all_cores(read, [scans[number] for number in missing])
    for number, result in zip(missing, new, strict=True):
        results[number] = result
        key = keys[number]
        if key is not None:
            _keep(key, result)
    if missing:
        _remove_old_results()
    return [result for result in results if result is not None]


def _keys(
    read: Callable[..., Iterable[Any]], scans: Sequence[ScanFiles]
) -> list[str | None]:
    """Return the key of what is found in each scan: of the contents and names of its
    files, its settings and the code; None if a file cannot be read."""
    schemes = [str(path) for path in SCHEME_FILES.values()]
    files = dict.fromkeys(schemes)
    for scan in scans:
        files |= dict.fromkeys(scan.files)
    found = joined_contents(contents(files, {}))
    module = Path(sys.modules[read.__module__].__file__ or "")
    code = [
        read.__module__,
        read.__name__,
        version(),
        code_hash(module, module),
    ]
    keys = []
    for scan in scans:
        origin = {
            "code": [*code, *schemes],
            # messages have the names of files
            "files": {path: path for path in scan.files},
            "settings": [_plain(value) for value in scan.settings],
        }
        keys.append(origin_key(origin, found))
    return keys


def _plain(value: Any) -> Any:
    return value.model_dump(mode="json") if isinstance(value, BaseModel) else value


def _kept(key: str | None) -> Reading | None:
    """Return the result that was kept under a key; None if there is none, or if it is
    damaged."""
    if key is None:
        return None
    # another program may have changed the file
    with suppress(InputError, OSError, KeyError, TypeError, RuntimeError):
        path = _kept_path(key)
        result = Reading(**read_json(path)["result"])
        # the latest used ones are kept
        os.utime(path)
        return result
    return None


def _keep(key: str, result: Reading) -> None:
    """Keep a result under a key, unless the folder cannot be written. Two processes may
    keep the same."""
    with suppress(StorageError, OSError, RuntimeError):
        path = _kept_path(key)
        # results may contain names of subjects
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        write_json(path, {"result": asdict(result)})


def _remove_old_results() -> None:
    """Remove the results that were not used for longest, down to `MAX_KEPT`."""
    with suppress(OSError, RuntimeError):
        paths = list(_kept_path("").parent.iterdir())
        if len(paths) > MAX_KEPT:
            paths.sort(key=lambda path: path.stat().st_mtime_ns)
            for path in paths[:-MAX_KEPT]:
                path.unlink(missing_ok=True)


def _kept_path(key: str) -> Path:
    base = os.environ.get("XDG_CACHE_HOME")
    cache = Path(base or Path.home() / ".cache")
    return cache / "gyriflow" / "readings" / f"{key}.json"


def _on_all_cores(
    read: Callable[..., Iterable[Any]],
    scans: Sequence[ScanFiles],
) -> list[Reading]:
    work = partial(_reading, read)
    cores = available_cores() if len(scans) >= MIN_IN_POOL else 1
    if cores < 2:
        return [work(scan) for scan in scans]
    # threads of libraries do not stand a fork of this process; one that has only
    # imported them does
    context = get_context("forkserver" if sys.platform == "linux" else "spawn")
    context.set_forkserver_preload([read.__module__, *PRELOADED])
    with ProcessPoolExecutor(cores, mp_context=context) as pool:
        return list(pool.map(work, scans))


def _reading(read: Callable[..., Iterable[Any]], scan: ScanFiles) -> Reading:
    """Return what a function finds in the files of a scan."""
    values: list[Any] = []
    error = ""
    with collected_warnings() as logged:
        try:
            for value in read(scan.files, *scan.settings):
                values.append(value)
        except GyriflowError as problem:
            error = str(problem)
    return Reading(
        values,
        [record.getMessage() for record in logged],
        error,
    )


@contextmanager
def collected_warnings() -> Iterator[list[logging.LogRecord]]:
    """Collect the warnings that readers log, which would be printed each time that a
    file is read."""
    logger, collector = logging.getLogger("gyriflow"), BufferingHandler(sys.maxsize)
    collector.setLevel(logging.WARNING)
    propagate = logger.propagate
    logger.addHandler(collector)
    logger.propagate = False
    try:
        yield collector.buffer
    finally:
        logger.removeHandler(collector)
        logger.propagate = propagate
