"""What a file was at a moment: its hash, size and time, for records of provenance."""

from collections.abc import Iterable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from .downloads import sha256_of
from .files import AnyPath


def fingerprints(files: Iterable[AnyPath]) -> dict[str, dict[str, Any]]:
    """Returns for each file that is there its SHA-256, its size in bytes and when it was last written (UTC)."""
    found = {}
    for path in map(Path, files):
        if path.is_file():
            state = path.stat()
            written = datetime.fromtimestamp(state.st_mtime, UTC).isoformat(timespec="seconds")
            found[str(path)] = {"sha256": sha256_of(path), "bytes": state.st_size, "written": written}
    return found


def files_in(folder: AnyPath, *left_out: str) -> list[Path]:
    """Returns the files of a folder and those in it, in order, without hidden ones and folders of some names."""

    def wanted(path: Path) -> bool:
        return not any(part.startswith(".") or part in left_out for part in path.relative_to(folder).parts)

    return [path for path in sorted(Path(folder).rglob("*")) if path.is_file() and wanted(path)]
