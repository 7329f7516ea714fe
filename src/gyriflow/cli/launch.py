"""`python -m gyriflow.cli.launch ARG...`: Snakemake with this checkout's workflow, called by `./run snakemake`.

It clears a lock that an interrupted run has left (never that of a live run) and ends with the exit code of the first
failed step. Where a run is asked for, the terminal shows stages, weeks, warnings and failures, and a log all else;
`--verbose`, `--quiet`, `--printshellcmds` or `--logger` give Snakemake's own messages. Everything else is Snakemake's
own command line.
"""

import fcntl
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from types import FrameType
from typing import IO

from ..errors import GyriflowError, InputError, StorageError
from ..io.files import read_json, write_json
from ..io.yaml_files import read_keys
from ..shipped import SHIPPED
from ..step import EXIT_FILE, INTERRUPTED, recorded_exit_code

SETTINGS = {
    **dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1"),
    "OMPI_MCA_mpi_yield_when_idle": "1",
    "OMPI_MCA_btl": "self,sm",
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
    "PRTE_MCA_hwloc_default_binding_policy": "none",
}
"""Variables of MPI and BLAS where the user sets no others, as `./run` and the conda environment have them."""
SNAKEFILES = ("Snakefile", "snakefile", "workflow/Snakefile", "workflow/snakefile")
LOOKS_ONLY = frozenset(
    ("-n", "--dry-run", "--dryrun", "--nolock", "--summary", "-D", "--detailed-summary", "--rulegraph", "--dag")
    + ("--filegraph", "--list-rules", "--list", "-l", "--lint", "-h", "--help", "-v", "--version")
)
"""Options under which Snakemake takes no lock."""
GOES_ON, LOOKS = "GYRIFLOW_KEEP_GOING", "GYRIFLOW_LOOKS_ONLY"
"""Environment variables that are set where a call has an option of `KEEP_GOING`, and where it runs nothing."""
KEEP_GOING = frozenset(("--keep-going", "-k"))
REFUSED_FILE = "GYRIFLOW_REFUSED_FILE"
"""Environment variable with a file that says which brains were refused, and why: the study is finished without them."""

FULL_BYTES = 4 * 2**20
"""With less space left, a run that ended without a code of its own has met a full disk."""
HELD: list[IO[str]] = []
"""Files whose locks this process holds."""
SAYS_ITSELF = frozenset(
    ("--verbose", "--quiet", "-q", "--printshellcmds", "-p", "--logger", "--debug", "--debug-dag", "--unlock")
    + ("--touch", "-t", "--report", "--archive", "--delete-all-output", "--delete-temp-output", "--cleanup-metadata")
    + ("--cm", "--list-input-changes", "--list-params-changes", "--list-code-changes", "--generate-unit-tests")
    + ("--mode",)
)
"""Options under which Snakemake's own messages are wanted, or no steps are run."""


def hold_lock(directory: Path) -> IO[str] | None:
    """Returns a file whose lock lives as long as it is open, or None where another process holds it.

    StorageError where the folder cannot be written.
    """
    path = directory / ".snakemake" / "gyriflow.lock"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        file = path.open("a")
    except OSError as error:
        raise StorageError("the working directory cannot be written", path=directory, found=error.strerror) from error
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        file.close()
        return None
    HELD.append(file)
    return file


def clear_stale_lock(directory: Path, patience_s: float = 3.0) -> None:
    """Removes Snakemake's locks in a working directory in which no run is live.

    StorageError where a run is live there (one that is just ending is waited for), or the folder cannot be written.
    """
    deadline = time.monotonic() + patience_s
    while (file := hold_lock(directory)) is None:
        if time.monotonic() > deadline:
            raise StorageError(
                "another gyriflow run is live in this working directory",
                path=directory.resolve(),
                remedy="Wait for it to end, or give this run a folder of its own with --directory",
            )
        time.sleep(0.2)
    with file:
        stale = list((directory / ".snakemake" / "locks").glob("*.lock"))
        for lock in stale:
            lock.unlink()
    if stale:
        print("gyriflow: cleared the lock of an interrupted run, which is resumed", file=sys.stderr)


def looks_only(arguments: Sequence[str]) -> bool:
    """Returns whether Snakemake takes no lock for these arguments; short options may be bundled, as in `-np`."""
    bundled = any(re.fullmatch("-[npqrF]*n[npqrF]*", argument) for argument in arguments)
    return bundled or bool(LOOKS_ONLY.intersection(arguments))


def runs_quietly(arguments: Sequence[str]) -> bool:
    """Returns whether steps are run and only the essential is to be on the terminal."""
    names = {argument.partition("=")[0] for argument in arguments if argument.startswith("-")}
    return not looks_only(arguments) and not names & SAYS_ITSELF


def value_of(arguments: Sequence[str], *names: str) -> str | None:
    """Returns the last value of an option given as `--name value`, `--name=value` or (short) `-nvalue`."""
    found = None
    for index, argument in enumerate(arguments):
        for name in names:
            if argument == name and index + 1 < len(arguments):
                found = arguments[index + 1]
            elif name.startswith("--") and argument.startswith(name + "="):
                found = argument.removeprefix(name + "=")
            elif not name.startswith("--") and argument.startswith(name) and len(argument) > len(name):
                found = argument.removeprefix(name)
    return found


def refuse_bad_configfiles(arguments: Sequence[str], directory: Path) -> None:
    """Raises InputError where a configuration file, named or found here, is missing, no YAML, or has a key twice."""
    given, own = False, directory / "config" / "config.yaml"
    if not any(argument.startswith("--configfile") for argument in arguments) and own.is_file():
        read_keys(own)
    for argument in arguments:
        if argument.startswith("-"):
            option, _, argument = argument.partition("=")
            given = option in ("--configfile", "--configfiles")
        if given and argument:
            try:
                read_keys(argument)
            except InputError as error:
                remedy = ". Targets stand before --configfile, or after another option"
                raise InputError(f"configuration {error}{'' if Path(argument).exists() else remedy}") from error


def add_snakefile(arguments: Sequence[str]) -> list[str]:
    """Returns Snakemake's arguments, with this checkout's Snakefile if the user names none and none is here."""
    if value_of(arguments, "--snakefile", "-s") is not None or any(Path(name).is_file() for name in SNAKEFILES):
        return list(arguments)
    return ["--snakefile", str(SHIPPED / "Snakefile"), *arguments]


def send_prints_to(log: Path) -> None:
    """Send what this process' libraries and children print to a file; Python's own streams stay on the terminal."""
    log.parent.mkdir(parents=True, exist_ok=True)
    # for those alone who own it: it may hold names of subjects
    file = os.open(log, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o600)
    for number, stream in ((1, "stdout"), (2, "stderr")):
        getattr(sys, stream).flush()
        setattr(sys, stream, os.fdopen(os.dup(number), "w", buffering=1, errors="replace"))
        os.dup2(file, number)


def refused_brains() -> dict[str, str]:
    """Returns the cause by the id of each brain that an earlier pass of this call has refused."""
    path = os.environ.get(REFUSED_FILE)
    return read_json(path) if path else {}


def keeps_going() -> bool:
    """Returns whether the call that this process belongs to goes on where a step or a row of a table fails."""
    return GOES_ON in os.environ


def runs_nothing() -> bool:
    """Returns whether the call that this process belongs to only looks at what would be done."""
    return LOOKS in os.environ


def failed_brains(directory: Path, since_s: float) -> dict[str, str]:
    """Returns the cause by the id of each brain of which a step has failed since a time (s, of the epoch)."""
    from ..io.jobs import gather_messages  # takes a second, which a good run need not wait for

    found: dict[str, str] = {}
    folders = directory.glob("results/brains/*")
    messages = gather_messages(directory, [folder.name for folder in folders], [], since_s=since_s)
    errors = messages[(messages["level"] == "error") & (messages["subject"] != "")]
    for subject, message in zip(errors["subject"], errors["message"], strict=True):
        found.setdefault(subject, message)
    return found


def finish_without(refused: dict[str, str], arguments: Sequence[str], directory: Path) -> None:
    """Runs the same call again without refused brains, so that they don't hold up the tables and figures of the rest.

    Where the call asks for files of such a brain there is nothing to finish.
    """
    if any(argument.startswith(f"results/brains/{brain}/") for argument in arguments for brain in refused):
        return
    path = directory.absolute() / ".snakemake" / f"gyriflow-refused-{os.getpid()}.json"
    write_json(path, refused)
    # the locks of the Snakemake run that this process has ended
    while HELD:
        HELD.pop().close()
    # after an interruption the same command goes on from here
    with suppress(KeyboardInterrupt):
        again = [sys.executable, "-m", "gyriflow.cli.launch", *arguments]
        environment = os.environ | {REFUSED_FILE: str(path)}
        subprocess.run(again, env=environment, stdout=sys.stdout, stderr=sys.stderr, check=False)
    path.unlink(missing_ok=True)


def exit_code(code: int, recorded: int | None, directory: Path) -> int:
    """Returns the code of a run from Snakemake's and that of the first failed step; says so where the disk is full."""
    if code and recorded in (None, 1) and shutil.disk_usage(directory).free < FULL_BYTES:
        print(
            f"gyriflow: {directory.resolve()}: the disk is full. Free space; the same command goes on", file=sys.stderr
        )
        return StorageError.exit_code
    return (recorded or code) if code else 0


def main(arguments: Sequence[str]) -> int:
    """Runs Snakemake and returns the exit code: its own, or that of the first failed step."""
    for name, value in SETTINGS.items():
        os.environ.setdefault(name, value)
    # steps call `python`, which is to be this one
    os.environ["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", os.defpath)])
    directory = Path(value_of(arguments, "--directory", "-d") or ".")
    refuse_bad_configfiles(arguments, directory)
    if not looks_only(arguments):
        clear_stale_lock(directory)
    from snakemake import cli  # takes a second, which a refused run need not wait for

    # beside the results, where jobs on other machines of a cluster find it too
    exit_file = directory.absolute() / ".snakemake" / f"gyriflow-exit-{os.getpid()}"
    os.environ[EXIT_FILE] = str(exit_file)
    for name, applies in ((GOES_ON, KEEP_GOING.intersection(arguments)), (LOOKS, looks_only(arguments))):
        if applies:
            os.environ[name] = "1"
    interrupts: list[int] = []
    began = time.time()

    def interrupt(number: int, frame: FrameType | None) -> None:
        interrupts.append(number)
        signal.default_int_handler(number, frame)

    signal.signal(signal.SIGINT, interrupt)
    # the name under which usage and mistakes in it are told
    sys.argv[0] = "snakemake"
    complete = add_snakefile(arguments)
    details = directory.resolve() / ".snakemake" / "log" / f"{datetime.now():%Y-%m-%dT%H%M%S.%f}.gyriflow.log"
    if runs_quietly(arguments):
        complete = ["--logger", "gyriflow", "--logger-gyriflow-details", str(details), *complete]
        send_prints_to(details)
    try:
        cli.main(complete)
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else int(end.code is not None)
    except KeyboardInterrupt:
        code = INTERRUPTED
    recorded = recorded_exit_code(exit_file)
    exit_file.unlink(missing_ok=True)
    if code and interrupts:
        print("gyriflow: interrupted; the same command resumes from here", file=sys.stderr)
        return INTERRUPTED
    may_finish = REFUSED_FILE not in os.environ and not looks_only(arguments)
    if code and may_finish and KEEP_GOING.intersection(arguments) and (refused := failed_brains(directory, began)):
        finish_without(refused, arguments, directory)
    return exit_code(code, recorded, directory)


if __name__ == "__main__":
    # the Snakefile imports this module by its name, beside the program: both are to hold the same locks
    from gyriflow.cli.launch import main

    try:
        sys.exit(main(sys.argv[1:]))
    except GyriflowError as error:
        print(f"gyriflow: {error}", file=sys.stderr)
        sys.exit(error.exit_code)
