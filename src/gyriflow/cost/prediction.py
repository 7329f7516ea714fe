"""What the jobs of a study will take: each rule's measured time and memory, scaled by the size of its brain."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from math import ceil
from typing import Any

from ..config.root import Config
from ..config.runs import Run
from ..parameters.terms import ELEMENT_FIELDS
from ..units import SECONDS_PER_GW
from .sizes import Size, size_of

MIB = 2**20
LEAST_S = 0.5
LEAST_MIB, LEAST_MINUTES = 2000, 60
"""What the job of any folding needs: Python, dolfinx, compiled forms, and processors slower than those measured on."""


@dataclass(frozen=True)
class Job:
    """A job that is to run: its rule, and the run, brain and number of cores that it is for (None, None, 1)."""

    rule: str
    run: str | None = None
    brain: str | None = None
    threads: int = 1


@dataclass(frozen=True)
class Prediction:
    """What jobs are likely to take.

    Attributes
    ----------
    core_seconds
        Time of one core, over all jobs.
    folding_core_seconds
        That of the foldings alone.
    wall_seconds
        Time on the given number of cores without other load.
    memory_mib
        Of the largest jobs that may run side by side.
    disk_mib
        Of the results.
    time_error, memory_error, disk_error
        By what factor studies that were left out of the fit took more or less, at most: 1.5 is 50 % more, or a third
        less.
    """

    core_seconds: float
    folding_core_seconds: float
    wall_seconds: float
    memory_mib: float
    disk_mib: float
    time_error: float
    memory_error: float
    disk_error: float


def simulation_work(nodes: float, steps: float) -> float:
    """Returns the work of a folding, in nodes times steps."""
    return nodes * steps


def work_of(job: Job, size: Size, steps: float) -> float:
    """Returns what a job's time grows with: nodes times steps of a folding, nodes of a mesh, else faces."""
    if job.rule in FOLDINGS:
        return simulation_work(size.nodes, steps)
    return size.nodes if job.rule in OF_NODES else size.faces if job.run is None else size.pial_faces


FOLDINGS = ("simulate", "simulate_member")
"""Rules that solve a folding; those of studies and calibrations may diverge."""
OF_NODES = ("tetrahedralise", "carried_mesh", "parameter_maps", "regions")


def rule_key(rule: str, config: Config) -> str:
    """Returns the name under which a rule was measured; meshers and orders of elements are told apart."""
    if rule == "tetrahedralise":
        return f"tetrahedralise {config.mesh.mesher}"
    return f"simulate order {config.mesh.order}" if rule in FOLDINGS else rule


def predict(
    jobs: Iterable[Job],
    config: Config,
    measured: Mapping[str, Any],
    cores: int,
    memory_of_run: Callable[[int, int, str, int], float] | None = None,
) -> Prediction:
    """Returns what jobs of a configuration are likely to take.

    Parameters
    ----------
    jobs
        The jobs that are to run.
    config
        Their configuration.
    measured
        Coefficients by rule, fitted by `benchmarks/cost.py`.
    cores
        How many cores they may use at once.
    memory_of_run
        Memory in MiB of a folding with a number of elements and of ranks, a kind of contact, and elements of an order.
    """
    mesh, rules = measured["mesh"], measured["rules"]
    factors = mesh["nodes_factor"]
    factor = factors.get(config.mesh.mesher, max(factors.values()))
    sizes = {brain.id: size_of(brain, config, factor, mesh["tets_per_node"]) for brain in config.brains}
    usual = sizes[next(iter((*config.start_brains, *sizes)))]
    seconds: list[float] = []
    spans: dict[str, float] = {}
    memories: list[tuple[float, int]] = []
    disk = folding = 0.0
    for job in jobs:
        size = sizes.get(job.brain or "", usual)
        row = rules.get(rule_key(job.rule, config)) or rules.get(job.rule) or measured["other"]
        steps = _steps(config, job)
        time = max(row["s"] + row["s_per_work"] * work_of(job, size, steps), LEAST_S)
        memory = row["MiB"] + row["MiB_per_work"] * work_of(job, size, 1.0)
        if job.rule in FOLDINGS and memory_of_run is not None and job.run is not None:
            run = run_of(job.run, config)
            memory = memory_of_run(round(size.tets), run.ranks, run.contact.kind, config.mesh.order)
        seconds.append(time)
        folding += time if job.rule in FOLDINGS else 0.0
        # what each stage takes at least, one after the other
        alone = time / min(job.threads, cores)
        spans[job.rule] = max(spans.get(job.rule, 0.0), alone)
        memories.append((memory, min(job.threads, cores)))
        disk += _disk_mib(job, size, config, measured["disk"])
    longest = sum(spans.get(rule, 0.0) for rule in CHAIN)
    return Prediction(
        core_seconds=sum(seconds),
        folding_core_seconds=folding,
        wall_seconds=max(sum(seconds) / cores, longest),
        memory_mib=_side_by_side(memories, cores),
        disk_mib=disk,
        time_error=measured["error"]["time"],
        memory_error=measured["error"]["memory"],
        disk_error=measured["error"]["disk"],
    )


def folding_needs(
    run: str,
    brain: str,
    config: Config,
    measured: Mapping[str, Any],
    memory_of_run: Callable[[int, int, str, int], float],
) -> tuple[int, int]:
    """Returns the memory in MiB and the minutes that a folding may take, for the limits of its job on a cluster.

    Both are the prediction times its error, with a least value for what jobs need whatever their brain is.
    """
    ranks = run_of(run, config).ranks
    predicted = predict([Job("simulate", run, brain, ranks)], config, measured, ranks, memory_of_run)
    return (
        max(ceil(predicted.memory_mib * predicted.memory_error), LEAST_MIB),
        max(ceil(predicted.wall_seconds * predicted.time_error / 60), LEAST_MINUTES),
    )


CHAIN = (
    *("pial_from_labels", "pial_from_hemispheres", "pial_from_surface", "tetrahedralise", "parameters", "regions"),
    *(*FOLDINGS, "folded_surface", "measure", "shape_maps", "study_resources", "html_report"),
)
"""Jobs that wait for each other, whatever the number of cores."""


def run_of(name: str, config: Config) -> Run:
    """Returns the settings of a run; one of a calibration is its base up to the week of comparison."""
    calibrate = config.calibrate
    if calibrate is not None and name in calibrate.runs:
        return config.run(calibrate.base).model_copy(update={"end_week": calibrate.compare_week})
    return config.run(name)


def _steps(config: Config, job: Job) -> float:
    if job.run is None or job.brain is None:
        return 1.0
    run = run_of(job.run, config)
    return max((run.end_week - config.brain(job.brain).week) * SECONDS_PER_GW / run.step_s, 1.0)


def _disk_mib(job: Job, size: Size, config: Config, disk: Mapping[str, float]) -> float:
    """Returns what a job leaves on the disk: a folding its frames as they are laid out, other jobs as measured."""
    if job.rule in FOLDINGS and job.run is not None and job.brain is not None:
        fields = run_of(job.run, config).fields
        of_elements = len(set(ELEMENT_FIELDS) & set(fields))
        # positions in double precision, fields in single
        frame = size.nodes * (24 + 12 * (len(fields) - of_elements)) + 16 * of_elements * size.tets
        calibrated = config.calibrate is not None and job.run in config.calibrate.runs
        weeks = 2 if calibrated else len(config.weeks(job.run, job.brain))
        return weeks * frame / MIB
    if job.rule in ("folded_surface", "measure") or job.rule.startswith("pial_from"):
        return disk["MiB_per_face"] * (size.faces if job.run is None else size.pial_faces)
    if job.rule == "tetrahedralise":
        return disk["MiB_per_node"] * size.nodes
    return disk["MiB_per_job"]


def _side_by_side(memories: list[tuple[float, int]], cores: int) -> float:
    """Returns the memory of the largest jobs that together use the cores."""
    free, total = cores, 0.0
    for memory, threads in sorted(memories, reverse=True):
        if threads <= free:
            free -= threads
            total += memory
    return total
