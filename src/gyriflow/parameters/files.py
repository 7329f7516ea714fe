"""Paths of input files in settings."""

import re
from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, ValidationInfo

from .settings import refused


def beside(folder: Path, path: str) -> Path:
    """Returns the place of a file that is named relative to a folder, or below a home folder (`~/scans/a.nii.gz`)."""
    try:
        return folder / Path(path).expanduser()
    except RuntimeError:  # no home folder of that name: `~` is part of the file's
        return folder / path


def _absolute(path: str, info: ValidationInfo) -> str:
    """Returns the absolute path of a file, which must exist.

    The context names the `folder` of the configuration, which is searched for relative paths before the working
    directory, and `awaited` files, which need not exist yet. Without a context the path is returned unchanged.
    """
    if not info.context:
        return path
    places = [beside(Path(info.context["folder"]), path), Path.cwd() / path]
    present = [place for place in places if place.is_file()]
    if not present and path not in info.context.get("awaited", ()):
        raise refused(f"no such file: {places[0]}{_present_instead(places[0])}")
    return str((present or places)[0].resolve())


InputFile = Annotated[str, AfterValidator(_absolute)]
"""The path of a file that is read; relative to the configuration file or else to the working directory."""


def _present_instead(path: Path) -> str:
    """Returns the files beside a missing one that differ from it only in a number, such as other weeks."""
    pattern = re.compile(re.sub(r"\d+(\\\.\d+)?", r"[0-9.]+", re.escape(path.name)))
    try:
        names = sorted(other.name for other in path.parent.iterdir() if pattern.fullmatch(other.name))
    except OSError:
        names = []
    return f"; there are {', '.join(names)}" if names else ""
