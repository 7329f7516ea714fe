"""Check a study before it is run: its configuration, its files, what will run, and what
that will take."""

import math
import shutil
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from contextlib import chdir, contextmanager
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from textwrap import fill
from typing import NamedTuple

from ..errors import InputError
from ..grouping import grouped
from ..io.volumes import read_header
from ..io.yaml_files import read_keys
from ..names import require_bids_names
from ..running.cost import (
    DEEP_FOLDS_GW,
    ERROR_FACTOR,
    FOLDINGS,
    MIN_SURFACE_MIB,
    job_seconds,
    simulation_needs,
    surface_memory_mib,
)
from ..running.launch import main as launch
from ..running.machine import available_cores, available_memory_mib
from ..running.manifest import CHANGED_CODE
from ..running.planning import BY_ANOTHER_JOB, MISSING, Plan
from ..running.provenance import recorded_version
from ..running.status import format_duration
from ..settings.base import folder_of
from ..settings.brains import BrainConfig
from ..settings.root import Config
from ..settings.terms import (
    ELEMENTS_NEEDED,
    LARGE_ELEMENT_ERROR,
    element_error,
    is_too_coarse,
)
from ..settings.varying import Varying, curve_at
from ..study.atlases import atlas_by_brain, known_checksums, used_atlases
from ..study.brains import label_scheme
from ..study.loading import load
from ..study.paths import PLAN
from ..study.resolve import resolve
from ..study.study import Study
from ..version import version
from .init import commented_scans
from .readings import ScanFiles, collected_warnings, readings
from .scans import ScanRow, scan_lines

NAMED_RUNS = 6
THROUGH_CORTEX = {
    ("pytetwild", 1): 0.95,
    ("pytetwild", 2): 0.39,
    ("tetgen", 1): 0.67,
    ("tetgen", 2): 0.27,
}
"""Elements through a cortex as thick as `mesh.surface_edge_mm`, by mesher and order, as
found on the shipped brains."""


class PlannedJob(NamedTuple):
    """A job of a dry run, with the reason to run it."""

    rule: str
    wildcards: dict[str, str]
    threads: int
    reason: str
    inputs: Sequence[str] = ()
    outputs: Sequence[str] = ()


def check_study(
    path: Path,
    directory: Path,
    cores: int,
    stages: Sequence[str] = (),
    *,
    name: Path | None = None,
) -> Iterator[tuple[str, int]]:
    """Yield lines on a study, its files and what would run up to some stages, each with
    its number of problems.

    `name` stands for a temporary configuration.
    """
    with _read_study(path, directory) as study, collected_warnings() as logged:
        config, problems = study.config, list(input_problems(study.config))
        valid = not any(bad for *_, bad in problems)
        volumes = [
            volume
            for brain in config.brains
            if (volume := brain.labels) and Path(volume).is_file()
        ]
        without_unit = (
            sum(read_header(volume).unit == "unknown" for volume in volumes)
            if valid
            else 0
        )
        from .inputs import check_other_files, input_facts

        further, facts = list(check_other_files(study)), list(input_facts(study))
        valid = valid and not further
        downloads = sum(len(atlas.missing) for atlas in used_atlases(config))
    yield f"{name or path}: {_contents(study)}", False
    warnings = [
        (brain, f"  warning: brain {brain}: {text}")
        for brain, text, bad in problems
        if not bad
    ]
    told = {text for _, text, _ in problems}
    texts = [record.getMessage() for record in logged]
    warnings += [("", f"  warning: {text}") for text in texts if text not in told]
    yield from ((line, False) for line, _ in grouped(warnings))
    refusals = [
        (brain, f"  brain {brain}: {text}") for brain, text, bad in problems if bad
    ]
    refusals += [(owner, f"  {owner}: {text}") for owner, text, _ in further]
    yield from grouped(refusals)
    yield from ((f"  {line}", False) for line in facts)
    for line in (*coarse_cortices(study), *deep_curved_folds(study)):
        yield f"  warning: {line}", False
    yield from (
        (f"  warning: no export: {line}", False) for line in export_problems(study)
    )
    if without_unit:
        yield (
            (
                f"  note: {without_unit} of {len(volumes)} label volumes give no unit"
                " of length, taken as mm"
            ),
            False,
        )
    if downloads:
        yield (
            (
                f"  {downloads} atlas file{'s are' if downloads > 1 else ' is'} missing"
                " and will be downloaded"
            ),
            False,
        )
    if valid:
        yield "  input files: no problem found", False
        plan_folder = directory / PLAN
        yield f"  plan: tables in {plan_folder}, written before the first step", False
        yield from work_of(
            path, directory, cores, ["--cores", str(cores), *stages], study
        )
    yield from ((f"not used: {line}", False) for line in commented_scans(path))
    yield from ((line, False) for line in scan_lines(_scans(config, problems)))


@contextmanager
def _read_study(path: Path, directory: Path) -> Iterator[Study]:
    """Read a study in its working directory, since paths of a configuration may be
    relative to that."""
    file = path.absolute()
    with chdir(directory if directory.is_dir() else Path()):
        yield resolve(load(read_keys(file), folder_of(file)))


def work_of(
    path: Path,
    directory: Path,
    cores: int,
    further: Sequence[str],
    study: Study | None = None,
    *,
    show: bool = False,
) -> Iterator[tuple[str, bool]]:
    """Yield lines about the jobs that would run and their needs, each with whether
    these exceed the available ones.

    The study is read from `path` unless given. `further` are arguments for Snakemake.
    With `show`, it lists every job on the terminal first.
    """
    jobs = plan(path, directory, further, show=show)
    if not jobs:
        yield "nothing to run: everything is up to date", False
        return
    yield f"to run: {len(jobs)} step{'s' if len(jobs) > 1 else ''}", False
    rules_by_reason: dict[str, Counter[str]] = defaultdict(Counter)
    for job in jobs:
        rules_by_reason[_why(job.reason, directory)][job.rule] += 1
    for reason, rules in rules_by_reason.items():
        words = ", ".join(
            rule if number == 1 else f"{rule}×{number}"
            for rule, number in rules.items()
        )
        yield (
            fill(
                f"{reason}: {words}",
                width=100,
                initial_indent="  ",
                subsequent_indent="    ",
            ),
            False,
        )
    if study is None:
        with _read_study(path, directory) as read:
            study = read
    yield from _needs(jobs, study, directory, cores)


def _why(reason: str, directory: Path) -> str:
    """Return the reason to run a job, without the files of a general one."""
    if reason == CHANGED_CODE:
        made_by, this = recorded_version(directory), version()
        if made_by not in (None, this):
            return f"{reason} (gyriflow {made_by}, now {this})"
    for words in (MISSING, BY_ANOTHER_JOB):
        if reason.startswith(words):
            return words
    return reason


def plan(
    config: Path,
    directory: Path,
    further: Sequence[str],
    *,
    show: bool = False,
) -> list[PlannedJob]:
    """Return the jobs that Snakemake would run, without targets, or exit with its code;
    `show` lists them, too."""
    plans: list[Plan] = []
    with TemporaryDirectory() as empty:
        place = directory.resolve() if directory.is_dir() else empty
        options = ["--configfile", str(config.absolute()), "--directory", str(place)]
        call = [*options, "--dry-run", *further]
        code = launch(call, plans.append, is_shown=show)
        if code:
            sys.exit(code)
        jobs = []
        for job, why in plans[0].reasoned_jobs:
            names = dict(job.wildcards)
            files = job.files, job.outputs
            jobs.append(PlannedJob(job.rule, names, job.threads(), why, *files))
        return jobs


def _contents(study: Study) -> str:
    runs = list(study.config.runs)
    names = [*runs[:NAMED_RUNS], *(["…"] if len(runs) > NAMED_RUNS else [])]
    brains, folded = len(study.brains), len(study.run_simulations)
    simulations = (
        f"{folded} simulation{'s' if folded > 1 else ''} ({', '.join(names)})"
        if folded
        else "measured only"
    )
    parts = [f"{brains} brain{'s' if brains > 1 else ''}", simulations]
    parts += [f"{len(runs)} of sweep {name}" for name, runs in study.by_sweep.items()]
    if study.calibration:
        calibrated = {run for run, _ in study.calibration}
        parts.append(f"{len(calibrated)} of the calibration")
    return ", ".join(parts)


def coarse_cortices(study: Study) -> Iterator[str]:
    """Yield a warning, with its runs, for each number of elements through the cortex
    that is too small or inexact."""
    mesh = study.config.mesh
    coarse: dict[str, list[str]] = defaultdict(list)
    needed = ELEMENTS_NEEDED[mesh.order]
    for simulation in study.run_simulations:
        if not simulation.settings.growth.definition.has_layers:
            continue
        thickness = simulation.settings.thickness_mm
        # a map's thickness is unknown before the surface is made
        if isinstance(thickness, Varying) and thickness.map:
            continue
        through = THROUGH_CORTEX[mesh.mesher, mesh.order] * curve_at(
            thickness, simulation.weeks[0]
        )
        elements = through / mesh.surface_edge_mm
        error, text = element_error(mesh.order, elements)
        few, remedy = "", "mesh.order: 2"
        if is_coarse := is_too_coarse(mesh.order, elements):
            few = f", fewer than the {needed:g} needed"
            remedy = (
                f"mesh.surface_edge_mm: {math.floor(100 * through / needed) / 100:g}"
            )
        if is_coarse or error > LARGE_ELEMENT_ERROR:
            coarse[f"about {text}{few}; use {remedy}"].append(
                f"run {simulation.run} from {simulation.brain}"
            )
    yield from (f"{', '.join(names)}: {text}" for text, names in coarse.items())


def deep_curved_folds(study: Study) -> Iterator[str]:
    """Yield a warning for each simulation in which quadratic elements grow towards
    shapes with deep folds, on the way to which they fold over."""
    if study.config.mesh.order == 1:
        return
    for simulation in study.run_simulations:
        if simulation.shapes and simulation.settings.end_week > DEEP_FOLDS_GW:
            yield (
                f"run {simulation.run} from {simulation.brain}: quadratic elements"
                f" fold over on the way to shapes later than {DEEP_FOLDS_GW:g} GW; use"
                " mesh.order: 1"
            )


def export_problems(study: Study) -> Iterator[str]:
    """Yield why a study cannot be exported under the labels that BIDS would give its
    subjects and runs."""
    try:
        require_bids_names(
            [brain.subject_name for brain in study.brains.values()], study.config.runs
        )
    except InputError as error:
        yield str(error)


def input_problems(config: Config) -> Iterator[tuple[str, str, bool]]:
    """Yield each problem or warning about a brain's input files: the brain's id, the
    text, and if it is a problem.

    Unreadable files and labels of another scheme are problems; an unusual size for the
    week is a warning.
    """
    # takes half a second, which other commands need not wait for
    from .inputs import doubts_about_files

    checksums = known_checksums(used_atlases(config))
    scans = []
    for brain in config.brains:
        files = [*brain.files, *brain.white_files.values()]
        if brain.image:
            files.append(brain.image)
        scheme = label_scheme(config, brain.scheme) if brain.labels else None
        sums = {path: checksums[path] for path in files if path in checksums}
        scans.append(ScanFiles(files, (brain, scheme, sums)))
    found = readings(doubts_about_files, scans)
    for brain, reading in zip(config.brains, found, strict=True):
        texts = [*reading.warnings, *_memory_doubts(brain), *reading.values]
        for text in dict.fromkeys(texts):
            yield brain.id, text, False
        if reading.error:
            yield brain.id, reading.error, True


def _memory_doubts(brain: BrainConfig) -> list[str]:
    if brain.labels is None:
        return []
    memory = surface_memory_mib(brain.labels, brain.week)
    available = available_memory_mib()
    if memory <= max(available, MIN_SURFACE_MIB):
        return []
    return [
        f"needs about {_gib(memory)} of memory, {_gib(available)} are here:"
        " resample it to larger voxels"
    ]


def _scans(
    config: Config, problems: Sequence[tuple[str, str, bool]]
) -> Iterator[ScanRow]:
    atlases = atlas_by_brain(used_atlases(config))
    for brain in config.brains:
        is_bad = {bad for name, _, bad in problems if name == brain.id}
        verdict = "refused" if True in is_bad else "warning" if is_bad else "ok"
        default = "configuration"
        if brain.id in atlases:
            default = atlases[brain.id].atlas.name
        source = config.age_sources.get(brain.id) or default
        data = ", ".join(Path(file).name for file in brain.files) or brain.source
        yield ScanRow(
            brain.id, f"{brain.week:g}", source, data, brain.scheme or "–", verdict
        )


def _needs(
    jobs: Sequence[PlannedJob],
    study: Study,
    directory: Path,
    cores: int,
) -> Iterator[tuple[str, bool]]:
    seconds = [job_seconds(study, job.rule, job.wildcards) for job in jobs]
    made_by = {file: number for number, job in enumerate(jobs) for file in job.outputs}

    @cache
    def end_s(number: int) -> float:
        before = (
            end_s(made_by[file]) for file in jobs[number].inputs if file in made_by
        )
        return max(before, default=0.0) + seconds[number] / min(
            jobs[number].threads, cores
        )

    foldings = [job for job in jobs if job.rule in FOLDINGS]
    needs = [
        simulation_needs(
            study.simulations[job.wildcards["run"], job.wildcards["brain"]],
            study.config.mesh,
        )
        for job in foldings
    ]
    yield from ((line, False) for line in _path_lines(jobs, seconds, study, directory))
    hours = sum(seconds) / 3600
    wall_s = max(sum(seconds) / cores, *map(end_s, range(len(jobs))))
    on = f"{cores} core{'s' if cores > 1 else ''} without other load"
    yield (
        (
            f"time    about {format_duration(wall_s)} on {on}, within a factor of"
            f" {ERROR_FACTOR:g}"
        ),
        False,
    )
    share = ""
    if foldings:
        folding_s = sum(each.seconds for each in needs)
        share = f", {folding_s / sum(seconds):.0%} of them for folding"
    yield f"work    about {hours:.2g} core hours{share}", False
    at_once = max(cores // max((job.threads for job in foldings), default=1), 1)
    memory = sum(sorted((each.memory_mib for each in needs), reverse=True)[:at_once])
    disk = sum(each.disk_mib for each in needs) + len(jobs)
    # the memory of this machine does not limit a cluster
    here = cores <= available_cores()
    yield from _fits(
        "memory",
        memory or MIN_SURFACE_MIB / 4,
        available_memory_mib() if here else None,
        "the foldings that run" if foldings else "each step that runs",
    )
    folder = next(
        path
        for path in (directory.absolute(), *directory.absolute().parents)
        if path.is_dir()
    )
    yield from _fits("disk", disk, shutil.disk_usage(folder).free / 2**20)


def _path_lines(
    jobs: Sequence[PlannedJob],
    seconds: Sequence[float],
    study: Study,
    directory: Path,
) -> Iterator[str]:
    """Yield a line on each path of an atlas: whether it is kept or has to be made, and
    where it will be kept."""
    for job, path_s in zip(jobs, seconds, strict=True):
        brain = job.wildcards.get("brain", "")
        used = study.atlases.get(brain)
        name = used.atlas.name if used else brain
        if job.rule == "kept_path":
            yield f"path of {name}: kept from an earlier study"
        elif job.rule == "atlas_path":
            line = f"path of {name}: has to be made, about {format_duration(path_s)}"
            yield f"{line}; {_reuse(used.settings.folder, directory)}" if used else line


def _reuse(folder: str | None, directory: Path) -> str:
    """Return which studies find a path again that is kept in the folder of an atlas'
    files, None for the default."""
    if folder is None or Path(folder).is_relative_to(directory.resolve()):
        return (
            "kept for this study only; with a folder of the atlas outside it (--folder,"
            " atlas.folder), for others too"
        )
    return f"once for all studies with the folder {folder}"


def _fits(
    name: str,
    mib: float,
    there_mib: float | None,
    users: str = "",
) -> Iterator[tuple[str, bool]]:
    bad = there_mib is not None and mib > there_mib
    here = (
        f", for {users} at the same time"
        if there_mib is None
        else f"; {_gib(there_mib)} available"
    )
    yield (
        f"{name:<7} about {_gib(mib)}{here}{', which is too little' if bad else ''}",
        bad,
    )


def _gib(mib: float) -> str:
    return f"{mib / 1024:.1f} GB" if mib >= 100 else f"{mib:.0f} MB"
