"""Fold a bilayer slab so deep that the banks of its sulcus press on each other.

All lengths are in mm, and the cortex is 1 mm thick. The slab lies between sliding
sides, so its surface can only grow by folding. No closed answer is known: meshes,
element orders and time steps are compared with each other.
"""

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from gyriflow.folding.checkpoint import State
from gyriflow.folding.simulation import Folding, advance
from gyriflow.geometry.matching import faces_that_cross
from gyriflow.geometry.tetrahedra import TetrahedralMesh, finer_surface, grid, quadratic
from gyriflow.geometry.triangles import Floats, Ints, TriangleMesh, area
from gyriflow.settings.folding import FoldingParameters
from gyriflow.units import M_PER_MM, MM_PER_M

from .boxes import RATE_PER_S, box_zones, graded_depths, slab_parameters

WIDTH_MM, DEPTH_MM = 8.0, 8.0
"""About the fastest wave at a contrast of 5, which is 7.07 mm."""
GROOVE_MM, GROOVE_WIDTH_MM = 1.5, 0.8
"""Depth of the sulcus at the start, and the distance from its middle at which 1/e of
that is left."""
CONTRAST = 5.0
BOTTOM = 0.25
"""Share of the depth of the sulcus that counts as its bottom."""
FINE_DEPTH_MM = 2.5
COARSENING = 1.5
"""Ratio of heights of neighbouring elements below `FINE_DEPTH_MM`, to the power
1/(cells per cortical thickness)."""


@dataclass(frozen=True)
class Slab:
    """A slab with `cells` elements of an order through the cortex, which grows by
    `growth` in each step.

    `memory_gw` is the time in weeks over which stress is forgotten.
    """

    cells: float
    order: int
    growth: float
    contact: str = "global"
    memory_gw: float = 0.0

    def parameters(self) -> FoldingParameters:
        """Return the parameters of the run; the core grows, too, which widens gyri and
        closes the sulcus."""
        return slab_parameters(
            CONTRAST,
            self.growth,
            fissure_x_mm=0.0,
            core_growth_rate_per_s=RATE_PER_S,
            stress_memory_gw=self.memory_gw,
            contact=self.contact,
        )


@dataclass(frozen=True)
class Fold:
    """The surface after a step.

    `growth` is that of the cortex so far, `area_ratio` the area of the surface over
    that at the start, `depth_mm` that of the sulcus, and `pressure_pa` the mean
    pressure of its banks on each other per growth in the step, without the bottom of
    the sulcus: there the surface is so compressed that neighbours repel each other.
    """

    growth: float
    area_ratio: float
    depth_mm: float
    pressure_pa: float
    crossing: int
    least_volume_ratio: float


def mesh_of(slab: Slab) -> TetrahedralMesh:
    """Return the slab, one element across, with its sulcus along y in the middle."""
    depths = graded_depths(DEPTH_MM, slab.cells, FINE_DEPTH_MM, COARSENING, np.inf)
    # even, so that the bottom of the sulcus is a row of nodes
    x = np.linspace(
        -WIDTH_MM / 2, WIDTH_MM / 2, 2 * round(WIDTH_MM * slab.cells / 2) + 1
    )
    mesh = grid([x, np.arange(2) / slab.cells, -depths[::-1] * DEPTH_MM / depths[-1]])
    mesh = mesh if slab.order == 1 else quadratic(mesh)
    vertices = mesh.vertices.copy()
    groove = GROOVE_MM * np.exp(-((vertices[:, 0] / GROOVE_WIDTH_MM) ** 2))
    vertices[:, 2] -= groove * (1 + vertices[:, 2] / DEPTH_MM) ** 2
    return TetrahedralMesh(vertices, mesh.tets)


def folded(slab: Slab, area_ratio: float, comm: MPI.Comm = MPI.COMM_SELF) -> list[Fold]:
    """Return the fold after each step, the last with at least an area ratio."""
    mesh, p = mesh_of(slab), slab.parameters()
    folding = Folding(comm, mesh, box_zones(mesh, p), p)
    state, folds = State.at_start(mesh.vertices * M_PER_MM, p.step_s), []
    while not folds or folds[-1].area_ratio < area_ratio:
        state = advance(folding, state, state.time_s + p.step_s)
        folds.append(fold_of(slab, folding, state))
    return folds


def curved_surface(positions: Floats, facets: Ints, order: int) -> TriangleMesh:
    """Return the surface with `facets` (f, 3) of a mesh at (n, 3) positions in mm; of
    quadratic elements, a finer one.

    A quadratic element's face is curved: triangles between its nodes have a smaller
    area.
    """
    if order == 1:
        return TriangleMesh(positions, facets)
    nodes, numbers = np.unique(facets, return_inverse=True)
    weights, faces = finer_surface(numbers.reshape(-1, 3))
    return TriangleMesh(weights @ positions[nodes], faces)


def fold_of(slab: Slab, folding: Folding, state: State) -> Fold:
    """Return the fold after the last step."""
    zones = folding.zones
    start = mesh_of(slab).vertices
    places = state.positions * MM_PER_M
    top_at_start = curved_surface(start, zones.cortex_facets, slab.order)
    top = curved_surface(places, zones.cortex_facets, slab.order)
    height = top.vertices[np.unique(top.faces), 2]
    depth_mm = float(np.ptp(height))
    force = 0.0
    if folding.contact is not None:
        nodes = folding.contact.surface.nodes
        is_bank = (start[nodes, 0] < 0) & (
            places[nodes, 2] > height.min() + BOTTOM * depth_mm
        )
        forces = folding.contact.forces(folding.solved.displacement)
        force = abs(float(forces[is_bank, 0].sum()))
    row = state.rows[-1]
    bank_area_m2 = (1 - BOTTOM) * depth_mm / slab.cells * M_PER_MM**2
    growth_of_step = row["dt_s"] * RATE_PER_S
    return Fold(
        growth=float(
            np.expm1(np.log1p(slab.growth) * state.time_s / folding.parameters.step_s)
        ),
        area_ratio=area(top) / area(top_at_start),
        depth_mm=depth_mm,
        pressure_pa=force / bank_area_m2 / growth_of_step,
        crossing=len(
            faces_that_cross(curved_surface(places, zones.facets, slab.order))
        ),
        least_volume_ratio=row["min_J"],
    )


def at_ratio(folds: list[Fold], area_ratio: float) -> NDArray[np.float64]:
    """Return growth, depth in mm and pressure in Pa at an area ratio, linear between
    the two steps around it."""
    values = np.array(
        [
            (fold.area_ratio, fold.growth, fold.depth_mm, fold.pressure_pa)
            for fold in folds
        ]
    ).T
    return np.array([np.interp(area_ratio, values[0], value) for value in values[1:]])
