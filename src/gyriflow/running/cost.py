"""What foldings take, within a factor of two: time by a power law in elements and steps, memory by elements."""

from math import ceil
from typing import NamedTuple

from ..anatomy.plausible import expected_volume_ml
from ..errors import InputError
from ..folding.predicted_memory import predicted_memory_mib
from ..io.volumes import voxels_of
from ..settings.stages import MeshSettings
from ..study.records import Simulation
from ..units import ML_PER_MM3, SECONDS_PER_GW

ELEMENTS_PER_CUBE = {"tetgen": 2.2, "pytetwild": 7.4}
"""Linear elements in a cube of the wanted edge, from meshes of 31 k to 464 k."""
SECONDS_PER_ELEMENT_AND_STEP = {1: 12e-6, 2: 48e-6}
"""By order; from foldings of 156 k and 500 k linear elements over 28 to 126 steps, met within a factor of 1.3. A
quadratic element counts as the eight linear ones that have as many nodes."""
SECONDS_PER_JOB, ERROR = 5.0, 2.0
"""What other jobs take, from the demo; the factor by which predictions may be wrong."""
LEAST_MIB, LEAST_MINUTES, LEAST_SURFACE_MIB = 2000, 60, 4000
"""What any job needs: Python, dolfinx, compiled forms, slow processors."""


class Needs(NamedTuple):
    """What a folding takes on one core, with the memory of all its ranks."""

    seconds: float
    memory_mib: float
    disk_mib: float


def linear_elements(week: float, mesh: MeshSettings) -> float:
    """Return how many linear elements a brain of a week has: cubes of the wanted edge below its surface and inside."""
    volume_ml, edge = expected_volume_ml(week), mesh.surface_edge_mm
    area_mm2, graded = 9900 * (volume_ml / 51) ** 0.74, 1 / edge**2 - 1 / mesh.core_edge_mm**2
    cubes = area_mm2 * (2.5 / edge**2 + max(graded, 0)) + volume_ml / ML_PER_MM3 / mesh.core_edge_mm**3
    return ELEMENTS_PER_CUBE[mesh.mesher] * cubes


def folding_needs(simulation: Simulation, mesh: MeshSettings) -> Needs:
    """Return what a folding takes."""
    run, week = simulation.settings, simulation.start.week
    elements = linear_elements(week, mesh)
    steps = max((run.end_week - week) * SECONDS_PER_GW / run.step_s, 1.0)
    memory = predicted_memory_mib(
        round(elements / (8 if mesh.order == 2 else 1)), run.ranks, run.contact.kind, mesh.order
    )
    # positions and fields of each output week, by a quarter as many nodes
    disk = ((run.end_week - week) / run.output_every_gw + 1) * elements / 4 * (24 + 12 * len(run.fields)) / 2**20
    return Needs(SECONDS_PER_ELEMENT_AND_STEP[mesh.order] * elements * steps, memory, disk)


def job_limits(simulation: Simulation, mesh: MeshSettings) -> tuple[int, int]:
    """Return the memory in MiB and the minutes that the job of a folding may take on a cluster."""
    needs = folding_needs(simulation, mesh)
    minutes = ERROR * needs.seconds / simulation.settings.ranks / 60
    return max(ceil(ERROR * needs.memory_mib), LEAST_MIB), max(ceil(minutes), LEAST_MINUTES)


def surface_memory_mib(labels: str, week: float) -> int:
    """Return the memory in MiB that the surface of a label volume may take: 16 bytes a voxel, and 800 one of the brain.

    A file that is not there yet is a usual one.
    """
    try:
        voxels, voxel_mm3 = voxels_of(labels)
    except InputError:
        return LEAST_SURFACE_MIB
    inside = min(voxels, expected_volume_ml(week) / (voxel_mm3 * ML_PER_MM3))
    return max(LEAST_SURFACE_MIB, ceil((16 * voxels + 800 * inside) / 2**20))
