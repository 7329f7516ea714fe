"""Downloads: a file is complete and checked or not there, and an interrupted download is resumed.

A hidden file `.part.NAME` collects the bytes. It survives a broken connection and the end of the process.
"""

import fcntl
import gzip
import shutil
import time
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import IO

from ..errors import InputError, StorageError
from .files import AnyPath, sha256_of

TRIES = 4
"""Attempts without a single new byte before a file is given up."""
FIRST_WAIT_S = 0.5
"""Wait before the second try; it doubles with each."""
TIMEOUT_S = (15.0, 60.0)
"""Longest wait for a connection, and for the next bytes."""
LINE_EVERY_S = 5.0
"""How often a long download says how far it is."""
CHUNK_BYTES = 1 << 16
BYTES_PER_MB = 1e6
PART = ".part."
"""What the name of a half file begins with; its end is that of the file, by which readers know its kind."""

Say = Callable[[str], None]


def require_checksums(known: Mapping[str, tuple[str, str]]) -> None:
    """Raises InputError where a file is not that of an atlas: by its path `known` has the atlas and the SHA-256."""
    for path, (atlas, sha256) in known.items():
        if sha256_of(path) != sha256:
            raise InputError(
                f"is not the file of {atlas}",
                path=path,
                found="another SHA-256",
                expected=sha256,
                remedy="Delete it, and it is fetched; or give a changed file as a brain of your own under brains",
            )


def fetch(path: AnyPath, url: str, say: Say, *, sha256: str | None = None, size: int | None = None) -> None:
    """Fetches a file, or checks the one that is there, which is never replaced.

    It comes from the URL, is checked, and put under `path`; missing folders are made. `say` is called with lines of
    progress. Where no checksum is known, a GIFTI or NIfTI file has to be readable to its end. There has to be room for
    the size in bytes, if it is known.

    StorageError where the server cannot be reached, lacks the file or sends something else, the file that is there is
    another one, another process fetches it, or the folder cannot be written. Nothing is left under `path` then; what
    came of a broken download lies in `.part.NAME`, with which the next call goes on.
    """
    import pooch

    path = Path(path)
    pooch.get_logger().setLevel("WARNING")
    with _refused(path, url):
        if path.exists():
            _check(path, path.name, sha256)
            say(f"{path} is there already")
            return
        path.parent.mkdir(parents=True, exist_ok=True)
        free = shutil.disk_usage(path.parent).free
        if size is not None and free < size:
            raise StorageError(f"no room for {size} bytes; {free} are free", path=path.parent)
        part = path.with_name(PART + path.name)
        with _alone_with(part) as file:
            pooch.retrieve(
                url,
                known_hash=None if sha256 is None else f"sha256:{sha256}",
                fname=path.name,
                path=path.parent,
                downloader=partial(_download, part=part, file=file, say=say, sha256=sha256),
            )
    say(f"{path}: SHA-256 {sha256_of(path)}" + ("" if sha256 else ", as it came; no checksum is known"))


@contextmanager
def _alone_with(part: Path) -> Iterator[IO[bytes]]:
    """Opens a half file, made where it is missing, and holds it, so that no two downloads write it."""
    with part.open("ab") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise StorageError("another download of this file is running", path=part) from None
        except OSError:  # a file system without locks, as some networks have
            pass
        try:
            yield file
        finally:
            if part.exists() and not part.stat().st_size:
                part.unlink()


def _download(
    url: str, output_file: str, _pooch: object, *, part: Path, file: IO[bytes], say: Say, sha256: str | None
) -> None:
    """Makes a file of a URL, as pooch asks its downloaders to, out of what is gathered in `part`."""
    # pooch makes it empty, and it would stay behind if this process were killed
    Path(output_file).unlink(missing_ok=True)
    if sha256 is None and not part.name.endswith(".gz"):
        # nothing would tell whether it is half of another version
        file.truncate(0)
    while True:
        resumed = part.stat().st_size > 0
        _gather(url, part, file, say)
        try:
            _check(part, part.name.removeprefix(PART), sha256)
            break
        except ValueError:
            file.truncate(0)
            if not resumed:
                raise
    part.replace(output_file)


def _gather(url: str, part: Path, file: IO[bytes], say: Say) -> None:
    """Adds to a half file what it lacks, trying again where the connection breaks."""
    import requests
    import urllib3

    tries, most = TRIES, 0
    while True:
        try:
            return _go_on(url, part, file, say)
        except (requests.RequestException, urllib3.exceptions.HTTPError) as error:
            response = getattr(error, "response", None)
            status = 0 if response is None else response.status_code
            size = part.stat().st_size
            tries = TRIES - 1 if size > most else tries - 1
            most = max(most, size)
            # 4xx is an answer that stays the same, but for a part beyond the end and a server that is asked too often
            if not tries or (400 <= status < 500 and status not in (416, 429)):
                raise
            time.sleep(FIRST_WAIT_S * 2 ** (TRIES - 1 - tries))


def _go_on(url: str, part: Path, file: IO[bytes], say: Say) -> None:
    """Adds to a half file what it lacks, where the server can send that; else all."""
    import requests

    have = part.stat().st_size
    # without compression on the way, positions in the file are those in the answer
    headers = {"Accept-Encoding": "identity"} | ({"Range": f"bytes={have}-"} if have else {})
    with requests.get(url, stream=True, headers=headers, timeout=TIMEOUT_S) as response:
        if response.status_code in (200, 416):
            file.truncate(0)
            have = 0
        response.raise_for_status()
        total = have + int(response.headers.get("Content-Length", 0))
        told = time.monotonic()
        for chunk in response.raw.stream(CHUNK_BYTES, decode_content=False):
            file.write(chunk)
            file.flush()
            have += len(chunk)
            if time.monotonic() - told > LINE_EVERY_S:
                told = time.monotonic()
                say(f"  {have / BYTES_PER_MB:.1f} of {total / BYTES_PER_MB:.1f} MB")


def _check(path: Path, name: str, sha256: str | None) -> None:
    """Raises ValueError where a file is not the one of a checksum or, where none is known, no whole one of its kind."""
    with path.open("rb") as file:
        start = file.read(1024)
    if name.endswith(".gz"):
        try:
            with gzip.open(path) as unpacked:
                while unpacked.read(1 << 20):
                    pass
        except (OSError, EOFError, zlib.error):
            raise ValueError(f"no whole gzip file; it begins with {start[:40]!r}") from None
    if name.endswith(".gii") and not (b"<GIFTI" in start and path.read_bytes().rstrip().endswith(b"</GIFTI>")):
        raise ValueError(f"no whole GIFTI file; it begins with {start[:40]!r}")
    if sha256 is not None and (found := sha256_of(path)) != sha256:
        raise ValueError(f"the SHA-256 {found} instead of {sha256}")
    if sha256 is None and name.endswith((".nii", ".nii.gz", ".gii")):
        import nibabel as nib
        import numpy as np

        try:
            image = nib.load(path)
            # a GIFTI file is read at once, a NIfTI file lazily
            if isinstance(image, nib.Nifti1Image):
                np.asanyarray(image.dataobj)
        except Exception as error:
            raise ValueError(f"a file that cannot be read: {error}") from error


@contextmanager
def _refused(path: Path, url: str) -> Iterator[None]:
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
            remedy="Check the address, the network, and HTTPS_PROXY where there is a proxy. The same command goes on "
            f"with what is missing; the file may also be put into {path.parent} by hand.",
        ) from error
    except ValueError as error:
        if path.exists():
            raise StorageError(
                "is not the file of the atlas",
                path=path,
                found=error,
                remedy="It was left as it is. Move it away, and the file is fetched.",
            ) from error
        raise StorageError(
            "the server sent something else than the file",
            path=url,
            found=error,
            expected=path.name,
            remedy="It was not kept. Check the address, and whether the network asks for a login.",
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
