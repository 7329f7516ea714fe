"""A command of the user's own, run on files."""

import logging
import re
import shlex
import subprocess
from collections import deque
from collections.abc import Mapping
from pathlib import Path

from ..errors import InputError
from .files import AnyPath

log = logging.getLogger(__name__)

LINES_SHOWN = 5
QUOTES = ("'", '"', "`")
SHELL_TOKEN = r"""'[^']*'|"(?:\\.|[^"\\])*"|`(?:\\.|[^`\\])*`|\\.|(?<!\S)\#[^\n]*|<<|."""
"""A quoted part of a shell command, an escaped character, a comment, or any other character."""


def run_command(command: str, files: Mapping[str, AnyPath], made: str) -> None:
    """Runs a shell command, in the working directory, with its output in the log.

    The command has places such as {image} for the `files`; the one in the place `made` it has to make.

    InputError, with the last lines of the output, where the command ends in another code than 0 or makes no file; where
    a place stands in quotes, in which a path could not be quoted.
    """
    paths = {name: Path(path).absolute() for name, path in files.items()}
    command = _with_paths(command, paths)
    log.info("running %s", command)
    last: deque[str] = deque(maxlen=LINES_SHOWN)
    with subprocess.Popen(
        ["sh", "-c", command],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
    ) as process:
        assert process.stdout is not None
        for line in process.stdout:
            log.info("%s", line.rstrip())
            last.append(line.rstrip())
    if process.returncode != 0 or not paths[made].is_file():
        raise InputError(
            "the command failed",
            found=f"exit code {process.returncode} of {command!r}" + "".join(f"\n  {line}" for line in last) + "\n",
            expected=f"exit code 0 and a file in the place of {{{made}}}",
            remedy="It is yours: gyriflow only runs it. All of its output is in the log.",
        )


def _with_paths(command: str, paths: Mapping[str, Path]) -> str:
    """Returns a shell command with each path, quoted, in its place, so that nothing that stands in a path is run."""
    places = {f"{{{name}}}": shlex.quote(str(path)) for name, path in paths.items()}
    tokens = re.findall("|".join([*map(re.escape, places), SHELL_TOKEN]), command, flags=re.DOTALL)
    for token in tokens:
        inside = [place for place in places if place in token and place != token and not token.startswith("#")]
        if inside or token in QUOTES or token == "<<":
            raise InputError(
                f"the command has {inside[0]} in quotes" if inside else f"the command has {token} without its end",
                found=command,
                expected=f"{' and '.join(places)} by themselves: paths are quoted where that is needed",
                remedy="Leave out the quotes around them, and here-documents (<<); put what is longer into a script.",
            )
    return "".join(places.get(token, token) for token in tokens)
