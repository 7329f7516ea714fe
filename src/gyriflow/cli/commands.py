"""The commands of `gyriflow`, thin: each reads its arguments, calls one function and
prints what it returns."""

import os
import shlex
import shutil
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from ..errors import GyriflowError, InputError
from ..grouping import counted, grouped
from ..memory import collect_rarely
from ..running.machine import available_cores
from ..shipped import CONFIG, DEMO, SHIPPED, shipped_atlases

if TYPE_CHECKING:
    from .recognition import FoundScans

LEVELS = ("participant", "group")
BIDS_LEVELS = [[level] for level in LEVELS]
BIDS_LABEL_OPTIONS = (
    "--participant-label",
    "--participant_label",
    "--session-label",
    "--session_label",
)
"""Options of BIDS apps with several values after each other."""
NOTHING_TO_FOLD = (
    "gyriflow: --fold: no subject has several scans, so none is folded. To fold others,"
    " name start and folding.end_week in --settings."
)
NOT_FOLDED = "gyriflow: --settings: without --fold, these are not used:"
NOTATIONS = {None: None, True: "decimal", False: "days"}
REMOTE_OPTIONS = ("--profile", "--executor", "-e")
"""Options of Snakemake with which jobs run on other machines."""


class Cores(click.IntRange):
    """A number of cores, or `all` that may be used."""

    def convert(
        self,
        value: Any,
        param: click.Parameter | None,
        ctx: click.Context | None,
    ) -> Any:
        """Return the number."""
        return (
            available_cores() if value == "all" else super().convert(value, param, ctx)
        )


class InputPath(click.Path):
    """A path, with a hint if there is none."""

    def convert(
        self,
        value: Any,
        param: click.Parameter | None,
        ctx: click.Context | None,
    ) -> Any:
        """Return the path; BadParameter with a hint if there is none."""
        try:
            return super().convert(value, param, ctx)
        except click.BadParameter as error:
            if Path(value).exists():
                # it is of the wrong kind, which click says
                raise
            # settings take a while to import
            from ..settings.base import hint_for_missing

            hint = hint_for_missing(Path(value))
            self.fail(f"{error.message.rstrip('.')}{hint}.", param, ctx)


FOLDER = click.Path(file_okay=False, path_type=Path)
EXISTING_DIR = InputPath(
    exists=True,
    file_okay=False,
    path_type=Path,
)
EXISTING_FILE = InputPath(
    exists=True,
    dir_okay=False,
    path_type=Path,
)
directory_option = click.option(
    "-d",
    "--directory",
    type=FOLDER,
    default=Path(),
    help="Working directory, for results/. [default: here]",
)
cores_option = click.option(
    "-c",
    "--cores",
    type=Cores(1),
    default=available_cores,
    show_default="all",
    help="Cores to use, or all.",
)
stages_option = click.option(
    "-s",
    "--stage",
    "stages",
    multiple=True,
    help="Stop at this target. May be repeated.",
)
scheme_option = click.option(
    "--scheme", help="Label scheme. [default: found from the labels]"
)
files_option = click.option(
    "--files", help="Pattern of the paths to use if a scan has several files."
)
notation_option = click.option(
    "--decimal-weeks/--weeks-days",
    "notation",
    default=None,
    callback=lambda _, __, value: NOTATIONS[value],
    help="Whether an age of 24.3 is decimal, or 24+3.",
)
dry_run_option = click.option(
    "-n", "--dry-run", is_flag=True, help="Only show what would run, and why."
)


class Commands(click.Group):
    """Commands that end in one message and the exit code of their error, without a
    traceback."""

    def parse_args(self, context: click.Context, args: list[str]) -> list[str]:
        """Read the arguments; those of a BIDS app, `BIDS OUT participant`, are of the
        command `bids`."""
        # a data set may lie in a folder that is called as a command
        named = (
            bool(args)
            and args[0] in self.commands
            and (args[3:4] in BIDS_LEVELS or not Path(args[0]).is_dir())
        )
        if not named and args[2:3] in BIDS_LEVELS:
            args = ["bids", *_one_by_one(args)]
        return super().parse_args(context, args)

    def invoke(self, context: click.Context) -> Any:
        """Run the command that is asked for."""
        try:
            _require_current_folder()
            return super().invoke(context)
        except GyriflowError as error:
            click.echo(f"gyriflow: {error}", err=True)
            sys.exit(error.exit_code)
        except click.UsageError as error:
            command = error.ctx.command_path if error.ctx else _command_name()
            message = " ".join(error.format_message().split())
            click.echo(
                f"gyriflow: {message} See `{command} --help`.",
                err=True,
            )
            sys.exit(error.exit_code)


def _require_current_folder() -> None:
    """Raise InputError if the current folder was deleted, since all paths are relative
    to it."""
    try:
        Path.cwd()
    except FileNotFoundError:
        raise InputError(
            "the current folder no longer exists", remedy="cd to one that does."
        ) from None


def _one_by_one(args: Sequence[str]) -> list[str]:
    single, option = [], ""
    for argument in args:
        if argument.startswith("-"):
            option = argument if argument in BIDS_LABEL_OPTIONS else ""
            single += [] if option else [argument]
        else:
            single += [option, argument] if option else [argument]
    return single


def _command_name() -> str:
    """Return what a user types here to get this command: in a checkout that is not
    installed, its `run` and the name."""
    run = SHIPPED / "run"
    if shutil.which("gyriflow") or not run.is_file():
        return "gyriflow"
    path = os.path.relpath(run)
    return f"./{path} gyriflow" if path == run.name else f"{path} gyriflow"


def _print_version(
    context: click.Context,
    parameter: click.Parameter,
    value: bool,
) -> None:
    """Print the version and end."""
    if value and not context.resilient_parsing:
        from ..version import version

        click.echo(f"gyriflow {version()}")
        context.exit()


@click.group(
    cls=Commands,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    epilog=f"Every key of a configuration: {SHIPPED / 'config' / 'README.md'}",
)
@click.option(
    "--version",
    is_flag=True,
    expose_value=False,
    is_eager=True,
    callback=_print_version,
    help="Show the version.",
)
def main() -> None:
    """From fetal brain MRI to folding metrics.

    \b
    A study, from its data to its report:
      gyriflow init my-data    write my-data/gyriflow.yaml for the files there
      cd my-data
      gyriflow check           check the files; show what will run and how long it takes
      gyriflow run             run it; after an interruption, run it again to resume
      gyriflow status          show the progress (from another terminal)
      gyriflow view            open the report

    \b
    Metrics without simulations, of a folder or a configuration:
      gyriflow measure my-data

    \b
    A BIDS data set (see gyriflow bids --help):
      gyriflow BIDS OUT participant, then gyriflow BIDS OUT group

    \b
    A brain at a later week, predicted from one scan:
      gyriflow predict LABELS --week 22.4 --until 30 --atlas crl
      gyriflow predict LEFT RIGHT --week 22.4 --until 30 --atlas crl
    """
    collect_rarely()


@main.command()
@click.argument("folder", type=EXISTING_DIR)
@click.option(
    "-o",
    "--output",
    type=click.Path(dir_okay=False, path_type=Path),
    help=f"[default: FOLDER/{CONFIG}]",
)
@click.option("--force", is_flag=True, help="Replace an existing configuration.")
@scheme_option
@files_option
@notation_option
def init(
    folder: Path,
    output: Path | None,
    force: bool,
    **selection: Any,
) -> None:
    """Write a configuration for the brains in a FOLDER.

    It recognises tissue label volumes (and their label scheme), surfaces, and ages in
    participants.tsv, sessions.tsv or in names such as week21 or GA21. Files that cannot
    be used are listed with the cause; the exit code is then 2.
    """
    from .init import write_configuration
    from .recognition import recognise

    path = output or folder / CONFIG
    found = recognise(folder, **selection)
    kept = write_configuration(found, folder, path, force=force)
    if kept:
        click.echo(f"the earlier configuration is now {kept}")
    argument = shlex.quote(str(path))
    code = _show_scans(found, may_fill_in=True)
    click.echo(f"wrote {path}; next: {_command_name()} check {argument}")
    sys.exit(code)


def _show_scans(
    found: "FoundScans",
    directory: Path | None = None,
    *,
    may_fill_in: bool = False,
) -> int:
    """Print the table of scans, with the verdicts on those measured in a directory, and
    the unused files; return the exit code, 0 if values `may_fill_in` only."""
    from .scans import found_rows, scan_lines

    _show_unused(found)
    for line in scan_lines(found_rows(found, directory)):
        click.echo(line)
    causes = (
        brain.problem or brain.contradiction or (brain.notes and not may_fill_in)
        for brain in found.brains
    )
    return InputError.exit_code if any(causes) else 0


def _show_unused(found: "FoundScans") -> None:
    for line, _ in grouped(
        (file, f"not used: {file} ({reason})") for file, reason in found.unused.items()
    ):
        click.echo(line)


@main.command()
@click.argument(
    "data",
    type=click.Path(path_type=Path),
    required=False,
    metavar="[FOLDER|CONFIG]",
)
@scheme_option
@files_option
@notation_option
@directory_option
@cores_option
@stages_option
def check(
    data: Path | None,
    directory: Path,
    cores: int,
    stages: Sequence[str],
    **selection: Any,
) -> None:
    """Check a study; show what it would run and need.

    Its configuration and files are checked. Nothing is run or written. CONFIG is
    gyriflow.yaml by default. A FOLDER without gyriflow.yaml is checked as `gyriflow
    measure` would measure it.
    """
    from ..running.launch import MEASURE_ONLY_VAR
    from .check import check_study
    from .init import write_configuration
    from .recognition import recognise

    is_folder = data is not None and data.is_dir() and not (data / CONFIG).exists()
    problems = 0
    age_sources = {}
    with TemporaryDirectory() as scratch:
        if data is not None and is_folder:
            config = Path(scratch) / CONFIG
            os.environ[MEASURE_ONLY_VAR] = "1"
            found = recognise(data, **selection)
            write_configuration(found, data, config, only_measured=True)
            problems += sum(bool(brain.causes) for brain in found.brains)
            for brain in found.brains:
                age_sources[brain.entry["id"]] = brain.age_source
            _show_unused(found)
        else:
            _require_no_selection(data, **selection)
            config = _find_config(
                data / CONFIG if data is not None and data.is_dir() else data, directory
            )
        for line, bad in check_study(
            config,
            directory,
            cores,
            stages,
            name=data if is_folder else None,
            age_sources=age_sources,
        ):
            click.echo(line)
            problems += bad
    if problems:
        click.echo(f"gyriflow: {counted(problems, 'problem')} found", err=True)
        sys.exit(2)


@contextmanager
def _place_to_write(
    directory: Path, dry_run: bool, option: str = "--directory"
) -> Iterator[Path]:
    """Yield the working directory to write a configuration into, locked; for a dry run
    a temporary folder.

    StorageError if another run uses the directory; `option` names another one.
    """
    if dry_run:
        with TemporaryDirectory() as scratch:
            yield Path(scratch)
        return
    from ..running.launch import locked

    with locked(directory, option):
        yield directory


def _require_no_selection(data: Path | None, **selection: Any) -> None:
    """Raise InputError if options are set that select the files of a folder, where a
    configuration has them."""
    names = {
        "scheme": "--scheme",
        "files": "--files",
        "notation": "--decimal-weeks, --weeks-days",
    }
    if given := [names[key] for key, value in selection.items() if value is not None]:
        remedy = (
            f"Set these in the configuration, or write it anew: {_command_name()} init"
            " FOLDER --force."
        )
        raise InputError(
            f"{', '.join(given)}: not used, as there is a configuration",
            path=data,
            remedy=remedy,
        )


@main.command(context_settings={"ignore_unknown_options": True})
@directory_option
@cores_option
@stages_option
@dry_run_option
@click.option("-v", "--verbose", is_flag=True, help="Show all messages of Snakemake.")
@click.argument(
    "further",
    nargs=-1,
    type=click.UNPROCESSED,
    metavar="[CONFIG] [SNAKEMAKE-ARGUMENTS]",
)
def run(
    directory: Path,
    cores: int,
    stages: Sequence[str],
    dry_run: bool,
    verbose: bool,
    further: Sequence[str],
) -> None:
    """Run a study. Results that are up to date are kept.

    CONFIG is gyriflow.yaml by default. Further arguments go to Snakemake, such as
    `--profile profiles/slurm`.
    """
    first = further[0] if further else ""
    # other arguments are options and results
    is_file = Path(first).is_file() and not first.startswith(("-", "results/"))
    named = is_file or first.lower().endswith((".yaml", ".yml", ".json"))
    config = _find_config(Path(first) if named else None, directory)
    # an option of one value stands before the targets
    options = ["--verbose"] if verbose else []
    # a cluster is limited by its profile, not by the cores of this machine
    default = (
        click.get_current_context().get_parameter_source("cores")
        == ParameterSource.DEFAULT
    )
    is_remote = any(
        argument.partition("=")[0] in REMOTE_OPTIONS for argument in further
    )
    if not (default and is_remote):
        options += ["--cores", str(cores)]
    elif dry_run:
        cores = _remote_cores(further, cores)
    sys.exit(
        _run(
            config, directory, cores, dry_run, options, *stages, *further[int(named) :]
        )
    )


def _remote_cores(further: Sequence[str], default: int) -> int:
    """Return the cores for the forecast of jobs on other machines: one for each of the
    jobs that run at the same time."""
    from ..running.snakemake_internals import max_jobs, shorten_usage_errors

    shorten_usage_errors()
    return max_jobs(further) or default


def _run(
    config: Path,
    directory: Path,
    cores: int,
    dry_run: bool,
    options: list[str],
    *targets: str,
) -> int:
    if dry_run:
        from .check import work_of

        for line, _ in work_of(
            config, directory, cores, [*options, *targets], show="--verbose" in options
        ):
            click.echo(line)
        return 0
    from ..running.launch import main as launch

    return launch(
        [
            "--configfile",
            str(config.absolute()),
            *options,
            "--directory",
            str(directory),
            *targets,
        ]
    )


@main.command()
@click.argument(
    "data", type=InputPath(exists=True, path_type=Path), metavar="FOLDER|CONFIG"
)
@scheme_option
@files_option
@notation_option
@directory_option
@cores_option
@dry_run_option
def measure(
    data: Path,
    directory: Path,
    cores: int,
    dry_run: bool,
    **selection: Any,
) -> None:
    """Measure brains and write the report, without simulations.

    The brains are those of a folder or a configuration. In a FOLDER without
    gyriflow.yaml, one is written, as by `gyriflow init`. It needs neither `start` nor
    `folding`. If a brain fails, the others are finished; the exit code is that of the
    first failure.
    """
    from ..running.launch import MEASURE_ONLY_VAR
    from .init import commented_scans, write_configuration
    from .recognition import recognise

    config = data / CONFIG if data.is_dir() else data
    os.environ[MEASURE_ONLY_VAR] = "1"
    refused = 0
    found = None
    if not config.exists():
        found = recognise(data, **selection)
    else:
        _require_no_selection(data, **selection)
        for line in commented_scans(config) if data.is_dir() else ():
            click.echo(f"not used, by {config}: {line}")
            refused = InputError.exit_code
    with _place_to_write(directory, dry_run) as place:
        if found is not None:
            # a dry run writes nothing beside the data
            config = place / CONFIG if dry_run else config
            write_configuration(found, data, config, only_measured=True)
            refused = _show_scans(found)
        code = _run(
            config,
            directory,
            cores,
            dry_run,
            ["--cores", str(cores), "--keep-going"],
            "all",
        )
    sys.exit(code or refused)


@main.command()
@click.argument(
    "files",
    type=EXISTING_FILE,
    nargs=-1,
    required=True,
    metavar="LABELS|SURFACE|LEFT RIGHT",
)
@click.option(
    "--white",
    type=EXISTING_FILE,
    multiple=True,
    help="White surface: one for each pial surface.",
)
@click.option(
    "--week",
    type=float,
    required=True,
    help="Gestational week of the scan.",
)
@click.option(
    "--until",
    type=float,
    required=True,
    help="Gestational week to predict.",
)
@click.option(
    "--atlas",
    help=(
        f"Atlas whose growth is used: {', '.join(shipped_atlases())}, or an atlas.yaml."
    ),
)
@scheme_option
@click.option(
    "--folder",
    type=EXISTING_DIR,
    help="Folder with the atlas' files. [default: download them]",
)
@click.option("--image", type=EXISTING_FILE, help="T2-weighted volume of the scan.")
@click.option(
    "--accept-licence",
    "accepted",
    is_flag=True,
    help="Accept the licence of the atlas.",
)
@click.option(
    "--ensemble",
    type=click.IntRange(3),
    help="Also fold so many members with uncertain inputs varied.",
)
@click.option(
    "--quick",
    is_flag=True,
    help="First look: coarse meshes, steps of a week, every third week of the atlas.",
)
@click.option("--force", is_flag=True, help="Replace an existing configuration.")
@directory_option
@cores_option
@dry_run_option
def predict(
    files: Sequence[Path],
    week: float,
    until: float,
    atlas: str | None,
    force: bool,
    directory: Path,
    cores: int,
    dry_run: bool,
    **settings: Any,
) -> None:
    """Predict a brain at a later week.

    It is given as tissue LABELS, as one pial SURFACE of the whole brain, or as the pial
    surfaces of its LEFT and RIGHT hemisphere. It grows as the brains of an atlas do.
    This writes gyriflow.yaml into the working directory and runs it. The report shows
    where the predicted surfaces and labels are. After an interruption, the same command
    resumes.
    """
    from .init import SHIPPED_ATLAS, predicted_study, replace_configuration

    if atlas is None:
        click.echo(
            f"warning: without --atlas, {SHIPPED_ATLAS} is used. Its brains have spina"
            " bifida aperta and are not normal; unoperated ones end at 25 GW"
        )
    text, description = predicted_study(
        files, (week, until), atlas=atlas or SHIPPED_ATLAS, **settings
    )
    path = directory / CONFIG
    with _place_to_write(directory, dry_run) as place:
        kept = replace_configuration(
            place / CONFIG, text, path, "--directory", force=force
        )
        if kept:
            click.echo(f"the earlier configuration is now {kept}")
        click.echo(f"{description}; configuration: {path}")
        code = _run(
            place / CONFIG,
            directory,
            cores,
            dry_run,
            ["--cores", str(cores)],
            "all",
            "export",
        )
    sys.exit(code)


@main.command()
@click.argument("data", type=EXISTING_DIR, metavar="BIDS")
@click.argument("out", type=FOLDER)
@click.argument("level", type=click.Choice(LEVELS))
@click.option(
    *BIDS_LABEL_OPTIONS[:2],
    "participants",
    multiple=True,
    help="Only these participants.",
)
@click.option(
    *BIDS_LABEL_OPTIONS[2:], "sessions", multiple=True, help="Only these sessions."
)
@files_option
@notation_option
@scheme_option
@click.option(
    "--settings",
    type=click.Path(
        exists=True,
        dir_okay=False,
        resolve_path=True,
    ),
    help="Configuration without brains, such as resolution, norms or what to fold.",
)
@click.option(
    "--fold/--no-fold",
    default=None,
    help="Fold the first of several scans of a subject. [default: no]",
)
@click.option(
    "-w",
    "--work-dir",
    "work",
    type=FOLDER,
    help="Working directory, for results/. [default: OUT/work]",
)
@cores_option
@dry_run_option
def bids(
    data: Path,
    out: Path,
    level: str,
    work: Path | None,
    cores: int,
    dry_run: bool,
    **selection: Any,
) -> None:
    """Run a BIDS data set, as a BIDS app: BIDS OUT LEVEL.

    The data are tissue labels or surfaces. The level participant writes surfaces and
    maps of each participant to OUT, and with --fold simulations, too. The level group
    adds the tables and the report of all participants, with the same options. Results
    that are up to date are kept. If a participant fails, the others are finished.
    """
    from ..io.exports import publish_derivatives
    from ..io.made_files import require_own_data_set
    from .init import (
        BIDS_OPTIONS,
        store_options,
        with_earlier_options,
        write_bids,
    )
    from .recognition import recognise

    require_own_data_set(out)
    work = work or out / "work"
    config, exported = work / CONFIG, work / "results" / "export"
    options = work / BIDS_OPTIONS
    if level == "group":
        selection = with_earlier_options(options, selection)
    folding = {key: selection[key] for key in ("settings", "fold")}
    found = recognise(
        data, **{key: value for key, value in selection.items() if key not in folding}
    )
    targets = ["quality", "export"] if level == "participant" else ["all", "export"]
    with _place_to_write(work, dry_run, "--work-dir") as place:
        brains, folded, unused = write_bids(
            found,
            data,
            place / CONFIG,
            config,
            **folding,
        )
        if level == "participant" and not dry_run:
            store_options(options, selection)
        click.echo(f"{counted(len(brains), 'scan')} to measure: {', '.join(brains)}")
        if folded:
            click.echo(f"{len(folded)} of them to fold: {', '.join(folded)}")
        elif selection["fold"]:
            click.echo(NOTHING_TO_FOLD, err=True)
        elif selection["fold"] is None and unused:
            click.echo(f"{NOT_FOLDED} {', '.join(unused)}", err=True)
        if not dry_run:
            click.echo(f"configuration: {config}")
        code = _run(
            place / CONFIG,
            work,
            cores,
            dry_run,
            ["--cores", str(cores), "--keep-going"],
            *targets,
        )
        if not dry_run and (exported / "dataset_description.json").is_file():
            publish_derivatives(exported, out, data, brains, whole=level == "group")
            click.echo(f"derivatives: {out}")
    refused = _show_scans(found, None if dry_run else work)
    sys.exit(code or refused)


@main.command()
@click.argument("directory", type=FOLDER, default=Path())
def status(directory: Path) -> None:
    """Show the progress of a study."""
    from ..running import status as module

    for line in module.status(directory):
        click.echo(line)


@main.command()
@click.argument("directory", type=FOLDER, default=Path())
@click.option(
    "--print",
    "only_print",
    is_flag=True,
    help="Print the path of the report instead of opening it.",
)
def view(directory: Path, only_print: bool) -> None:
    """Open the report of the study in a working directory or an export."""
    from ..running.status import REPORT_PAGE

    pages = directory / REPORT_PAGE, directory / "report" / REPORT_PAGE.name
    report = next(filter(Path.is_file, pages), None)
    if report is None:
        raise InputError(
            "has no report yet", path=directory.resolve(), expected=str(REPORT_PAGE)
        )
    report = report.absolute()
    click.echo(report)
    if not only_print:
        click.launch(str(report))


def _find_config(config: Path | None, directory: Path) -> Path:
    found = config or next(
        (path for path in (Path(CONFIG), directory / CONFIG) if path.is_file()),
        Path(CONFIG),
    )
    if not found.is_file():
        remedy = (
            f"Write one from the files of a folder: {_command_name()} init FOLDER. The"
            f" demo's is {DEMO}."
        )
        raise InputError("found no configuration", path=found.absolute(), remedy=remedy)
    return found
