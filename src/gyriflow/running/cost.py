"""Predict the processor time of jobs, and memory and disk space of simulations, within
a factor of two."""

from bisect import bisect_left
from collections.abc import Mapping, Sequence
from math import ceil, prod
from typing import NamedTuple

from ..anatomy.plausible import expected_volume_ml
from ..errors import InputError
from ..folding.predicted_memory import predicted_memory_mib
from ..io.volumes import read_header
from ..settings.stages import MeshSettings
from ..settings.terms import SIDES
from ..study.paths import TARGETS
from ..study.records import Brain, Simulation
from ..study.study import Study
from ..units import ML_PER_MM3, SECONDS_PER_GW

FOLDINGS = ("simulate", "simulate_member")
"""Rules that fold."""
ELEMENTS_PER_CUBE = {"tetgen": 2.2, "pytetwild": 7.4}
"""Linear elements per cube of the requested edge length, fitted to meshes of 31 k to
464 k elements."""
SECONDS_PER_ELEMENT_AND_STEP = {1: 4.3e-6, 2: 14e-6}
"""By element order; fitted to runs of 130 k to 500 k linear and 27 k to 45 k quadratic
elements and 28 to 126 steps, within a factor of 1.6. A quadratic element counts as the
eight linear elements with the same nodes."""
SHAPES_SECONDS_PER_ELEMENT_AND_STEP = {1: 8e-6, 2: 18e-6}
"""Likewise for growth towards shapes; linear elements fitted to runs of 130 k (7e-6)
and 497 k elements (6e-6) to 30 GW, where fewer folds touch than at 36 GW; quadratic
ones a guess."""
SERIES_SECONDS_PER_ELEMENT_AND_WEEK = 7e-5
"""For a mesh to follow the brains of its series: targets, or an atlas' path; by 130 k
elements to 29 GW and 497 k to 30 GW."""
DEEP_FOLDS_GW, DEEP_FOLDS_FACTOR = 32.0, 12.0
"""Week from which opened sulci are so deep that to follow a brain for a week takes so
many times as long."""
FUSED_SHARE = {"pial": 0.53, "series": 0.5, "prediction": 0.2}
"""What surfaces, and bodies that follow them or predicted shapes, take with
`open_sulci: false`, over that with opened sulci."""
PREDICTION_SECONDS, PREDICTION_SECONDS_PER_ELEMENT_AND_WEEK = 10.0, 1.2e-4
"""To place a mesh in an atlas, and to follow the shapes that are predicted for it."""
MESHING_SECONDS_PER_ELEMENT = {"pytetwild": 2.4e-4, "tetgen": 5.4e-5}
"""By mesher; of elements of the mesh, linear or quadratic."""
SECONDS_PER_ML = {"register": 0.088, "pial": 0.105}
"""By stage, for each mL of the (later) brain, whose labels are registered or surfaced
voxel by voxel; 22 to 38 GW."""
SECONDS_PER_VERTEX, SECONDS_PER_VERTEX_AND_MODE = 1.4e-4, 8.3e-7
"""To measure a brain, by the vertices of its surface and the modes of its spectrum; 9 k
to 18 k vertices."""
VERTEX_AREA = 0.87
"""Area of a vertex of an even triangulation over the square of the edge length."""
BAND_MODES = {"B4": 270, "B5": 1100, "B6": 4500}
"""Modes up to the end of a band, of a hemisphere."""
OPENED_FROM_GW, OPENED_PER_GW = 25.0, 0.11
"""Week from which the banks of opened sulci, which lie close and so have short edges,
add vertices, and how many."""
SECONDS_PER_STAGE = {
    "brain_figures": 6.5,
    "export": 20.0,
    "folding_figures": 13.0,
    "growth_found_figures": 5.0,
    "prepare": 2.0,
    "prepare_with_maps": 4.0,
    "prepared_surfaces": 9.0,
    "shape_maps": 6.5,
    "validation": 16.0,
}
"""By stage, for brains of any size, as in the demo."""
START_SECONDS = 2.0
"""For any job to start Python, import packages, and read and write small files."""
ERROR_FACTOR = 2.0
"""Factor by which predictions may be wrong."""
MIN_MIB, MIN_MINUTES, MIN_SURFACE_MIB = 2000, 60, 4000
"""Resources that any job needs: Python, dolfinx, compiled forms, slow processors."""


class Needs(NamedTuple):
    """Predicted cost of a simulation: time on one core, memory of all ranks, disk
    space."""

    seconds: float
    memory_mib: float
    disk_mib: float


def _surface_area_mm2(week: float) -> float:
    """Predict the area of the pial surface of a brain of a week, with sulci as labels
    of 0.8 mm show them."""
    return 9900 * (expected_volume_ml(week) / 51) ** 0.74


def _linear_elements(week: float, mesh: MeshSettings) -> float:
    """Predict the number of linear elements of a brain of a week, from its surface area
    and volume."""
    volume_ml, edge = expected_volume_ml(week), mesh.surface_edge_mm
    graded = 1 / edge**2 - 1 / mesh.core_edge_mm**2
    cubes = (
        _surface_area_mm2(week) * (2.5 / edge**2 + max(graded, 0))
        + volume_ml / ML_PER_MM3 / mesh.core_edge_mm**3
    )
    return ELEMENTS_PER_CUBE[mesh.mesher] * cubes


def simulation_needs(simulation: Simulation, mesh: MeshSettings) -> Needs:
    """Predict the cost of a simulation."""
    run, week = simulation.settings, simulation.weeks[0]
    elements = _linear_elements(week, mesh)
    steps = max(
        (run.end_week - week) * SECONDS_PER_GW / run.step_s,
        1.0,
    )
    memory = predicted_memory_mib(
        round(elements / (8 if mesh.order == 2 else 1)),
        run.ranks,
        run.contact,
        mesh.order,
    )
    # positions and fields of each output week, by a quarter as many nodes
    disk = (
        ((run.end_week - week) / run.output_every_gw + 1)
        * elements
        / 4
        * (24 + 12 * len(run.fields))
        / 2**20
    )
    rates = (
        SHAPES_SECONDS_PER_ELEMENT_AND_STEP
        if simulation.settings.growth.shapes
        else SECONDS_PER_ELEMENT_AND_STEP
    )
    return Needs(rates[mesh.order] * elements * steps, memory, disk)


def job_seconds(
    study: Study,
    rule: str,
    wildcards: Mapping[str, str],
) -> float:
    """Predict the processor time of a job, by its rule and wildcards."""
    return START_SECONDS + _work_seconds(study, rule, wildcards)


def _work_seconds(
    study: Study,
    rule: str,
    wildcards: Mapping[str, str],
) -> float:
    mesh, path_mesh = study.config.mesh, study.config.growth.path_mesh
    brain = wildcards.get("brain", "")
    if rule in FOLDINGS:
        simulation = study.simulations[wildcards["run"], brain]
        return simulation_needs(simulation, mesh).seconds
    match rule:
        case "tetrahedralise":
            return _meshing_seconds(study.brains[brain].week, mesh)
        case "path_mesh":
            return _meshing_seconds(study.brains[brain].week, path_mesh)
        case "atlas_path":
            return _series_seconds(study, study.paths[brain].weeks, path_mesh)
        case "targets":
            chain = study.chains[brain, wildcards["origin"]]
            return _series_seconds(study, chain.weeks, mesh)
        case "predicted_targets":
            return _prediction_seconds(study, brain, wildcards["origin"])
    return _brain_seconds(study, rule, wildcards)


def _brain_seconds(
    study: Study,
    rule: str,
    wildcards: Mapping[str, str],
) -> float:
    """Predict the time of a stage that deals with one brain, measured or simulated, or
    registers it as the later."""
    if rule in SECONDS_PER_STAGE:
        return SECONDS_PER_STAGE[rule]
    brain = study.brains.get(wildcards.get("later") or wildcards.get("brain", ""))
    if brain is None:
        return 0.0
    share = len(brain.sides) / len(SIDES)
    # rules of one hemisphere or with thickness are variants of a stage
    volume_stage = next(
        (stage for stage in SECONDS_PER_ML if rule.startswith(stage)), None
    )
    if volume_stage and brain.labels is not None:
        return (
            _fused_share(study, volume_stage)
            * SECONDS_PER_ML[volume_stage]
            * share
            * expected_volume_ml(brain.week)
        )
    if rule.startswith("measure"):
        # the surface of a simulated brain is that of its mesh, whatever its week
        is_simulated = rule.startswith("measure_simulated")
        edge_mm = (
            study.config.mesh.surface_edge_mm
            if is_simulated
            else study.config.surface.edge_length_mm
        )
        vertices = share * _surface_area_mm2(brain.week) / (VERTEX_AREA * edge_mm**2)
        has_opened_sulci = (
            study.config.surface.open_sulci
            and brain.labels is not None
            and brain.thickness is not None
            and not is_simulated
        )
        if has_opened_sulci:
            vertices *= 1 + OPENED_PER_GW * max(brain.week - OPENED_FROM_GW, 0.0)
        modes = study.config.metrics.spangy_modes
        n_modes = modes if isinstance(modes, int) else BAND_MODES[modes]
        return vertices * (SECONDS_PER_VERTEX + SECONDS_PER_VERTEX_AND_MODE * n_modes)
    return 0.0


def _meshing_seconds(week: float, mesh: MeshSettings) -> float:
    elements = _linear_elements(week, mesh) / (8 if mesh.order == 2 else 1)
    return MESHING_SECONDS_PER_ELEMENT[mesh.mesher] * elements


def _prediction_seconds(
    study: Study,
    brain: str,
    origin: str,
) -> float:
    """Predict the time for the shapes that an atlas' growth gives a start brain."""
    chain = study.chains[brain, origin]
    file = TARGETS.format(brain=brain, origin=origin)
    end = max(
        simulation.weeks[-1]
        for simulation in study.simulations.values()
        if simulation.targets == file
    )
    start = chain.weeks[0]
    later = []
    if chain.path is not None:
        later = [week for week in study.paths[chain.path].weeks if week > start]
    # it ends two weeks of the atlas after the end
    weeks = (
        max(
            later[: bisect_left(later, end) + 2],
            default=start,
        )
        - start
    )
    elements = _linear_elements(start, study.config.mesh)
    following_s = PREDICTION_SECONDS_PER_ELEMENT_AND_WEEK * elements * weeks
    return PREDICTION_SECONDS + following_s * _fused_share(study, "prediction")


def _series_seconds(
    study: Study,
    weeks: Sequence[float],
    mesh: MeshSettings,
) -> float:
    """Predict the time for a mesh to follow the brains of a series; with opened sulci,
    late weeks take most of it."""
    first = weeks[0]
    last = weeks[-1]
    elements = _linear_elements(first, mesh)
    per_week_s = SERIES_SECONDS_PER_ELEMENT_AND_WEEK * elements
    duration_gw = last - first
    if study.config.surface.open_sulci:
        deep_gw = max(last - max(first, DEEP_FOLDS_GW), 0.0)
        duration_gw += (DEEP_FOLDS_FACTOR - 1) * deep_gw
    return _fused_share(study, "series") * per_week_s * duration_gw


def _fused_share(study: Study, stage: str) -> float:
    """Return what a stage takes over what it takes with opened sulci."""
    return 1.0 if study.config.surface.open_sulci else FUSED_SHARE.get(stage, 1.0)


def job_limits(simulation: Simulation, mesh: MeshSettings) -> tuple[int, int]:
    """Return the limits of a simulation's job on a cluster: memory in MiB, and
    minutes."""
    needs = simulation_needs(simulation, mesh)
    minutes = ERROR_FACTOR * needs.seconds / simulation.settings.ranks / 60
    return max(ceil(ERROR_FACTOR * needs.memory_mib), MIN_MIB), max(
        ceil(minutes), MIN_MINUTES
    )


def targets_memory_mib(start: Brain, mesh: MeshSettings) -> int:
    """Return the memory limit in MiB for the targets of a start brain, whose linear
    elements are fitted on one rank."""
    needed = predicted_memory_mib(
        round(_linear_elements(start.week, mesh)), 1, "global", 1
    )
    return max(MIN_SURFACE_MIB, ceil(ERROR_FACTOR * needed))


def surface_memory_mib(labels: str, week: float) -> int:
    """Return the memory limit in MiB for extracting a surface: 16 bytes a voxel, and
    800 a voxel of the brain.

    A file that does not exist yet is assumed to be of usual size.
    """
    try:
        header = read_header(labels)
    except InputError:
        return MIN_SURFACE_MIB
    voxels, voxel_mm3 = prod(header.shape), prod(header.voxel_mm)
    inside = min(voxels, expected_volume_ml(week) / (voxel_mm3 * ML_PER_MM3))
    return max(
        MIN_SURFACE_MIB,
        ceil((16 * voxels + 800 * inside) / 2**20),
    )
