"""Checks a study before it is run: its configuration, its files, what will run, and what that will take."""

import math
import os
import shutil
import sys
import tempfile
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, chdir, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path

import numpy as np
import psutil

from ..anatomy.labels import LEAST_CORTEX_OUTSIDE, read_cerebrum
from ..anatomy.plausible import require_plausible_size
from ..config import load
from ..config.brains import Brain
from ..config.root import Config
from ..errors import GyriflowError
from ..folding.predicted_memory import predicted_memory_mib
from ..io.downloads import require_checksums
from ..io.files import read_json
from ..io.volumes import read_label_volume
from ..io.yaml_files import read_keys
from ..parameters.schemes import LabelScheme
from ..parameters.terms import ELEMENTS_NEEDED
from ..parameters.varying import Varying, curve_at
from ..shipped import SHIPPED
from .cost import LEAST_SURFACE_MIB, MEASURED, Job, Prediction, predict, surface_memory_mib
from .launch import OF_PROFILES
from .launch import main as launch
from .terminal import DRAWN, NO_RESULTS, ORDER, as_duration, where_of
from .terminal import stages as stages_of_rules

NAMED_RUNS = 6
THROUGH_CORTEX = {("pytetwild", 1): 0.95, ("pytetwild", 2): 0.39, ("tetgen", 1): 0.67, ("tetgen", 2): 0.27}
"""Elements through a cortex as thick as `mesh.surface_edge_mm`, by mesher and order, as found on the shipped brains."""
REASONS = {
    "input with the content": "other content",
    "Params have changed": "settings changed",
    "Code has changed": "code changed",
    "Updated input files": "newer input",
    "Set of input files has changed": "other inputs",
    "Software environment definition has changed": "environment changed",
    "Missing output files": "not made yet",
    "Input files updated by another job": "follows another step",
    "Forced execution": "asked for",
    "Incomplete": "left incomplete",
}
"""How Snakemake's reasons begin or what they contain, and what they are called here; the first that fits counts."""


@dataclass(frozen=True)
class PlannedJob:
    """A job of a dry run: rule, wildcards, cores, outputs, and Snakemake's reason to run it."""

    rule: str
    wildcards: dict[str, str]
    threads: int
    output: list[str]
    reason: str

    @property
    def why(self) -> str:
        """The reason in few words."""
        return next((words for found, words in REASONS.items() if found in self.reason), self.reason)

    @property
    def job(self) -> Job:
        """What the cost of the job depends on."""
        of = where_of(self.wildcards)
        return Job(self.rule, of.get("run"), of.get("brain"), self.threads)


def check_study(
    path: Path,
    directory: Path,
    cores: int,
    read_files: bool = True,
    stages: Sequence[str] = (),
    price: float | None = None,
) -> Iterator[tuple[str, bool]]:
    """Yields lines on a study up to some stages, each with whether it is a problem.

    With a price of a core hour they say what the study costs, too.

    InputError for a configuration that is not valid, with all its problems.
    """
    settings = load(read_keys(path), path.resolve().parent)
    yield f"{path}: {_contents(settings)}", False
    said = list(input_problems(settings)) if read_files else []
    yield from ((f"  {line}", bad) for line, bad in said)
    yield from ((f"  warning: {line}", False) for line in coarse_cortices(settings))
    bad = any(bad for _, bad in said)
    if read_files and not bad:
        yield "  input files: all can be read and fit their schemes", False
    missing = sum(len(atlas.missing) for atlas in settings.atlases)
    if missing:
        yield f"  {missing} files of atlases are not there yet and will be downloaded", False
    if not bad:
        yield from _work(plan(path, directory, ["--cores", str(cores), *stages]), settings, directory, cores, price)


def work_of_study(
    path: Path, directory: Path, cores: int, further: Sequence[str], *, show: bool = False
) -> Iterator[str]:
    """Yields lines on what would run and what it takes; `further` are arguments of Snakemake's.

    With `show`, Snakemake lists every job on the terminal first.
    """
    jobs = plan(path, directory, further, show=show)
    for line, _ in _work(jobs, load(read_keys(path), path.resolve().parent), directory, cores, None):
        yield line


def plan(config: Path, directory: Path, further: Sequence[str], *, show: bool = False) -> list[PlannedJob]:
    """Returns the jobs that Snakemake would run, with its targets, which have no outputs.

    With `show` it lists them on the terminal. Ends the program as Snakemake does where it refuses.
    """
    said = StringIO()
    with tempfile.TemporaryDirectory(prefix="gyriflow-") as folder, ExitStack() as stack:
        file = Path(folder, "plan.json")
        # Snakemake makes folders even where it only looks
        state = directory.resolve() / ".snakemake"
        made = [path for path in (*reversed(state.parents), state) if not path.exists()]
        stack.callback(lambda: [shutil.rmtree(path) for path in made[:1] if path.exists()])
        # Snakemake goes into the working directory
        stack.enter_context(chdir(Path.cwd()))
        if not show:
            stack.enter_context(redirect_stdout(said))
            stack.enter_context(redirect_stderr(said))
        arguments = ["--logger", "gyriflow", "--logger-gyriflow-plan", str(file), "--configfile", str(config.resolve())]
        code = launch([*arguments, "--directory", str(directory.resolve()), "--dry-run", *further])
        jobs = [] if code else read_json(file)
    if code:
        sys.stderr.writelines(
            line for line in said.getvalue().splitlines(True) if not line.endswith(OF_PROFILES + "\n")
        )
        sys.exit(code)
    return [PlannedJob(**job) for job in jobs]


def _contents(config: Config) -> str:
    """Returns how many brains and simulations a configuration has, and the names of its runs or of the first ones."""
    names = [*list(config.runs)[:NAMED_RUNS], *(["…"] if len(config.runs) > NAMED_RUNS else [])]
    brains, folded = len(config.brains), len(config.folded)
    parts = [f"{brains} brain{'s' if brains > 1 else ''}"]
    parts += [f"{folded} simulation{'s' if folded > 1 else ''} ({', '.join(names)})"]
    parts += [f"{len(members)} of study {name}" for name, members in config.members.items()]
    if config.calibrate is not None:
        parts.append(f"{len(config.calibrate.runs)} of the calibration")
    return ", ".join(parts)


def coarse_cortices(config: Config) -> Iterator[str]:
    """Yields for each run, before anything is solved, whether its mesh is too coarse for its cortex at the start."""
    mesh = config.mesh
    needed = ELEMENTS_NEEDED[mesh.order]
    for run, brain in config.folded:
        thickness = config.run(run).thickness_mm
        # maps and measured thicknesses are known once the surface is made
        if mesh.pial_faces or isinstance(thickness, str) or (isinstance(thickness, Varying) and thickness.map):
            continue
        through = THROUGH_CORTEX[mesh.mesher, mesh.order] * curve_at(thickness, config.brain(brain).week)
        if through / mesh.surface_edge_mm < 0.99 * needed:
            yield (
                f"run {run} from {brain}: about {through / mesh.surface_edge_mm:.1f} elements through the cortex, "
                f"{needed:g} are needed: mesh.surface_edge_mm: {math.floor(100 * through / needed) / 100:g} would do"
            )


def input_problems(config: Config) -> Iterator[tuple[str, bool]]:
    """Yields what is wrong or doubtful about the input files of the brains, and whether it is wrong.

    Wrong are files that cannot be read and labels of another scheme, doubtful is a size that is not that of the week.
    """
    for brain in config.brains:
        try:
            for doubt in _check_files(brain, config):
                yield f"warning: brain {brain.id}: {doubt}", False
        except GyriflowError as error:
            yield f"brain {brain.id}: {error}", True


def _check_files(brain: Brain, config: Config) -> Iterator[str]:
    files = [path for path in (*brain.files, brain.image) if path in config.known_files and Path(path).is_file()]
    require_checksums({path: config.known_files[path] for path in files})
    volume = brain.label_volume
    if volume is not None and Path(volume).is_file():
        need, there = surface_memory_mib(volume, brain.week), psutil.virtual_memory().total / 2**20
        if need > max(there, LEAST_SURFACE_MIB):
            yield f"its voxels need about {_gib(need)} of memory, {_gib(there)} are here: give it larger voxels"
        read = read_label_volume(volume, brain.affine_from, cropped=True)
        labels, scheme = read.labels, LabelScheme(**config.scheme(brain))
        # the wall of a hemisphere that is alone may have no cortex
        found = read_cerebrum(labels, read.affine, scheme, LEAST_CORTEX_OUTSIDE if brain.hemisphere is None else 0.0)
        yield from found.warnings
        if brain.hemisphere is None:
            cerebrum = np.isin(found.tissue, scheme.cerebrum)
            size = cerebrum.sum() * abs(np.linalg.det(read.affine[:3, :3]))
            extents = np.ptp(np.argwhere(cerebrum), axis=0) * np.linalg.norm(read.affine[:3, :3], axis=0)
            yield from require_plausible_size(float(size), extents, brain.week)
    for file in brain.files:
        # files of atlases may be missing yet
        if file != volume and Path(file).is_file():
            # takes half a second, which label volumes need not wait for
            from ..io.surfaces import read_one_hemisphere, read_surface

            if brain.hemisphere is None:
                read_surface(file)
            else:
                read_one_hemisphere(file, brain.hemisphere.side)


def _work(
    jobs: Sequence[PlannedJob], config: Config, directory: Path, cores: int, price: float | None
) -> Iterator[tuple[str, bool]]:
    """Yields what will run, by stage, and what it will take of time, memory and disk."""
    making = [job for job in jobs if job.output]
    if not making:
        yield f"nothing to run: {NO_RESULTS if jobs else 'all results are up to date'}", False
        return
    of_rule = stages_of_rules(SHIPPED / "workflow" / "rules")
    by_stage = defaultdict(list)
    for job in making:
        by_stage[of_rule.get(job.rule, DRAWN)].append(job)
    yield f"to run: {len(making)} step{'s' if len(making) > 1 else ''}", False
    for stage, planned in sorted(by_stage.items(), key=lambda item: ORDER.index(item[0])):
        several = Counter(job.why for job in planned).most_common()
        reasons = ", ".join(f"{count} {why}" if len(several) > 1 else why for why, count in several)
        yield f"  {stage:<12} {len(planned):4d}  {reasons}", False
    predicted = predict([job.job for job in making], config, read_json(MEASURED), cores, predicted_memory_mib)
    yield from _needs(predicted, directory, cores, price)


def _needs(predicted: Prediction, directory: Path, cores: int, price: float | None) -> Iterator[tuple[str, bool]]:
    error = predicted.error
    factors = (1 / error["time"], 1, error["time"])
    least, usual, most = (as_duration(predicted.wall_seconds * factor) for factor in factors)
    on = f"{cores} core{'s' if cores > 1 else ''} without other load"
    yield f"time    about {usual} on {on} ({least} to {most} in trials on other studies)", False
    hours, folding = predicted.core_seconds / 3600, predicted.folding_core_seconds / predicted.core_seconds
    yield f"work    about {_range(hours, error['time'])} core hours, {folding:.0%} of them folding", False
    if price is not None:
        yield f"cost    about {_range(hours * price, error['time'])} at {price:g} a core hour", False
    # of the folder, or of the first one around it that exists
    there = next(path for path in (directory.absolute(), *directory.absolute().parents) if path.is_dir())
    # none for the plan of another machine, or of a cluster
    memory = None if cores > (os.cpu_count() or 1) else psutil.virtual_memory().available / 2**20
    for name, mib, free, advice in (
        ("memory", predicted.memory_mib, memory, ": too little; use fewer cores, or larger edges"),
        ("disk", predicted.disk_mib, shutil.disk_usage(there).free / 2**20, ": too little"),
    ):
        line = f"{name:<7} about {_gib(mib)}, at most {_gib(mib * error[name])}"
        if free is None:
            yield f"{line}, of the largest jobs that run side by side", False
        else:
            yield f"{line}; {_gib(free)} are free{advice if mib > free else ''}", mib > free


def _range(value: float, error: float) -> str:
    return f"{value:.2g} ({value / error:.2g} to {value * error:.2g})"


def _gib(mib: float) -> str:
    return f"{mib / 1024:.1f} GB" if mib >= 100 else f"{mib:.0f} MB"
