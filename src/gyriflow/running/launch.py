"""Start Snakemake with this checkout's workflow (`./run snakemake ARG...`, `python -m
gyriflow.running.launch ARG...`).

The launcher removes the lock of an interrupted run (never that of a live one) and
returns the exit code of the first failed step. The terminal shows a progress bar,
warnings and failures; everything else goes to a log. `--verbose`, `--quiet`,
`--printshellcmds` and `--logger` bring back Snakemake's own messages. All other options
are Snakemake's.
"""

import getpass
import logging
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from argparse import Namespace
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import (
    AbstractContextManager,
    chdir,
    contextmanager,
    nullcontext,
    suppress,
)
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from types import FrameType
from typing import IO

import psutil

from ..errors import GyriflowError, InputError, StorageError
from ..io.files import read_json, write_json
from ..io.locks import UNLOCKABLE, lock_file
from ..io.yaml_files import read_keys
from ..memory import collect_rarely
from ..messages import Message, study_messages
from ..settings.base import did_you_mean
from ..shipped import DEMO, SHIPPED
from ..study.study import Study
from .manifest import Job
from .planning import (
    Events,
    Plan,
    hide_results,
    keep_contents,
    link_results,
    listing,
    made_plan,
    restore_results,
    view_of,
)
from .snakemake_internals import shorten_usage_errors

ENVIRONMENT = SHIPPED / "envs" / "gyriflow.yaml"
"""The conda environment, whose variables of MPI and BLAS are defaults in any other one,
too, as in `./run`."""
INTERRUPT_S = 0.5
"""Time for Snakemake to notice an interruption before its jobs are stopped, so that
they do not count as failed."""
GRACE_S = 4.0
"""Time for jobs to end by SIGTERM, before they are killed. Schedulers and containers
allow 10 s or more in all."""
LOCK_WAIT_S = 3.0
"""Time that another run has to end, before a run of the same working directory is
refused."""
READ_ONLY_OPTIONS = (
    "dryrun",
    "nolock",
    "summary",
    "detailed_summary",
    "rulegraph",
    "dag",
    "filegraph",
    "list_rules",
    "lint",
)
"""Options with which Snakemake runs nothing and takes no lock."""
VERBOSE_OPTIONS = (
    "verbose",
    "quiet",
    "printshellcmds",
    "logger",
    "debug",
    "debug_dag",
)
"""Options that ask for Snakemake's own messages."""
MANAGING_OPTIONS = (
    "unlock",
    "touch",
    "report",
    "archive",
    "delete_all_output",
    "delete_temp_output",
    "cleanup_metadata",
    "list_changes",
    "list_input_changes",
    "list_params_changes",
    "generate_unit_tests",
)
"""Options that ask for something else than running steps."""
PARTIAL_OPTIONS = ("until", "omit_from", "batch")
"""Options that select some of the planned jobs."""
FORCE_OPTIONS = ("--force", "-f", "--forceall", "-F")
"""Options without values that force jobs to run."""
SNAKEMAKE_LISTS = (
    *(name for name in VERBOSE_OPTIONS if name != "quiet"),
    *PARTIAL_OPTIONS,
)
"""Options with which Snakemake itself lists the jobs of a dry run. It plans twice
then."""
BY_MANIFEST = ("--rerun-triggers", "mtime", "--debug-dag")
"""Options with which Snakemake lists all jobs, and compares none with its own records.
Dates do not count, either, as all inputs are `ancient`."""
PLANNING = ("-n", "--rerun-incomplete", "--quiet", "rules", "progress")
"""Options with which Snakemake only finds the jobs that it plans. With exactly these
two words after `--quiet`, it ends before it goes through them in turn."""
MEASURE_ONLY_VAR = "GYRIFLOW_MEASURE_ONLY"
"""Environment variable: fold nothing."""
REFUSED_FILE_VAR = "GYRIFLOW_REFUSED_FILE"
"""Environment variable with the path of a JSON file: refused brains and causes. The
study is finished without them."""
MIN_FREE_BYTES = 4 * 2**20
"""If less disk space is left, a run that failed without an exit code of its own has
filled the disk."""
NO_RULE = re.compile(r"No rule to produce (\S+)")
_held_locks: dict[Path, IO[str]] = {}
"""The locks that this process holds, by their working directories."""
received_signals: list[int] = []
"""Signals that have interrupted the run of this process."""


@dataclass
class Session:
    """What the rules, which are read in this process, have to know of its call.

    `targets` are the rules and files that it asks for. It `keeps_going` after a failed
    step, or after a row of a table that cannot be used. If it `is_dry` it runs nothing;
    `viewed` is the working directory that a dry run is a view of. The rules are read
    once to plan, and again to run: then the study `is_planned`, and its messages were
    printed. `study` is what they have planned, `jobs` are those to run.
    """

    is_launched: bool = False
    targets: Sequence[str] = ()
    keeps_going: bool = False
    is_dry: bool = False
    viewed: Path | None = None
    is_planned: bool = False
    study: Study | None = None
    jobs: Sequence[Job] = ()


session = Session()


def hold_lock(directory: Path) -> IO[str] | None:
    """Lock a working directory until the returned file is closed; None if another
    process has locked it."""
    path = directory / ".snakemake" / "gyriflow.lock"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        file = path.open("a")
    except OSError as error:
        raise StorageError(
            "the working directory cannot be written",
            path=directory,
            found=error.strerror,
        ) from error
    if not lock_file(file):
        file.close()
        return None
    return file


@contextmanager
def locked(directory: Path, option: str = "--directory") -> Iterator[None]:
    """Lock a working directory before anything is written there, and remove Snakemake's
    own locks of an interrupted run.

    Within a block of the same directory nothing happens. StorageError if the directory
    is in use or cannot be written; `option` of the command names another one.
    """
    place = directory.resolve()
    # a second pass runs under the lock of the first one
    if place in _held_locks or REFUSED_FILE_VAR in os.environ:
        yield
        return
    deadline = time.monotonic() + LOCK_WAIT_S
    while (file := hold_lock(directory)) is None:
        if time.monotonic() > deadline:
            remedy = f"Wait for it to end, or choose another folder with {option}"
            problem = "another gyriflow run is using this working directory"
            raise StorageError(problem, path=place, remedy=remedy)
        time.sleep(0.2)
    with file:
        # if files cannot be locked, Snakemake's locks may be those of a live run
        if file.name not in UNLOCKABLE:
            _clear_stale_locks(directory)
        _held_locks[place] = file
        try:
            yield
        finally:
            del _held_locks[place]


def _clear_stale_locks(directory: Path) -> None:
    """Remove Snakemake's own locks from a working directory that is locked."""
    stale = list((directory / ".snakemake" / "locks").glob("*.lock"))
    for lock in stale:
        lock.unlink()
    if stale:
        print(
            "gyriflow: removed the lock of an interrupted run; resuming it",
            file=sys.stderr,
        )


def _check_configfiles(files: Sequence[Path], directory: Path) -> None:
    """Raise InputError if a file, or else the directory's config/config.yaml, is not a
    valid YAML configuration."""
    default = directory / "config" / "config.yaml"
    for file in files or ([default] if default.is_file() else []):
        try:
            read_keys(file)
        except InputError as error:
            remedy = (
                None
                if file.exists()
                else "Put targets before --configfile, or after another option"
            )
            raise InputError(f"configuration {error}", remedy=remedy) from error


def _what_runs(directory: Path) -> str:
    """Return which configuration runs if a call names none."""
    own = directory / "config" / "config.yaml"
    is_demo = not own.is_file() or own.samefile(DEMO)
    config = f"the demo, {DEMO}" if is_demo else own.resolve()
    return f"without --configfile, this runs {config}"


def _check_options(unknown: Sequence[str], usage: str) -> None:
    """Raise InputError if an `unknown` argument is an option; Snakemake's `usage` lists
    the valid ones."""
    options = ["--stage", *dict.fromkeys(re.findall(r"--[a-z][a-z-]+", usage))]
    for name in (
        argument.partition("=")[0] for argument in unknown if argument.startswith("-")
    ):
        raise InputError(f"unknown option {name}; {did_you_mean(name, options)}")


@contextmanager
def _output_to(log: Path) -> Iterator[None]:
    """Append to a file what libraries and child processes print meanwhile. Python's own
    streams stay on the terminal."""
    log.parent.mkdir(parents=True, exist_ok=True)
    # readable by its owner only, since it may contain names of subjects
    file = os.open(
        log,
        os.O_WRONLY | os.O_APPEND | os.O_CREAT,
        0o600,
    )
    streams = {}
    terminals = {}
    for number, name in ((1, "stdout"), (2, "stderr")):
        streams[name] = getattr(sys, name)
        streams[name].flush()
        terminals[number] = os.dup(number)
        stream = os.fdopen(
            os.dup(number),
            "w",
            buffering=1,
            errors="replace",
        )
        setattr(sys, name, stream)
        os.dup2(file, number)
    os.close(file)
    try:
        yield
    finally:
        for number, terminal in terminals.items():
            os.dup2(terminal, number)
            os.close(terminal)
        for name, stream in streams.items():
            setattr(sys, name, stream)


def _stop_jobs() -> None:
    """Stop all processes below this one, MPI ranks included. Simulations keep their
    last checkpoint."""
    jobs: set[psutil.Process] = set()
    for stop in (psutil.Process.terminate, psutil.Process.kill):
        # the processes of a job that has ended may still run
        jobs.update(psutil.Process().children(recursive=True))
        for job in jobs:
            with suppress(psutil.Error):
                stop(job)
        deadline = time.monotonic() + GRACE_S
        # waiting for them by psutil would take their exit codes from Snakemake
        while any(map(_is_running, jobs)) and time.monotonic() < deadline:
            time.sleep(0.05)


def _is_running(process: psutil.Process) -> bool:
    with suppress(psutil.Error):
        return process.is_running() and process.status() != psutil.STATUS_ZOMBIE
    return False


def _set_cache(directory: Path) -> None:
    """Let libraries keep their caches with a study if the home folder cannot be written
    or is unknown."""
    try:
        cache = Path(
            os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache", "snakemake"
        )
        cache.mkdir(parents=True, exist_ok=True)
        usable = os.access(cache, os.W_OK)
    except (OSError, RuntimeError):
        usable = False
    if not usable:
        os.environ["XDG_CACHE_HOME"] = str(
            directory.absolute() / ".snakemake" / "cache"
        )


def _set_environment() -> None:
    """Set the environment variables that Snakemake and the steps of the workflow
    read."""
    os.environ |= read_keys(ENVIRONMENT)["variables"] | os.environ
    # no module in a working directory is imported in place of another one
    os.environ["PYTHONSAFEPATH"] = "1"
    # steps call `python`; let it be this one
    os.environ["PATH"] = os.pathsep.join(
        [str(Path(sys.executable).parent), os.environ.get("PATH", os.defpath)]
    )
    _set_user_name()


def _set_user_name() -> None:
    """Name a user whom the system does not know, such as one of `docker run -u`, as
    Snakemake asks for a name."""
    try:
        getpass.getuser()
    except (KeyError, OSError):
        os.environ["LOGNAME"] = f"user-{os.getuid()}"


def _call_snakemake(
    arguments: Sequence[str],
    events: Events,
    level: int = logging.INFO,
    unwanted: Collection[str] = (),
) -> int:
    """Run Snakemake in this process; return its exit code, or 128 plus the number of
    the signal that stopped it.

    `events` takes what its log says. Shown are records of at least a `level`, without
    `unwanted` events.
    """
    from snakemake import cli

    unknown_targets: list[str] = []

    def is_shown(record: logging.LogRecord) -> bool:
        if getattr(record, "event", None) == "run_info":
            # Snakemake's own handler, set by now, waits for running jobs to end
            signal.signal(signal.SIGTERM, _interrupt)
        events.take(record)
        is_message = record.levelno >= logging.INFO
        names = NO_RULE.findall(record.getMessage()) if is_message else []
        unknown_targets.extend(names)
        is_wanted = getattr(record, "event", None) not in unwanted
        return record.levelno >= level and is_wanted and not names

    numbers = [signal.SIGINT, signal.SIGTERM]
    # `nohup` has SIGHUP ignored; Windows has none
    if sys.platform != "win32" and signal.getsignal(signal.SIGHUP) != signal.SIG_IGN:
        numbers.append(signal.SIGHUP)
    for number in numbers:
        signal.signal(number, _interrupt)
    logger = logging.getLogger("snakemake.logging")
    logger.addFilter(is_shown)
    try:
        # Snakemake changes to its working directory
        with chdir(Path.cwd()):
            cli.main(arguments)
        code = 0
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else int(end.code is not None)
    except KeyboardInterrupt:
        code = 1
    finally:
        logger.removeFilter(is_shown)
        _end_scheduler_timers()
    for name in unknown_targets:
        rules = [
            path.read_text(encoding="utf-8")
            for path in (SHIPPED / "workflow" / "rules").glob("*.smk")
        ]
        stages = re.findall(
            r"^rule (\w+):",
            "".join(rules),
            re.MULTILINE,
        )
        raise InputError(
            f"no stage or result is named {name}; {did_you_mean(name, stages)}"
        )
    return 128 + received_signals[0] if code and received_signals else code


def _interrupt(number: int, frame: FrameType | None) -> None:
    received_signals.append(number)
    # a closed terminal sends several
    if len(received_signals) == 1:
        # while Snakemake waits for its jobs
        threading.Timer(INTERRUPT_S, _stop_jobs).start()
    if len(received_signals) == 1 or number == signal.SIGINT:
        raise KeyboardInterrupt


def _end_scheduler_timers() -> None:
    """End the timers of Snakemake's scheduler, for which Python would wait at its
    end."""
    for thread in threading.enumerate():
        if isinstance(thread, threading.Timer) and thread.function is not _stop_jobs:
            thread.cancel()


@dataclass(frozen=True)
class Call:
    """A call of Snakemake with its arguments, and the options in them.

    `place` is the working directory or, if nothing runs, a view of it. `take_plan` gets
    the plan; the call ends with it if nothing `is_shown`.
    """

    arguments: list[str]
    options: Namespace
    directory: Path
    place: Path
    take_plan: Callable[[Plan], None] | None = None
    is_shown: bool = True

    @property
    def runs(self) -> bool:
        """Whether it may run jobs."""
        return self.place == self.directory


def _has_any(options: Namespace, names: Sequence[str]) -> bool:
    """Return whether any of some options is given."""
    return any(getattr(options, name, None) for name in names)


def _quiet_words(options: Namespace) -> list[str]:
    """Return the words after `--quiet`."""
    return [item.name.lower() for item in options.quiet or []]


def _forced(options: Namespace, jobs: Iterable[Job]) -> list[str]:
    """Return the rules and files of planned jobs that run again in any case."""
    if options.forceall:
        return [job.rule for job in jobs]
    wanted = session.targets if options.force else []
    return [*(options.forcerun or []), *wanted]


def _plan_and_run(call: Call, *, left: Collection[str] | None = None) -> int:
    """Have Snakemake plan, and call it again without the results that are outdated;
    return its exit code.

    Snakemake leaves out the jobs behind one that ends while it looks at what a
    checkpoint has made. So it plans again if planned jobs are left, as long as others
    have ended. `left` are their keys.
    """
    if call.runs:
        # of a run that was killed
        restore_results(call.directory)
    is_plain = call.options.dryrun or call.runs
    if not is_plain or _has_any(call.options, MANAGING_OPTIONS):
        code, _ = _run_jobs(call, Plan())
        return code
    # the plan has the forced jobs, and Snakemake would leave out some behind a
    # checkpoint; the last of several options counts
    words = [word for word in call.arguments if word not in FORCE_OPTIONS]
    call = replace(call, arguments=[*words, "--forcerun"])
    events = Events()
    # its settings are those of a run
    profile = [] if call.options.workflow_profile else ["--workflow-profile", "none"]
    arguments = [*BY_MANIFEST, *call.arguments, *profile, *PLANNING]
    code = _call_snakemake(arguments, events, logging.ERROR)
    if code:
        return code
    with chdir(call.directory if call.directory.is_dir() else call.place):
        forced = left
        if forced is None:
            forced = _forced(call.options, events.jobs.values())
        plan = made_plan(events, session.targets, forced)
        if call.runs:
            keep_contents(plan)
    session.jobs = [job for job, _ in plan.reasoned_jobs]
    if call.take_plan:
        call.take_plan(plan)
    if not call.is_shown:
        return 0
    if events.has_nothing and not plan.reasons:
        if left is None:
            place = sys.stdout if call.options.dryrun else sys.stderr
            print("gyriflow: everything is up to date", file=place)
        return 0
    if not (call.runs or _has_any(call.options, SNAKEMAKE_LISTS)):
        print(listing(plan, _quiet_words(call.options)), end="")
        return 0
    if call.runs:
        hide_results(call.directory, plan.outdated)
    else:
        link_results(call.directory, call.place, plan.outdated)
    session.is_planned = True
    try:
        code, ended = _run_jobs(call, plan)
        still_left = set(plan.reasons) - ended
        if call.runs and code == 0 and ended and still_left:
            return _plan_and_run(call, left=still_left)
        return code
    finally:
        session.is_planned = False


def _run_jobs(call: Call, plan: Plan) -> tuple[int, set[str]]:
    """Run Snakemake, whose outdated results are hidden, and write the manifest of each
    job that ends; return its exit code, and the keys of these jobs."""
    is_detailed = call.options.verbose or call.options.debug_dag
    level = logging.NOTSET if is_detailed else logging.INFO
    arguments = [*BY_MANIFEST, *call.arguments]
    if not call.runs:
        return _call_snakemake(arguments, Events(plan.reasons), level), set()

    unwanted: Collection[str] = ()
    quiet = _quiet_words(call.options)
    if "progress" in quiet:
        # Snakemake would not name the jobs that have finished
        others = [word for word in quiet if word != "progress"]
        arguments += ["--quiet", *(others or ["host"])]
        level, unwanted = logging.INFO, ("job_finished", "progress")
    output: AbstractContextManager[None] = nullcontext()
    if not _has_any(
        call.options, READ_ONLY_OPTIONS + VERBOSE_OPTIONS + MANAGING_OPTIONS
    ):
        name = f"{datetime.now():%Y-%m-%dT%H%M%S.%f}.gyriflow.log"
        details = call.directory.resolve() / ".snakemake" / "log" / name
        logger = ("--logger", "gyriflow", "--logger-gyriflow-details", str(details))
        arguments = [*logger, *arguments]
        output = _output_to(details)
    events = Events(plan.reasons, plan.found)
    try:
        with output:
            code = _call_snakemake(arguments, events, level, unwanted)
    finally:
        restore_results(call.directory, events.started)
    return code, events.ended


def main(
    arguments: Sequence[str],
    take_plan: Callable[[Plan], None] | None = None,
    *,
    is_shown: bool = True,
) -> int:
    """Run Snakemake; return the exit code of the first failed step, or else Snakemake's
    own.

    `take_plan` gets the plan of a dry run, whose jobs are listed if `is_shown`.
    """
    # the program name in Snakemake's usage messages
    sys.argv[0] = "snakemake"
    # takes a second to import; the Snakefile imports this module without needing it
    from snakemake import cli

    shorten_usage_errors()
    parser = cli.get_argument_parser()
    options, unknown = parser.parse_known_args(arguments)
    _check_options(unknown, parser.format_usage())
    directory = options.directory or Path()
    is_second_pass = REFUSED_FILE_VAR in os.environ
    if not (options.configfile or options.snakefile or is_second_pass):
        print(f"gyriflow: {_what_runs(directory)}", file=sys.stderr)
    _check_configfiles(options.configfile or [], directory)
    session.is_launched = True
    session.targets = options.targets or ["all"]
    session.keeps_going = options.keep_going
    session.is_dry = _has_any(options, READ_ONLY_OPTIONS)
    session.viewed = None
    with nullcontext() if session.is_dry else locked(directory):
        return _run_workflow(arguments, options, directory, take_plan, is_shown)


def _run_workflow(
    arguments: Sequence[str],
    options: Namespace,
    directory: Path,
    take_plan: Callable[[Plan], None] | None,
    is_shown: bool,
) -> int:
    """Run Snakemake as `main` does, in a working directory that is locked unless
    nothing is run."""
    runs_nothing = session.is_dry and not options.nolock
    if not runs_nothing:
        _set_cache(directory)
    _set_environment()
    complete = list(arguments)
    # a folder of that name may be in the working directory
    if not options.workflow_profile:
        profile = SHIPPED / "profiles" / "default"
        complete = ["--workflow-profile", str(profile), *complete]
    if options.snakefile is None:
        complete = ["--snakefile", str(SHIPPED / "Snakefile"), *complete]
    began_s = time.time()
    with view_of(directory) if runs_nothing else nullcontext(directory) as place:
        if runs_nothing:
            _set_cache(place)
            complete += ["--directory", str(place)]
            if directory.is_dir():
                session.viewed = directory.absolute()
        call = Call(complete, options, directory, place, take_plan, is_shown)
        code = _plan_and_run(call)
    if code > 128:
        print(
            "gyriflow: interrupted; run the same command again to resume",
            file=sys.stderr,
        )
        return code
    if code == 0 or session.is_dry:
        return code
    messages = study_messages(directory, began_s)
    failures = [message for message in messages if message.level == "error"]
    if options.keep_going and REFUSED_FILE_VAR not in os.environ:
        brains = _brains_to_refuse(failures)
        if brains and (interrupted := _finish_without(brains, arguments, directory)):
            return interrupted
    return _exit_code(code, failures, directory)


def _brains_to_refuse(failures: Sequence[Message]) -> dict[str, str]:
    """Return the causes of the brains that the study is finished without, by id: those
    with a failed step, from the errors of steps."""
    causes: dict[str, str] = {}
    for failure in failures:
        # a failed run refuses no brain
        if failure.brain and not failure.run:
            causes.setdefault(failure.brain, failure.first_line)
    return causes


def _finish_without(
    refused: dict[str, str],
    arguments: Sequence[str],
    directory: Path,
) -> int:
    """Run the same call again without the refused brains, unless it asks for their
    files.

    Return the exit code of an interrupted run, or else 0.
    """
    folders = tuple(f"results/brains/{brain}/" for brain in refused)
    if any(argument.startswith(folders) for argument in arguments):
        return 0
    path = directory.absolute() / ".snakemake" / f"gyriflow-refused-{os.getpid()}.json"
    write_json(path, refused)
    again = [sys.executable, "-m", "gyriflow.running.launch", *arguments]
    environment = os.environ | {REFUSED_FILE_VAR: str(path)}
    # if this process is killed, the second pass keeps the directory locked; Windows
    # hands on no files
    files = list(_held_locks.values()) if sys.platform != "win32" else []
    process = subprocess.Popen(
        again,
        env=environment,
        stdout=sys.stdout,
        stderr=sys.stderr,
        pass_fds=[file.fileno() for file in files],
    )
    try:
        process.wait()
    except KeyboardInterrupt:
        _stop_jobs()
        return process.wait()
    finally:
        path.unlink(missing_ok=True)
    return 0


def refused_brains() -> dict[str, str]:
    """Return the causes of the brains that an earlier pass of this call refused, by
    id, for the rules (`common.smk`)."""
    path = os.environ.get(REFUSED_FILE_VAR)
    return read_json(path) if path else {}


def _exit_code(
    code: int,
    failures: Sequence[Message],
    directory: Path,
) -> int:
    """Return the exit code of a run that failed with Snakemake's `code`: that of the
    first error of a step that has one; report a full disk."""
    code = next(
        filter(None, (failure.exit_code for failure in failures)),
        code,
    )
    if code == 1 and (full := full_disk(directory)):
        print(
            f"gyriflow: {directory.resolve()}: {full}, then run the same command again",
            file=sys.stderr,
        )
        return StorageError.exit_code
    return code


def full_disk(directory: Path) -> str:
    """Return that the disk of a directory is full and what to do, or "" if it is
    not."""
    is_full = shutil.disk_usage(directory).free < MIN_FREE_BYTES
    return "the disk is full. Free some space" if is_full else ""


if __name__ == "__main__":
    # the Snakefile imports this module by name; run that copy, so that both share the
    # same locks
    from gyriflow.running.launch import main

    collect_rarely()
    try:
        sys.exit(main(sys.argv[1:]))
    except GyriflowError as error:
        print(f"gyriflow: {error}", file=sys.stderr)
        sys.exit(error.exit_code)
