"""Check a study before it is run: its configuration, its files, what will run, and what
that will take."""

import math
import shutil
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import chdir, contextmanager
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from textwrap import fill

from ..errors import InputError
from ..grouping import counted, grouped
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
from ..running.manifest import Job
from ..running.planning import BY_ANOTHER_JOB, MISSING, Plan
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
from ..study.atlases import known_checksums, used_atlases
from ..study.brains import label_scheme
from ..study.loading import load
from ..study.resolve import resolve
from ..study.study import Study
from .init import commented_scans
from .inputs import check_other_files, doubts_about_files, input_facts
from .readings import ScanFiles, collected_warnings, readings
from .scans import ScanRow, scan_lines

NAMED_RUNS = 6
GENERAL_REASONS = (MISSING, BY_ANOTHER_JOB)
"""Reasons to run a job that are shown without their files."""
THROUGH_CORTEX = {
    ("pytetwild", 1): 0.95,
    ("pytetwild", 2): 0.39,
    ("tetgen", 1): 0.67,
    ("tetgen", 2): 0.27,
}
"""Elements through a cortex as thick as `mesh.surface_edge_mm`, by mesher and order, as
found on the shipped brains."""


def check_study(
    path: Path,
    directory: Path,
    cores: int,
    stages: Sequence[str] = (),
    *,
    name: Path | None = None,
    age_sources: Mapping[str, str] | None = None,
) -> Iterator[tuple[str, int]]:
    """Yield lines on a study, its files and what would run up to some stages, each with
    its number of problems.

    `name` stands for a temporary configuration; `age_sources` say where its ages come
    from, by brain.
    """
    with _read_study(path, directory) as study, collected_warnings() as logged:
        problems = list(_input_problems(study.config))
        further = list(check_other_files(study))
        facts = list(input_facts(study))
        n_downloads = len(study.downloads)
    yield f"{name or path}: {_contents(study)}", 0
    warnings = []
    refusals = []
    for brain, text, is_refused in problems:
        if is_refused:
            refusals.append((brain, f"  brain {brain}: {text}"))
        else:
            warnings.append((brain, f"  warning: brain {brain}: {text}"))
    texts = {text for _, text, _ in problems}
    for record in logged:
        text = record.getMessage()
        if text not in texts:
            warnings.append(("", f"  warning: {text}"))
    for owner, text in further:
        refusals.append((owner, f"  {owner}: {text}"))
    for line, _ in grouped(warnings):
        yield line, 0
    yield from grouped(refusals)
    for line in facts:
        yield f"  {line}", 0
    for line in (*_coarse_cortices(study), *_deep_curved_folds(study)):
        yield f"  warning: {line}", 0
    for line in _export_problems(study):
        yield f"  warning: no export: {line}", 0
    if n_downloads:
        yield f"  {counted(n_downloads, 'missing atlas file')} will be downloaded", 0
    if not refusals:
        yield "  input files: no problem found", 0
        options = ["--cores", str(cores), *stages]
        yield from work_of(path, directory, cores, options, study)
    for line in commented_scans(path):
        yield f"not used: {line}", 0
    for line in scan_lines(_scans(study, problems, age_sources or {})):
        yield line, 0


@contextmanager
def _read_study(path: Path, directory: Path) -> Iterator[Study]:
    """Read a study in its working directory, since paths of a configuration may be
    relative to that."""
    file = path.absolute()
    folder = directory if directory.is_dir() else Path()
    with chdir(folder):
        keys = read_keys(file)
        config = load(keys, folder_of(file))
        yield resolve(config)


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
    planned = _plan(path, directory, further, show=show)
    if not planned:
        yield "nothing to run: everything is up to date", False
        return
    yield f"to run: {counted(len(planned), 'step')}", False
    rules_by_reason: dict[str, Counter[str]] = defaultdict(Counter)
    for job, reason in planned:
        for words in GENERAL_REASONS:
            reason = words if reason.startswith(words) else reason
        rules_by_reason[reason][job.rule] += 1
    for reason, counts in rules_by_reason.items():
        rules = []
        for rule, count in counts.items():
            rules.append(rule if count == 1 else f"{rule}×{count}")
        text = f"{reason}: {', '.join(rules)}"
        yield fill(text, 100, initial_indent="  ", subsequent_indent="    "), False
    if study is None:
        with _read_study(path, directory) as read:
            study = read
    yield from _needs(
        [job for job, _ in planned],
        study,
        directory,
        cores,
    )


def _plan(
    config: Path,
    directory: Path,
    further: Sequence[str],
    *,
    show: bool = False,
) -> list[tuple[Job, str]]:
    """Return the jobs that Snakemake would run, without targets, each with the reason,
    or exit with its code; `show` lists them, too."""
    plans: list[Plan] = []
    with TemporaryDirectory() as empty:
        place = directory.resolve() if directory.is_dir() else empty
        options = [
            "--configfile",
            str(config.absolute()),
            "--directory",
            str(place),
        ]
        call = [*options, "--dry-run", *further]
        code = launch(call, plans.append, is_shown=show)
    if code:
        sys.exit(code)
    return plans[0].reasoned_jobs


def _contents(study: Study) -> str:
    parts = [counted(len(study.brains), "brain")]
    if study.run_simulations:
        runs = list(study.config.runs)
        names = runs[:NAMED_RUNS]
        if len(runs) > NAMED_RUNS:
            names.append("…")
        simulations = counted(len(study.run_simulations), "simulation")
        parts.append(f"{simulations} ({', '.join(names)})")
    else:
        parts.append("measured only")
    for name, members in study.by_sweep.items():
        parts.append(f"{len(members)} of sweep {name}")
    if study.calibration:
        calibrated = {run for run, _ in study.calibration}
        parts.append(f"{len(calibrated)} of the calibration")
    return ", ".join(parts)


def _coarse_cortices(study: Study) -> Iterator[str]:
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
        thickness_mm = curve_at(thickness, simulation.weeks[0])
        through = THROUGH_CORTEX[mesh.mesher, mesh.order] * thickness_mm
        elements = through / mesh.surface_edge_mm
        error, text = element_error(mesh.order, elements)
        is_coarse = is_too_coarse(mesh.order, elements)
        few = ""
        remedy = "mesh.order: 2"
        if is_coarse:
            edge_mm = math.floor(100 * through / needed) / 100
            few = f", fewer than the {needed:g} needed"
            remedy = f"mesh.surface_edge_mm: {edge_mm:g}"
        if is_coarse or error > LARGE_ELEMENT_ERROR:
            name = f"run {simulation.run} from {simulation.brain}"
            coarse[f"about {text}{few}; use {remedy}"].append(name)
    for text, names in coarse.items():
        yield f"{', '.join(names)}: {text}"


def _deep_curved_folds(study: Study) -> Iterator[str]:
    """Yield a warning for each simulation in which quadratic elements grow towards
    shapes with deep folds, on the way to which they fold over."""
    if study.config.mesh.order == 1:
        return
    for simulation in study.run_simulations:
        if (
            simulation.settings.growth.shapes
            and simulation.settings.end_week > DEEP_FOLDS_GW
        ):
            yield (
                f"run {simulation.run} from {simulation.brain}: quadratic elements"
                f" fold over on the way to shapes later than {DEEP_FOLDS_GW:g} GW; use"
                " mesh.order: 1"
            )


def _export_problems(study: Study) -> Iterator[str]:
    """Yield why a study cannot be exported under the labels that BIDS would give its
    subjects and runs."""
    subjects = [brain.subject_name for brain in study.brains.values()]
    try:
        require_bids_names(subjects, study.config.runs)
    except InputError as error:
        yield str(error)


def _input_problems(config: Config) -> Iterator[tuple[str, str, bool]]:
    """Yield each problem or warning about a brain's input files: the brain's id, the
    text, and if it is a problem.

    Unreadable files and labels of another scheme are problems; an unusual size for the
    week is a warning.
    """
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
    available_mib = available_memory_mib()
    for brain, reading in zip(config.brains, found, strict=True):
        texts = [
            *reading.warnings,
            *_memory_doubts(brain, available_mib),
            *reading.values,
        ]
        for text in dict.fromkeys(texts):
            yield brain.id, text, False
        if reading.error:
            yield brain.id, reading.error, True


def _memory_doubts(brain: BrainConfig, available_mib: float) -> list[str]:
    if brain.labels is None:
        return []
    memory_mib = surface_memory_mib(brain.labels, brain.week)
    if memory_mib <= max(available_mib, MIN_SURFACE_MIB):
        return []
    return [
        f"needs about {_memory_text(memory_mib)} of memory,"
        f" {_memory_text(available_mib)} are here: resample it to larger voxels"
    ]


def _scans(
    study: Study,
    problems: Sequence[tuple[str, str, bool]],
    age_sources: Mapping[str, str],
) -> Iterator[ScanRow]:
    config = study.config
    verdicts = {}
    for brain_id, _, is_refused in problems:
        if is_refused:
            verdicts[brain_id] = "refused"
        else:
            verdicts.setdefault(brain_id, "warning")
    for brain in config.brains:
        source = age_sources.get(brain.id) or config.age_sources.get(brain.id)
        if not source and brain.id in study.atlases:
            source = study.atlases[brain.id].atlas.name
        files = [Path(file).name for file in brain.files]
        yield ScanRow(
            scan=brain.id,
            age=f"{brain.week:g}",
            age_source=source or "configuration",
            data=", ".join(files) or brain.source,
            scheme=brain.scheme or "–",
            verdict=verdicts.get(brain.id, "ok"),
        )


def _needs(
    jobs: Sequence[Job],
    study: Study,
    directory: Path,
    cores: int,
) -> Iterator[tuple[str, bool]]:
    seconds = [
        job_seconds(
            study,
            job.rule,
            job.wildcards,
        )
        for job in jobs
    ]
    made_by: dict[str, int] = {}
    for number, job in enumerate(jobs):
        made_by |= dict.fromkeys(job.outputs, number)

    @cache
    def end_s(number: int) -> float:
        """Return when a job ends whose inputs are made as early as possible."""
        job = jobs[number]
        start_s = 0.0
        for file in job.files:
            if file in made_by:
                start_s = max(start_s, end_s(made_by[file]))
        return start_s + seconds[number] / min(job.threads(), cores)

    foldings = [job for job in jobs if job.rule in FOLDINGS]
    needs = []
    for job in foldings:
        simulation = study.simulations[job.wildcards["run"], job.wildcards["brain"]]
        needs.append(simulation_needs(simulation, study.config.mesh))
    for line in _path_lines(jobs, seconds, study):
        yield line, False
    work_s = sum(seconds)
    longest_s = max(end_s(number) for number in range(len(jobs)))
    duration = format_duration(max(work_s / cores, longest_s))
    on = f"{counted(cores, 'core')} without other load"
    within = f"within a factor of {ERROR_FACTOR:g}"
    yield f"time    about {duration} on {on}, {within}", False
    share = ""
    if foldings:
        folding_s = sum(need.seconds for need in needs)
        share = f", {folding_s / work_s:.0%} of them for folding"
    yield f"work    about {work_s / 3600:.2g} core hours{share}", False
    threads = max((job.threads() for job in foldings), default=1)
    at_once = max(cores // threads, 1)
    largest_first = sorted((need.memory_mib for need in needs), reverse=True)
    memory_mib = sum(largest_first[:at_once]) or MIN_SURFACE_MIB / 4
    # the memory of this machine does not limit a cluster
    is_here = cores <= available_cores()
    available_mib = available_memory_mib() if is_here else None
    yield _fits("memory", memory_mib, available_mib)
    disk_mib = sum(need.disk_mib for need in needs) + len(jobs)
    folder = directory.absolute()
    while not folder.is_dir():
        folder = folder.parent
    yield _fits(
        "disk",
        disk_mib,
        shutil.disk_usage(folder).free / 2**20,
    )


def _path_lines(
    jobs: Sequence[Job],
    seconds: Sequence[float],
    study: Study,
) -> Iterator[str]:
    """Yield a line on each path of an atlas: whether it is kept or has to be made."""
    for job, path_s in zip(jobs, seconds, strict=True):
        brain = job.wildcards.get("brain", "")
        used = study.atlases.get(brain)
        name = used.atlas.name if used else brain
        if job.rule == "kept_path":
            yield f"path of {name}: kept from an earlier study"
        elif job.rule == "atlas_path":
            yield f"path of {name}: has to be made, about {format_duration(path_s)}"


def _fits(
    name: str,
    mib: float,
    available_mib: float | None,
) -> tuple[str, bool]:
    """Return a line on a need, and whether it exceeds what is available; None: that of
    a cluster."""
    line = f"{name:<7} about {_memory_text(mib)}"
    if available_mib is None:
        return f"{line}, for the steps that run at the same time", False
    line += f"; {_memory_text(available_mib)} available"
    if mib > available_mib:
        return f"{line}, which is too little", True
    return line, False


def _memory_text(mib: float) -> str:
    megabytes = mib * 1024**2 / 1e6
    if megabytes < 100:
        return f"{megabytes:.0f} MB"
    return f"{megabytes / 1000:.1f} GB"
