"""`python -m gyriflow.running.launch ARG...`: Snakemake with this checkout's workflow, called by `./run snakemake`.

It clears a lock that an interrupted run has left (never that of a live run) and ends with the exit code of the first
failed step. Where steps are run, the terminal shows a bar, warnings and failures, and a log all else; `--verbose`,
`--quiet`, `--printshellcmds` or `--logger` give Snakemake's own messages. All else is Snakemake's own command line.
"""

import fcntl
import logging
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
from ..settings.base import nearest
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
LOOKS_ONLY = ("dryrun", "nolock", "summary", "detailed_summary", "rulegraph", "dag", "filegraph", "list_rules", "lint")
"""Options of Snakemake's under which it takes no lock."""
SAYS_ITSELF = (
    *("verbose", "quiet", "printshellcmds", "logger", "debug", "debug_dag", "unlock", "touch", "report", "archive"),
    *("delete_all_output", "delete_temp_output", "cleanup_metadata", "list_changes", "list_input_changes"),
    *("list_params_changes", "generate_unit_tests"),
)
"""Options under which Snakemake's own messages are wanted, or no steps are run."""
GOES_ON, LOOKS, MEASURES_ONLY = "GYRIFLOW_KEEP_GOING", "GYRIFLOW_LOOKS_ONLY", "GYRIFLOW_MEASURES_ONLY"
"""Environment variables that are set where a call goes on after a failed step or row of a table, where it runs nothing,
and where it folds nothing."""
REFUSED_FILE = "GYRIFLOW_REFUSED_FILE"
"""Environment variable with a file that says which brains were refused, and why: the study is finished without them."""
FULL_BYTES = 4 * 2**20
"""With less space left, a run that ended without a code of its own has met a full disk."""
NO_RULE = re.compile(r"No rule to produce (\S+)")
HELD: list[IO[str]] = []
"""Files whose locks this process holds."""


def hold_lock(directory: Path) -> IO[str] | None:
    """Return a file whose lock lives as long as it is open, or None where another process holds it.

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
    """Remove Snakemake's locks in a working directory in which no run is live.

    StorageError where a run is live there (one that is just ending is waited for), or the folder cannot be written.
    """
    deadline = time.monotonic() + patience_s
    while (file := hold_lock(directory)) is None:
        if time.monotonic() > deadline:
            remedy = "Wait for it to end, or give this run a folder of its own with --directory"
            problem = "another gyriflow run is live in this working directory"
            raise StorageError(problem, path=directory.resolve(), remedy=remedy)
        time.sleep(0.2)
    with file:
        stale = list((directory / ".snakemake" / "locks").glob("*.lock"))
        for lock in stale:
            lock.unlink()
    if stale:
        print("gyriflow: cleared the lock of an interrupted run, which is resumed", file=sys.stderr)


def refuse_bad_configfiles(files: Sequence[Path], directory: Path) -> None:
    """Raise InputError where a configuration file, named or found here, is missing, no YAML, or has a key twice."""
    default = directory / "config" / "config.yaml"
    for file in files or ([default] if default.is_file() else []):
        try:
            read_keys(file)
        except InputError as error:
            remedy = "" if file.exists() else ". Targets stand before --configfile, or after another option"
            raise InputError(f"configuration {error}{remedy}") from error


def refuse_unknown_options(unknown: Sequence[str], usage: str) -> None:
    """Raise InputError where an argument that Snakemake does not know is an option; `usage` names those it knows."""
    known = ["--stage", *dict.fromkeys(re.findall(r"--[a-z][a-z-]+", usage))]
    for name in (argument.partition("=")[0] for argument in unknown if argument.startswith("-")):
        raise InputError(f"unknown option {name}; {nearest(name, known)}")


def unknown_target(name: str) -> InputError:
    """Return the error of a target that no rule makes."""
    rules = [path.read_text() for path in (SHIPPED / "workflow" / "rules").glob("*.smk")]
    known = re.findall(r"^rule (\w+):", "".join(rules), re.MULTILINE)
    return InputError(f"there is no stage or result {name}; {nearest(name, known)}")


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
    """Return the cause by the id of each brain that an earlier pass of this call has refused."""
    path = os.environ.get(REFUSED_FILE)
    return read_json(path) if path else {}


def failed_brains(directory: Path, since_s: float) -> dict[str, str]:
    """Return the cause by the id of each brain of which a step has failed since a time (s, of the epoch)."""
    from .jobs import gather_messages  # takes a second, which a good run need not wait for

    brains = [folder.name for folder in directory.glob("results/brains/*")]
    messages = gather_messages(directory, brains, [], since_s=since_s)
    errors = messages[(messages["level"] == "error") & (messages["subject"] != "")]
    return dict(errors.drop_duplicates("subject")[["subject", "message"]].to_numpy())


def finish_without(refused: dict[str, str], arguments: Sequence[str], directory: Path) -> None:
    """Run the same call again without refused brains, so that they don't hold up the tables and figures of the rest.

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
        again = [sys.executable, "-m", "gyriflow.running.launch", *arguments]
        environment = os.environ | {REFUSED_FILE: str(path)}
        subprocess.run(again, env=environment, stdout=sys.stdout, stderr=sys.stderr, check=False)
    path.unlink(missing_ok=True)


def exit_code(code: int, recorded: int | None, directory: Path) -> int:
    """Return the code of a run from Snakemake's and that of the first failed step; say so where the disk is full."""
    if code and recorded in (None, 1) and shutil.disk_usage(directory).free < FULL_BYTES:
        full = f"{directory.resolve()}: the disk is full. Free space, then run the same command again"
        print(f"gyriflow: {full}", file=sys.stderr)
        return StorageError.exit_code
    return (recorded or code) if code else 0


def main(arguments: Sequence[str]) -> int:
    """Run Snakemake and return the exit code: its own, or that of the first failed step."""
    # the name under which usage and mistakes in it are told
    sys.argv[0] = "snakemake"
    from snakemake import cli  # takes a second, which the Snakefile's own import of this module need not wait for

    parser = cli.get_argument_parser()
    options, unknown = parser.parse_known_args(arguments)
    refuse_unknown_options(unknown, parser.format_usage())
    directory = options.directory or Path()
    refuse_bad_configfiles(options.configfile or [], directory)
    looks = any(getattr(options, name, None) not in (None, False) for name in LOOKS_ONLY)
    if not looks:
        clear_stale_lock(directory)
    os.environ |= SETTINGS | os.environ
    # steps call `python`, which is to be this one
    os.environ["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", os.defpath)])
    os.environ |= {name: "1" for name, applies in ((GOES_ON, options.keep_going), (LOOKS, looks)) if applies}
    # beside the results, where jobs on other machines of a cluster find it too
    exit_file = directory.absolute() / ".snakemake" / f"gyriflow-exit-{os.getpid()}"
    os.environ[EXIT_FILE] = str(exit_file)
    interrupts: list[int] = []
    unknown_targets: list[str] = []
    began = time.time()

    def names_no_target(record: logging.LogRecord) -> bool:
        names = NO_RULE.findall(record.getMessage())
        unknown_targets.extend(names)
        return not names

    def interrupt(number: int, frame: FrameType | None) -> None:
        interrupts.append(number)
        signal.default_int_handler(number, frame)

    signal.signal(signal.SIGINT, interrupt)
    own_snakefile = options.snakefile or any(Path(name).is_file() for name in SNAKEFILES)
    complete = [*([] if own_snakefile else ["--snakefile", str(SHIPPED / "Snakefile")]), *arguments]
    if not looks and not any(getattr(options, name, None) for name in SAYS_ITSELF):
        details = directory.resolve() / ".snakemake" / "log" / f"{datetime.now():%Y-%m-%dT%H%M%S.%f}.gyriflow.log"
        complete = ["--logger", "gyriflow", "--logger-gyriflow-details", str(details), *complete]
        send_prints_to(details)
    logging.getLogger("snakemake.logging").addFilter(names_no_target)
    try:
        cli.main(complete)
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else int(end.code is not None)
    except KeyboardInterrupt:
        code = INTERRUPTED
    recorded = recorded_exit_code(exit_file)
    exit_file.unlink(missing_ok=True)
    if unknown_targets:
        raise unknown_target(unknown_targets[0])
    if code and interrupts:
        print("gyriflow: interrupted; the same command resumes from here", file=sys.stderr)
        return INTERRUPTED
    may_finish = options.keep_going and not looks and REFUSED_FILE not in os.environ
    if code and may_finish and (brains := failed_brains(directory, began)):
        finish_without(brains, arguments, directory)
    return exit_code(code, recorded, directory)


if __name__ == "__main__":
    # the Snakefile imports this module by its name, beside the program: both are to hold the same locks
    from gyriflow.running.launch import main

    try:
        sys.exit(main(sys.argv[1:]))
    except GyriflowError as error:
        print(f"gyriflow: {error}", file=sys.stderr)
        sys.exit(error.exit_code)
