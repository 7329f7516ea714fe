"""Predict time, memory and disk space of simulations, within a factor of two."""

from bisect import bisect_left
from collections.abc import Mapping, Sequence
from math import ceil, prod
from typing import NamedTuple

from ..anatomy.plausible import expected_volume_ml
from ..errors import InputError
from ..folding.predicted_memory import predicted_memory_mib
from ..io.volumes import read_header
from ..settings.stages import MeshSettings
from ..study.paths import TARGETS
from ..study.records import Brain, Simulation
from ..study.study import Study
from ..units import ML_PER_MM3, SECONDS_PER_GW

FOLDINGS = ("simulate", "simulate_member")
"""Rules that fold."""
ELEMENTS_PER_CUBE = {"tetgen": 2.2, "pytetwild": 7.4}
"""Linear elements per cube of the requested edge length, fitted to meshes of 31 k to 464 k elements."""
SECONDS_PER_ELEMENT_AND_STEP = {1: 12e-6, 2: 48e-6}
"""By element order; fitted to runs of 156 k and 500 k linear elements and 28 to 126 steps, within a factor of 1.3. A
quadratic element counts as the eight linear elements with the same nodes."""
SHAPES_SECONDS_PER_ELEMENT_AND_STEP = 6e-6
"""With linear elements that grow towards shapes."""
SERIES_SECONDS_PER_ELEMENT_AND_WEEK = 9e-5
"""For a mesh to follow the brains of its own series: targets, or an atlas' path."""
PREDICTION_SECONDS, PREDICTION_SECONDS_PER_ELEMENT_AND_WEEK = 10.0, 4e-5
"""To place a mesh in an atlas, and to follow the shapes that are predicted for it."""
SECONDS_PER_JOB = 5.0
"""Mean duration of the other jobs, in the demo."""
ERROR_FACTOR = 2.0
"""Factor by which predictions may be wrong."""
MIN_MIB, MIN_MINUTES, MIN_SURFACE_MIB = 2000, 60, 4000
"""Resources that any job needs: Python, dolfinx, compiled forms, slow processors."""


class Needs(NamedTuple):
    """Predicted cost of a simulation: time on one core, memory of all ranks, disk space."""

    seconds: float
    memory_mib: float
    disk_mib: float


def linear_elements(week: float, mesh: MeshSettings) -> float:
    """Predict the number of linear elements of a brain of a week, from its surface area and volume."""
    volume_ml, edge = expected_volume_ml(week), mesh.surface_edge_mm
    area_mm2, graded = 9900 * (volume_ml / 51) ** 0.74, 1 / edge**2 - 1 / mesh.core_edge_mm**2
    cubes = area_mm2 * (2.5 / edge**2 + max(graded, 0)) + volume_ml / ML_PER_MM3 / mesh.core_edge_mm**3
    return ELEMENTS_PER_CUBE[mesh.mesher] * cubes


def simulation_needs(simulation: Simulation, mesh: MeshSettings) -> Needs:
    """Predict the cost of a simulation."""
    run, week = simulation.settings, simulation.start.week
    elements = linear_elements(week, mesh)
    steps = max((run.end_week - week) * SECONDS_PER_GW / run.step_s, 1.0)
    memory = predicted_memory_mib(
        round(elements / (8 if mesh.order == 2 else 1)), run.ranks, run.contact.kind, mesh.order
    )
    # positions and fields of each output week, by a quarter as many nodes
    disk = ((run.end_week - week) / run.output_every_gw + 1) * elements / 4 * (24 + 12 * len(run.fields)) / 2**20
    follows_shapes = simulation.shapes and mesh.order == 1
    rate = SHAPES_SECONDS_PER_ELEMENT_AND_STEP if follows_shapes else SECONDS_PER_ELEMENT_AND_STEP[mesh.order]
    return Needs(rate * elements * steps, memory, disk)


def job_seconds(study: Study, rule: str, wildcards: Mapping[str, str]) -> float:
    """Predict the time of a job on one core."""
    mesh, brain = study.config.mesh, wildcards.get("brain", "")
    if rule in FOLDINGS:
        return simulation_needs(study.simulations[wildcards["run"], brain], mesh).seconds
    if rule == "atlas_path":
        paths = (chain.path for chain in study.chains.values() if chain.path)
        path_weeks = next(path.weeks for path in paths if path.brains[0].id == brain)
        return _series_seconds(path_weeks, study.config.growth.path_mesh)
    if rule not in ("targets", "predicted_targets"):
        return SECONDS_PER_JOB
    chain, file = study.chains[brain, wildcards["origin"]], TARGETS.format(**wildcards)
    if chain.path is None:
        return _series_seconds(chain.weeks, mesh)
    end = max(simulation.weeks[-1] for simulation in study.simulations.values() if simulation.targets == file)
    start, later = chain.weeks[0], [week for week in chain.path.weeks if week > chain.weeks[0]]
    # it ends two weeks of the atlas after the end
    weeks = max(later[: bisect_left(later, end) + 2], default=start) - start
    return PREDICTION_SECONDS + PREDICTION_SECONDS_PER_ELEMENT_AND_WEEK * linear_elements(start, mesh) * weeks


def _series_seconds(weeks: Sequence[float], mesh: MeshSettings) -> float:
    return SERIES_SECONDS_PER_ELEMENT_AND_WEEK * linear_elements(weeks[0], mesh) * (weeks[-1] - weeks[0])


def job_limits(simulation: Simulation, mesh: MeshSettings) -> tuple[int, int]:
    """Return the limits of a simulation's job on a cluster: memory in MiB, and minutes."""
    needs = simulation_needs(simulation, mesh)
    minutes = ERROR_FACTOR * needs.seconds / simulation.settings.ranks / 60
    return max(ceil(ERROR_FACTOR * needs.memory_mib), MIN_MIB), max(ceil(minutes), MIN_MINUTES)


def targets_memory_mib(start: Brain, mesh: MeshSettings) -> int:
    """Return the memory limit in MiB for the targets of a start brain, whose linear elements are fitted on one rank."""
    needed = predicted_memory_mib(round(linear_elements(start.week, mesh)), 1, "global", 1)
    return max(MIN_SURFACE_MIB, ceil(ERROR_FACTOR * needed))


def surface_memory_mib(labels: str, week: float) -> int:
    """Return the memory limit in MiB for extracting a surface: 16 bytes a voxel, and 800 a voxel of the brain.

    A file that does not exist yet is assumed to be of usual size.
    """
    try:
        header = read_header(labels)
    except InputError:
        return MIN_SURFACE_MIB
    voxels, voxel_mm3 = prod(header.shape), prod(header.voxel_mm)
    inside = min(voxels, expected_volume_ml(week) / (voxel_mm3 * ML_PER_MM3))
    return max(MIN_SURFACE_MIB, ceil((16 * voxels + 800 * inside) / 2**20))
