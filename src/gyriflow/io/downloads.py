"""Downloads: a file is complete and checked, or not there."""

import gzip
import hashlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

from ..errors import InputError, StorageError
from .files import AnyPath, sha256_of

TRIES = 3
TIMEOUT_S = (15.0, 60.0)
"""Longest wait for a connection, and for the next bytes."""

Report = Callable[[str], None]


def require_checksums(recorded: Mapping[str, tuple[str, str]]) -> None:
    """Raise InputError where a file is not that of an atlas: by its path `recorded` has
    the atlas and the SHA-256."""
    for path, (atlas, sha256) in recorded.items():
        if sha256_of(path) != sha256:
            raise InputError(
                f"is not the file of {atlas}",
                path=path,
                expected=f"the SHA-256 {sha256}",
                remedy=(
                    "Delete it, and it is fetched; or give a changed file as a brain of"
                    " your own under brains."
                ),
            )


def fetch(
    path: AnyPath,
    url: str,
    report: Report,
    *,
    sha256: str | None = None,
) -> None:
    """Fetch a file from a URL, check it and put it under `path`, or check the one
    there, which is never replaced.

    `report` gets a line about the file. Without a checksum, a GIFTI or NIfTI file has
    to be readable to its end. StorageError otherwise, with nothing new under `path`.
    """
    import pooch

    path = Path(path)
    pooch.get_logger().setLevel("WARNING")
    with _refused(path, url):
        if path.exists():
            _check(path, path.name, sha256)
            report(f"{path} already exists")
            return
        path.parent.mkdir(parents=True, exist_ok=True)
        files = {
            "registry": {path.name: None},
            "urls": {path.name: url},
        }
        pooch.create(
            path.parent,
            "",
            retry_if_failed=TRIES - 1,
            **files,
        ).fetch(path.name, downloader=partial(_download, path.name, sha256))
    report(
        f"{path}: SHA-256 {sha256_of(path)}"
        + ("" if sha256 else " as downloaded; no checksum is known")
    )


def _download(
    name: str,
    sha256: str | None,
    url: str,
    output_file: str,
    caller: Any,
) -> None:
    import pooch

    # without compression on the way, which would be undone in files that are compressed
    # themselves
    by_http = pooch.HTTPDownloader(
        timeout=TIMEOUT_S, headers={"Accept-Encoding": "identity"}
    )
    by_http(url, output_file, caller)
    _check(Path(output_file), name, sha256)


def _check(
    path: Path,
    name: str,
    sha256: str | None,
) -> None:
    content = path.read_bytes()
    start = f"it begins with {content[:40]!r}"
    if sha256 is not None:
        if (actual := hashlib.sha256(content).hexdigest()) != sha256:
            raise ValueError(f"the SHA-256 {actual} instead of {sha256}; {start}")
        return
    import nibabel as nib
    import numpy as np

    try:
        content = gzip.decompress(content) if name.endswith(".gz") else content
        if name.endswith(".gii"):
            # of a page, which is XML too, nothing comes
            if nib.GiftiImage.from_bytes(content) is None:
                raise ValueError("no GIFTI")
        elif name.endswith((".nii", ".nii.gz")):
            np.asanyarray(nib.Nifti1Image.from_bytes(content).dataobj)
    except Exception as error:
        raise ValueError(f"a file that cannot be read: {error}; {start}") from error


@contextmanager
def _refused(path: Path, url: str) -> Iterator[None]:
    import requests

    try:
        yield
    except requests.RequestException as error:
        raise StorageError(
            "cannot be fetched",
            path=url,
            found=_cause(error),
            remedy=(
                "Run the same command again to continue, or put the file into"
                f" {path.parent} by hand."
            ),
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
            remedy="Check the address, and whether the network asks for a login.",
        ) from error
    except OSError as error:
        raise StorageError(
            f"cannot be written or read: {error.strerror or error}", path=path
        ) from error


def _cause(error: Exception) -> str:
    reason: object = error
    while isinstance(reason, Exception):
        inner = getattr(reason, "reason", None) or (
            reason.args[0] if reason.args else None
        )
        if not isinstance(inner, Exception):
            break
        reason = inner
    return str(reason).rpartition("): ")[2] or type(error).__name__
