"""Files fetched from a server into a folder: each whole or not there, gone on with where a connection broke, checked.

The SHA-256 of each file is recorded on first use in `checksums.txt` of the folder, a registry in pooch's format.
"""

import fcntl
import gzip
import os
import shlex
import time
import zlib
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from gyriflow.errors import StorageError
from gyriflow.io.files import AnyPath, replaced

if TYPE_CHECKING:
    import requests

CHECKSUMS = "checksums.txt"
TRIES = 4
"""Tries that bring not a byte more than those before, after which a file is given up."""
FIRST_WAIT_S = 0.5
"""Wait before the second try; it doubles with each."""
TIMEOUT_S = (15.0, 60.0)
"""Longest wait for a connection, and for the next bytes."""
LINE_EVERY_S = 5.0
"""How often a long download says how far it is."""
CHUNK_BYTES = 1 << 16
BYTES_PER_MB = 1e6

Say = Callable[[str], None]


def fetch(folder: AnyPath, urls: Mapping[str, str], say: Say, optional: Collection[str] = ()) -> list[str]:
    """Fetches the files that a folder lacks and checks those that it has; returns the names of those fetched.

    Parameters
    ----------
    folder
        Made where it is missing.
    urls
        Where each file is to be had, by its path in the folder.
    say
        Is called with a line of progress.
    optional
        Files among them that the server may lack.

    Raises
    ------
    StorageError
        Where files are torn or not those recorded on first use (all of them named), the server cannot be reached, lacks
        files (named after all others are there) or sends something else, or the folder cannot be written. Files fetched
        before stay. What came of a broken one lies in a hidden `.NAME.part`, with which the next call goes on.
    """
    import pooch

    folder = Path(folder)
    pooch.get_logger().setLevel("WARNING")
    with _alone_in(folder):
        store = pooch.create(path=folder, base_url="", urls=dict(urls))
        if (folder / CHECKSUMS).is_file():
            with _refused(folder / CHECKSUMS):
                store.load_registry(folder / CHECKSUMS)
        present = [name for name in urls if (folder / name).is_file()]
        missing = [name for name in urls if name not in present]
        sums = _checked(folder, present, store.registry)
        if present:
            new = sum(name not in store.registry for name in present)
            say(f"{len(present)} of {len(urls)} files are there: {len(present) - new} as recorded, {new} recorded now")
        _record(folder, sums)
        absent = []
        for number, name in enumerate(missing, 1):
            say(f"{number} of {len(missing)}: {name}")
            store.registry.setdefault(name, None)
            part = (folder / name).with_name(f".{Path(name).name}.part")
            with _refused(folder / name, urls[name]):
                try:
                    store.fetch(name, downloader=partial(_download, part=part, say=say))
                except FileNotFoundError:
                    absent.append(name)
                    continue
            sums[name] = pooch.file_hash(str(folder / name))
            _record(folder, sums)
    lacking = [name for name in absent if name in optional]
    if lacking:
        say(f"the server has no {', '.join(lacking)}: not needed")
        missing = [name for name in missing if name not in lacking]
        absent = [name for name in absent if name not in lacking]
    if absent:
        raise StorageError(
            f"the server has no such file: {', '.join(urls[name] for name in absent)}",
            path=folder,
            remedy="All others are there. Take those out of the configuration, or give the address of another server.",
        )
    return missing


@contextmanager
def _alone_in(folder: Path) -> Iterator[None]:
    """Makes a folder and holds it, so that no two downloads write the same file."""
    with _refused(folder):
        folder.mkdir(parents=True, exist_ok=True)
        handle = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise StorageError("another download into this folder is running", path=folder) from None
        except OSError:  # a file system without locks, as some networks have
            pass
        yield
    finally:
        os.close(handle)


def _checked(folder: Path, names: Sequence[str], recorded: Mapping[str, str]) -> dict[str, str]:
    """Returns the checksums by name, those of new files added; StorageError names all that are changed or torn."""
    import pooch

    sums = {name: pooch.file_hash(str(folder / name)) for name in names}
    changed = [name for name in names if name in recorded and recorded[name] != sums[name]]
    torn = [name for name in names if name not in recorded and _what_is_wrong(folder / name)]
    if changed or torn:
        parts = [
            f"not as recorded on first use: {', '.join(changed)}" if changed else "",
            f"torn or something else: {', '.join(torn)}" if torn else "",
        ]
        raise StorageError(
            f"holds {len(changed + torn)} damaged or changed files",
            path=folder,
            found="; ".join(part for part in parts if part),
            expected=f"the checksums in {CHECKSUMS}" if changed else "whole GIFTI and NIfTI files",
            remedy="Delete the damaged ones and download again; where a change is meant, delete the file's line in "
            f"{CHECKSUMS}.",
        )
    return dict(recorded) | sums


def _record(folder: Path, sums: Mapping[str, str]) -> None:
    if sums:
        with replaced(folder / CHECKSUMS) as part:
            part.write_text("".join(f"{shlex.quote(name)} {sums[name]}\n" for name in sorted(sums)), encoding="utf-8")


def _download(url: str, output_file: str, _pooch: object, *, part: Path, say: Say) -> None:
    """Makes a file of a URL, as pooch asks its downloaders to; FileNotFoundError where the server has none.

    Bytes are gathered in `part`, which outlives a broken connection and this process.
    """
    import requests
    import urllib3

    # pooch makes it empty, and it would stay behind if this process were killed
    Path(output_file).unlink(missing_ok=True)
    tries, most = TRIES, 0
    while True:
        try:
            _go_on(url, part, say)
            break
        except (requests.RequestException, urllib3.exceptions.HTTPError) as error:
            response = getattr(error, "response", None)
            status = 0 if response is None else response.status_code
            if status in (404, 410):
                raise FileNotFoundError(url) from error
            size = part.stat().st_size if part.exists() else 0
            tries = TRIES - 1 if size > most else tries - 1
            most = max(most, size)
            # 4xx is an answer that stays the same, but for a server that is asked too often
            if not tries or (400 <= status < 500 and status != 429):
                raise
            time.sleep(FIRST_WAIT_S * 2 ** (TRIES - 1 - tries))
    wrong = _what_is_wrong(part, name=Path(url).name)
    if wrong:
        _drop(part)
        raise ValueError(wrong)
    part.replace(output_file)
    _drop(part)


def _go_on(url: str, part: Path, say: Say) -> None:
    """Adds to a half file what it lacks, where the server can send that and has the same version still; else all."""
    import requests

    version = _version_file(part)
    have = part.stat().st_size if part.exists() and version.exists() else 0
    # without compression on the way, positions in the file are those in the answer
    headers = {"Accept-Encoding": "identity"}
    if have:
        headers |= {"Range": f"bytes={have}-", "If-Range": version.read_text()}
    with requests.get(url, stream=True, headers=headers, timeout=TIMEOUT_S) as response:
        resumed = response.status_code == 206 and response.headers.get("Content-Range", "").startswith(f"bytes {have}-")
        if response.status_code == 416 or (response.status_code == 206 and not resumed):
            _drop(part)
            raise requests.RequestException("the server sent another part of the file than the one asked for")
        response.raise_for_status()
        if not resumed:
            _drop(part)
            have = 0
            if mark := _version_of(response):
                version.write_text(mark)
        length = response.headers.get("Content-Length")
        total = have + int(length) if length else None
        told = time.monotonic()
        with part.open("ab") as file:
            for chunk in response.raw.stream(CHUNK_BYTES, decode_content=False):
                file.write(chunk)
                have += len(chunk)
                if time.monotonic() - told > LINE_EVERY_S:
                    told = time.monotonic()
                    say(f"  {have / BYTES_PER_MB:.1f} MB" + (f" of {total / BYTES_PER_MB:.1f}" if total else ""))
    if total is not None and have != total:
        raise requests.ConnectionError(f"the connection broke after {have} of {total} bytes")


def _version_file(part: Path) -> Path:
    """Returns the file that names the version of which a half file is a part."""
    return part.with_name(f"{part.name}.version")


def _version_of(response: "requests.Response") -> str | None:
    """Returns what a server can be asked to compare before it sends a part; None where it gave nothing that serves."""
    tag = response.headers.get("ETag", "")
    return tag if tag and not tag.startswith("W/") else response.headers.get("Last-Modified")


def _drop(part: Path) -> None:
    part.unlink(missing_ok=True)
    _version_file(part).unlink(missing_ok=True)


def _what_is_wrong(path: Path, name: str | None = None) -> str | None:
    """Returns what shows that a file is not a whole one of the kind its name says; None for a good or unknown one."""
    name = name or path.name
    with path.open("rb") as file:
        start = file.read(1024)
    if name.endswith(".gz"):
        try:
            with gzip.open(path) as unpacked:
                while unpacked.read(1 << 20):
                    pass
        except (OSError, EOFError, zlib.error):
            return f"no whole gzip file; it begins with {start[:40]!r}"
    if name.endswith(".gii") and not (b"<GIFTI" in start and path.read_bytes().rstrip().endswith(b"</GIFTI>")):
        return f"no whole GIFTI file; it begins with {start[:40]!r}"
    return None


@contextmanager
def _refused(path: Path, url: str | None = None) -> Iterator[None]:
    """Turns what goes wrong with a file, or on the way from its URL, into a StorageError."""
    import requests
    import urllib3

    try:
        yield
    except (requests.RequestException, urllib3.exceptions.HTTPError) as error:
        raise StorageError(
            "cannot be fetched",
            path=url,
            found=_cause(error),
            remedy="Check the network, and HTTPS_PROXY where there is a proxy. The same command goes on with what is "
            f"missing; files may also be copied into {path.parent} by hand.",
        ) from error
    except ValueError as error:
        known = "SHA256" in str(error)
        raise StorageError(
            "the server's file is not the one recorded on first use" if known else "the server sent something else",
            path=url,
            found=error,
            expected=f"the checksum in {CHECKSUMS}" if known else f"the file {path.name}",
            remedy=f"It was not kept. If the atlas has a new version, delete the file's line in {CHECKSUMS}."
            if known
            else "It was not kept. Check the address, and whether the network asks for a login.",
        ) from error
    except OSError as error:
        raise StorageError(
            f"cannot be written or read: {error.strerror or error}",
            path=path,
            remedy="Free disk space or choose a folder that can be written.",
        ) from error


def _cause(error: Exception) -> str:
    """Returns the innermost reason that the network libraries give."""
    reason: object = error
    while isinstance(reason, Exception):
        inner = getattr(reason, "reason", None) or (reason.args[0] if reason.args else None)
        if not isinstance(inner, Exception):
            break
        reason = inner
    return str(reason).rpartition("): ")[2] or type(error).__name__
