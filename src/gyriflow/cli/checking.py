"""Checks a study before it is run: its configuration, its files, what will run, and what that will take."""

import os
import shutil
from collections import defaultdict
from collections.abc import Iterator, Sequence
from pathlib import Path

import psutil

from ..config import load
from ..config.brains import Brain
from ..config.root import Config
from ..cost import MEASURED
from ..cost.prediction import Prediction, predict
from ..errors import GyriflowError
from ..folding.predicted_memory import predicted_memory_mib
from ..io.files import read_json
from ..io.volumes import read_label_volume
from ..io.yaml_files import read_yaml
from ..parameters.schemes import LabelScheme
from ..shipped import SHIPPED
from ..surface.labels import cerebrum_mask, require_cortex_outside
from ..terminal.stages import ORDER
from ..terminal.stages import stages as stages_of_rules
from ..terminal.time_left import as_duration
from .plan import PlannedJob, plan, reasons

DEMO = SHIPPED / "config" / "config.yaml"
MIB_PER_GIB = 1024
NAMED_RUNS = 6


def check_study(
    config: Path | None,
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
    path = config or DEMO
    settings = load(read_yaml(path), path.resolve().parent)
    yield f"{path}: {_contents(settings)}", False
    bad = False
    if read_files:
        for line in input_problems(settings):
            bad = True
            yield f"  {line}", True
        if not bad:
            yield "  input files: all can be read and fit their schemes", False
    missing = sum(len(atlas.missing) for atlas in settings.atlases)
    if missing:
        yield f"  {missing} files of atlases are not there yet and will be downloaded", False
    if not bad:
        yield from _work(_planned(path, directory, stages), settings, directory, cores, price)


def work_of_study(config: Path | None, directory: Path, cores: int, further: Sequence[str]) -> Iterator[str]:
    """Yields lines on what a study will take, without a look at its files; `further` are arguments of Snakemake's."""
    path = config or DEMO
    settings = load(read_yaml(path), path.resolve().parent)
    for line, _ in _work(_planned(path, directory, further), settings, directory, cores, None):
        yield line


def _planned(config: Path, directory: Path, further: Sequence[str]) -> list[PlannedJob]:
    return plan(["--configfile", str(config.resolve()), "--directory", str(directory.resolve()), *further])


def _contents(config: Config) -> str:
    """Returns how many brains and simulations a configuration has, and the names of its runs or of the first ones."""

    def counted(number: int, name: str) -> str:
        return f"{number} {name}{'s' if number > 1 else ''}"

    names = [*list(config.runs)[:NAMED_RUNS], *(["…"] if len(config.runs) > NAMED_RUNS else [])]
    of_studies = [f"{len(members)} of study {name}" for name, members in config.members.items()]
    if config.calibrate is not None:
        of_studies.append(f"{len(config.calibrate.runs)} of the calibration")
    return ", ".join(
        [
            counted(len(config.brains), "brain"),
            f"{counted(len(config.folded), 'simulation')} ({', '.join(names)})",
            *of_studies,
        ]
    )


def input_problems(config: Config) -> Iterator[str]:
    """Yields what is wrong with the input files of the brains: files that cannot be read, labels of another scheme."""
    for brain in config.brains:
        try:
            _check_files(brain, config)
        except GyriflowError as error:
            yield f"brain {brain.id}: {error}"


def _check_files(brain: Brain, config: Config) -> None:
    volume = brain.label_volume
    if volume is not None and Path(volume).is_file():
        labels = read_label_volume(volume, brain.affine_from).labels
        scheme = LabelScheme(**config.scheme(brain))
        cerebrum_mask(labels, scheme)
        # the wall of a hemisphere that is alone may have no cortex
        if scheme.cortex and brain.hemisphere is None:
            require_cortex_outside(labels, scheme)
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
    if not jobs:
        yield "nothing to run: all results are up to date", False
        return
    of_rule = stages_of_rules(SHIPPED / "workflow" / "rules")
    by_stage = defaultdict(list)
    for job in jobs:
        by_stage[of_rule[job.rule]].append(job)
    yield f"to run: {len(jobs)} steps", False
    for stage, planned in sorted(by_stage.items(), key=lambda item: ORDER.index(item[0])):
        yield f"  {stage:<12} {len(planned):4d}  {reasons(planned)}", False
    predicted = predict([job.job for job in jobs], config, read_json(MEASURED), cores, predicted_memory_mib)
    yield from _needs(predicted, directory, cores, price)


def _needs(predicted: Prediction, directory: Path, cores: int, price: float | None) -> Iterator[tuple[str, bool]]:
    def between(value: float, error: float) -> str:
        return f"{as_duration(value / error)} to {as_duration(value * error)}"

    yield (
        f"time    about {as_duration(predicted.wall_seconds)} on {cores} core{'s' if cores > 1 else ''} without other "
        f"load ({between(predicted.wall_seconds, predicted.time_error)}, by the errors of studies left out)",
        False,
    )
    hours, folding = predicted.core_seconds / 3600, predicted.folding_core_seconds / predicted.core_seconds
    yield f"work    about {_range(hours, predicted.time_error)} core hours, {folding:.0%} of them folding", False
    if price is not None:
        yield f"cost    about {_range(hours * price, predicted.time_error)} at {price:g} a core hour", False
    memory = f"about {_gib(predicted.memory_mib)}, at most {_gib(predicted.memory_mib * predicted.memory_error)}"
    if cores > (os.cpu_count() or 1):
        # the plan of another machine, or of a cluster
        yield f"memory  {memory}, of the largest jobs that run side by side", False
    else:
        available = psutil.virtual_memory().available / 2**20
        too_much = predicted.memory_mib > available
        advice = ": too little; use fewer cores, or larger edges" if too_much else ""
        yield f"memory  {memory}; {_gib(available)} are free{advice}", too_much
    free = shutil.disk_usage(_there(directory)).free / 2**20
    full = predicted.disk_mib > free
    yield (
        f"disk    about {_gib(predicted.disk_mib)}, at most {_gib(predicted.disk_mib * predicted.disk_error)}; "
        f"{_gib(free)} are free" + (": too little" if full else ""),
        full,
    )


def _range(value: float, error: float) -> str:
    return f"{value:.2g} ({value / error:.2g} to {value * error:.2g})"


def _gib(mib: float) -> str:
    return f"{mib / MIB_PER_GIB:.1f} GB" if mib >= 100 else f"{mib:.0f} MB"


def _there(folder: Path) -> Path:
    """Returns the folder, or the first one around it that exists."""
    return next(path for path in (folder.absolute(), *folder.absolute().parents) if path.is_dir())
