"""A web server on this machine for tests of downloads: it can break off, and remembers
what it was asked for."""

import gzip
import hashlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread

import nibabel as nib
import numpy as np


@dataclass
class Server:
    """What is served, and how."""

    files: dict[str, bytes]
    broken_after: dict[str, list[int]] = field(default_factory=dict)
    """By path, the bytes after which one answer each breaks off, in order; further
    answers are whole."""
    asked: list[str] = field(default_factory=list)
    """The path of each request."""
    url: str = ""


@contextmanager
def serving(server: Server) -> Iterator[Server]:
    """Serve until the block ends, at `server.url`."""

    class Handler(BaseHTTPRequestHandler):
        def log_message(self, *_: object) -> None:
            pass

        def do_GET(self) -> None:
            path = self.path.lstrip("/")
            server.asked.append(path)
            if path not in server.files:
                self.send_error(404)
                return
            content = server.files[path]
            self.send_response(200)
            self.send_header("Content-Length", str(len(content)))
            self.end_headers()
            breaks = server.broken_after.get(path)
            self.wfile.write(content[: breaks.pop(0) if breaks else None])
            self.close_connection = True

    web = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.url = f"http://127.0.0.1:{web.server_address[1]}"
    thread = Thread(
        target=web.serve_forever, kwargs={"poll_interval": 0.02}, daemon=True
    )
    thread.start()
    try:
        yield server
    finally:
        web.shutdown()
        web.server_close()
        thread.join()


def sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def files_in(folder: Path) -> dict[str, bytes]:
    """Return the content of each file of a folder by its path."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


def packed(size: int, seed: int = 0) -> bytes:
    """Return a NIfTI file (.nii.gz) of about so many bytes that do not shrink."""
    values = np.random.default_rng(seed).integers(
        0, 2**15, size // 200 * 100, dtype=np.int16
    )
    return gzip.compress(
        nib.Nifti1Image(values.reshape(-1, 100, 1), np.eye(4)).to_bytes(), mtime=0
    )


def gifti(seed: int = 0) -> bytes:
    """Return a GIFTI file of one triangle."""
    points = np.random.default_rng(seed).random((3, 3)).astype(np.float32)
    arrays = [
        (points, "NIFTI_INTENT_POINTSET"),
        (np.array([[0, 1, 2]], np.int32), "NIFTI_INTENT_TRIANGLE"),
    ]
    return nib.GiftiImage(
        darrays=[nib.gifti.GiftiDataArray(data, intent) for data, intent in arrays]
    ).to_bytes()
