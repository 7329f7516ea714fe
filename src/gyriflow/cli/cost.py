"""What the jobs of a study will take: each rule's measured time and memory, scaled by the size of its brain's mesh."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from math import ceil
from pathlib import Path
from typing import Any

import numpy as np

from ..anatomy.plausible import expected_volume_ml
from ..config.brains import Brain
from ..config.root import Config
from ..config.runs import Run
from ..config.stages import MeshSettings
from ..errors import InputError
from ..io.files import read_json
from ..io.volumes import voxels_of
from ..parameters.terms import ELEMENT_FIELDS
from ..units import ML_PER_MM3, SECONDS_PER_GW

MEASURED = Path(__file__).with_name("measured.json")
"""Written by `benchmarks/cost.py`."""

MIB = 2**20
LEAST_S = 0.5
LEAST_MIB, LEAST_MINUTES = 2000, 60
"""What the job of any folding needs: Python, dolfinx, compiled forms, and processors slower than those measured on."""
LEAST_SURFACE_MIB = 4000
BYTES_IN_FILE, BYTES_IN_BRAIN = 16, 800
"""What the surface of a label volume takes for each voxel of the file, and each voxel of the brain in it."""
FOLDINGS = ("simulate", "simulate_member")
"""Rules that solve a folding; those of studies and calibrations may diverge."""
OF_LABELS = ("pial_from_labels", "cortical_thickness")
OF_NODES = ("tetrahedralise", "carried_mesh", "parameter_maps", "regions")
CHAIN = (
    *("pial_from_labels", "pial_from_hemispheres", "pial_from_surface", "tetrahedralise", "parameters", "regions"),
    *(*FOLDINGS, "folded_surface", "measure", "shape_maps", "study_resources", "html_report"),
)
"""Jobs that wait for each other, whatever the number of cores."""
FACE_AREA = np.sqrt(3) / 4
"""Area of an equilateral triangle, in edges squared."""
AREAS_CM2 = {21: 99.0, 25: 174.0, 29: 234.0, 33: 309.0, 36: 355.0}
"""Pial area by gestational week, of CRL's atlas by this project's own surfaces (Gholipour et al. 2017)."""
VOLUMES_ML = {21: 51.0, 25: 109.0, 29: 160.0, 33: 230.0, 36: 286.0}
"""Volume inside it."""
DEPTHS = 200


@cache
def typical_seconds() -> dict[str, float]:
    """Returns the middle of what jobs of each rule took in the studies that were measured, in seconds of one core."""
    return {row["rule"]: row["typical_s"] for row in read_json(MEASURED)["rules"].values()}


@dataclass(frozen=True)
class Job:
    """A job that is to run: its rule, and the run, brain and number of cores that it is for (None, None, 1)."""

    rule: str
    run: str | None = None
    brain: str | None = None
    threads: int = 1


@dataclass(frozen=True)
class Prediction:
    """What jobs are likely to take: time of one core, of the foldings alone, and on the given cores without other load.

    Memory is that of the largest jobs that may run side by side, disk that of the results. `error` says by what factor
    studies that were left out of the fit took more "time", "memory", "disk" or less, at most: 1.5 is 50 % more, or a
    third less.
    """

    core_seconds: float
    folding_core_seconds: float
    wall_seconds: float
    memory_mib: float
    disk_mib: float
    error: Mapping[str, float]


@dataclass(frozen=True)
class Size:
    """What the jobs of a brain have to do with, as numbers.

    `faces` are those of the surfaces that metrics are measured on; the others are nodes, elements and boundary
    triangles between nodes of the tetrahedral mesh.
    """

    faces: float
    nodes: float
    tets: float
    pial_faces: float


def size_of(brain: Brain, config: Config, nodes_factor: float, tets_per_node: float) -> Size:
    """Returns the sizes to expect of a brain, from its week and the edges that the configuration asks for.

    `nodes_factor` is the number of nodes over the volume in cubes of the wanted edge, `tets_per_node` the number of
    linear elements over that of nodes, both as found in meshes that were made.
    """
    if brain.shape is not None:
        extents = np.array(brain.shape.size_mm, dtype=float)
        extents = extents if len(extents) == 3 else np.full(3, 2 * extents[0])
        volume = extents.prod()
        area = float(2 * (extents[0] * extents[1] + extents[1:].prod() + extents[0] * extents[2]))
    else:
        area = 100 * float(np.interp(brain.week, list(AREAS_CM2), list(AREAS_CM2.values())))
        volume = 1000 * float(np.interp(brain.week, list(VOLUMES_ML), list(VOLUMES_ML.values())))
    mesh = config.mesh
    edge = float(np.sqrt(area / (FACE_AREA * mesh.pial_faces))) if mesh.pial_faces else mesh.surface_edge_mm
    nodes = nodes_factor * cubes(area, float(volume), mesh, edge)
    # as many nodes, an eighth of the elements
    tets = tets_per_node * nodes / (8 if mesh.order == 2 else 1)
    return Size(area / (FACE_AREA * config.surface.edge_length_mm**2), nodes, tets, area / (FACE_AREA * edge**2))


def cubes(area_mm2: float, volume_mm3: float, mesh: MeshSettings, surface_edge_mm: float) -> float:
    """Returns how many cubes of the wanted edge fill a body: ∫ dV / h(depth)³.

    Shells below its surface shrink linearly to nothing, as they do in a body of area A and volume V whose inner
    radius is 3 V / A.
    """
    inner = 3 * volume_mm3 / area_mm2
    depth = (np.arange(DEPTHS) + 0.5) * inner / DEPTHS
    below = np.maximum(depth - mesh.fine_depth_edges * surface_edge_mm, 0.0)
    edge = np.minimum(surface_edge_mm + mesh.edge_growth * below, mesh.core_edge_mm)
    shell = area_mm2 * (1 - depth / inner) ** 2 * inner / DEPTHS
    return float((shell / edge**3).sum())


def work_of(job: Job, size: Size, steps: float) -> float:
    """Returns what a job's time grows with: nodes times steps of a folding, nodes of a mesh, else faces."""
    if job.rule in FOLDINGS:
        return size.nodes * steps
    return size.nodes if job.rule in OF_NODES else size.faces if job.run is None else size.pial_faces


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
    """Returns what jobs of a configuration are likely to take on a number of cores.

    `measured` are coefficients by rule, fitted by `benchmarks/cost.py`; `memory_of_run` is the memory in MiB of a
    folding with a number of elements and of ranks, a kind of contact, and elements of an order.
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
        if job.rule in OF_LABELS and job.brain is not None:
            brain = config.brain(job.brain)
            # of fine voxels, which the measured brains did not have
            need = surface_memory_mib(brain.label_volume or "", brain.week)
            memory = need if need > LEAST_SURFACE_MIB else memory
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
        error=measured["error"],
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
        max(ceil(predicted.memory_mib * predicted.error["memory"]), LEAST_MIB),
        max(ceil(predicted.wall_seconds * predicted.error["time"] / 60), LEAST_MINUTES),
    )


def surface_memory_mib(labels: str, week: float) -> int:
    """Returns the memory in MiB that the surface of a label volume may take, at least `LEAST_SURFACE_MIB`.

    It follows from the file's header and the usual size of a brain at its week. A file that is not there yet, or cannot
    be read, is taken for a usual one.
    """
    try:
        voxels, voxel_mm3 = voxels_of(labels)
    except InputError:
        return LEAST_SURFACE_MIB
    inside = min(voxels, expected_volume_ml(week) / (voxel_mm3 * ML_PER_MM3))
    return max(LEAST_SURFACE_MIB, ceil((BYTES_IN_FILE * voxels + BYTES_IN_BRAIN * inside) / MIB))


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
