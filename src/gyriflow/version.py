"""Version of this package: as built, or in a checkout from the last tag."""

import subprocess
from functools import cache
from importlib import metadata

from .shipped import INSTALLED, SHIPPED

RELEASE = "0.1.0"
"""The next release; also the version of a checkout without tags or git."""


@cache
def version() -> str:
    """Return the version, such as `0.1.0`, or `0.1.0+3.gabc1234` three commits after
    its tag."""
    if INSTALLED.is_dir():
        return metadata.version("gyriflow")
    described = _git("describe", "--tags", "--match", "v*", "--always", "--dirty")
    if not described:
        return RELEASE
    if not described.startswith("v"):
        return f"{RELEASE}.dev+g{described}".replace("-dirty", ".dirty")
    number, *rest = described.removeprefix("v").split("-")
    return f"{number}+{'.'.join(rest)}" if rest else number


@cache
def commit() -> str | None:
    """Return the commit of the checkout, with `-dirty` where files differ from it, or
    None outside of git."""
    return (
        _git("describe", "--match", "", "--always", "--abbrev=40", "--dirty")
        if not INSTALLED.is_dir()
        else None
    )


def _git(*arguments: str) -> str | None:
    # a checkout may belong to another user, as in a container
    command = [
        "git",
        "-c",
        "safe.directory=*",
        "-C",
        str(SHIPPED),
        *arguments,
    ]
    try:
        done = subprocess.run(
            command,
            capture_output=True,
            text=True,
            check=True,
            timeout=10,
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip() or None
