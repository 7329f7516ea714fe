"""Which code has made the results: the commit of the source, and the versions of the packages."""

import subprocess
from collections.abc import Sequence
from importlib import metadata

from .files import AnyPath


def source_commit(folder: AnyPath) -> str | None:
    """Returns the commit of a checkout, with "changed" behind it where files differ; None where there is none."""
    try:
        commit = _git(folder, "rev-parse", "HEAD").strip()
        return f"{commit}, changed" if _git(folder, "status", "--porcelain", "--untracked-files=no").strip() else commit
    except (OSError, subprocess.CalledProcessError):
        return None


def package_versions(names: Sequence[str]) -> dict[str, str]:
    """Returns the versions of the packages that are installed, by name."""
    found = {}
    for name in names:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return found


def _git(folder: AnyPath, *arguments: str) -> str:
    command = ["git", "-c", "safe.directory=*", "-C", str(folder), *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout
