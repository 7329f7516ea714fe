"""A command of the user's own, run on files, alone or in a container."""

import logging
import os
import re
import shlex
import shutil
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
DOCKER_PREFIX = "docker://"
APPTAINER = ("apptainer", "singularity")
DOCKER = ("docker", "podman")


def run_command(command: str, files: Mapping[str, AnyPath], made: str, container: str | None = None) -> None:
    """Runs a shell command, in the working directory, with its output in the log.

    The command has places such as {image} for the `files`; the one in the place `made` it has to make. It runs in the
    image `container`, "docker://NAME" or a .sif file, where one is given: the files' folders are seen in it.

    InputError, with the last lines of the output, where the command ends in another code than 0 or makes no file; where
    a place stands in quotes, in which a path could not be quoted.
    """
    paths = {name: Path(path).absolute() for name, path in files.items()}
    command = _with_paths(command, paths)
    folders = sorted({str(path.parent) for path in paths.values()})
    arguments = ["sh", "-c", command] if container is None else _command_in_container(command, container, folders)
    log.info("running %s", shlex.join(arguments))
    last: deque[str] = deque(maxlen=LINES_SHOWN)
    with subprocess.Popen(
        arguments,
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


def _command_in_container(command: str, container: str, folders: list[str]) -> list[str]:
    """Returns the arguments that run a shell command in a container with the first program found that can do so."""
    is_file = container.endswith(".sif")
    programs = APPTAINER if is_file else APPTAINER + DOCKER
    program = next((name for name in programs if shutil.which(name)), None)
    if program is None:
        raise InputError(
            "no program that runs containers is on PATH",
            path=container,
            expected=" or ".join(programs),
            remedy="Install one of them, or give a command that needs no container.",
        )
    unclear = [folder for folder in folders if ":" in folder or "," in folder]
    if unclear:
        raise InputError(
            "has a colon or a comma in its path, which containers take for the end of it",
            path=unclear[0],
            remedy="Move the file, or run the study, in another folder.",
        )
    if program in APPTAINER:
        binds = [part for folder in folders for part in ("--bind", folder)]
        return [program, "exec", *binds, container, "sh", "-c", command]
    binds = [part for folder in folders for part in ("--volume", f"{folder}:{folder}")]
    user = ["--user", f"{os.getuid()}:{os.getgid()}"] if program == "docker" else []
    image = container.removeprefix(DOCKER_PREFIX)
    return [program, "run", "--rm", *user, *binds, "--entrypoint", "sh", image, "-c", command]
