"""A growing slab with small waves on its surface, folded by the solver: `modes` says how they must grow.

One mesh carries waves of many lengths at once, cos(nπx/width), which fit between its sliding sides. They are so small
that each grows as it would alone; a cosine transform of the surface tells them apart. A slab without waves shows what
the mesh itself adds, which is taken off. All lengths are in mm, and the cortex is 1 mm thick.
"""

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from scipy.fft import dct

from gyriflow.folding.checkpoint import State
from gyriflow.folding.simulation import Folding
from gyriflow.folding.zones import zones_of_run
from gyriflow.geometry.tetrahedra import TetrahedralMesh, grid
from gyriflow.parameters.folding import FoldingParameters
from gyriflow.parameters.reading import parameters_from
from gyriflow.units import M_PER_MM, MM_PER_M, SECONDS_PER_GW

from .modes import Slab, amplifications

Floats = NDArray[np.float64]

WAVES = np.arange(1, 13)
"""Half waves across the width."""
HEIGHT_MM = 1e-4
RATE_PER_S = 1e-7
FINE_DEPTH_MM = 2.0
COARSENING = 1.8
"""Ratio of neighbouring elements' heights below, to the power of one over the cells to a cortical thickness."""
LARGEST = 8
"""Height of the deepest elements over that of the finest."""
ROWS = 2
"""Vertices across the slab; all lie on sides that keep them from moving across it."""


@dataclass(frozen=True)
class Waved:
    """A slab with waves, and steps in which its cortex grows by `growth` each.

    `memory` is the growth in which stress relaxes; width and depth hold two waves of the length that grows fastest.
    """

    contrast: float
    growth: float
    steps: int
    memory: float = 0.0
    scheme: str = "implicit"

    @property
    def width_mm(self) -> float:
        return float(round(4 * np.pi * (self.contrast / 3) ** (1 / 3)))

    @property
    def lengths_mm(self) -> Floats:
        """The wavelengths."""
        return 2 * self.width_mm / WAVES

    @property
    def in_theory(self) -> Slab:
        return Slab(self.contrast, depth=self.width_mm, memory=self.memory)

    def expected(self) -> Floats:
        """Returns the (steps + 1, waves) heights over those at the start, from `modes`."""
        return amplifications(self.in_theory, 2 * np.pi / self.lengths_mm, self.growth, self.steps, self.scheme)

    def parameters(self) -> FoldingParameters:
        """Returns the parameters of the run."""
        memory_gw = self.memory / RATE_PER_S / SECONDS_PER_GW
        values = {
            # no parameter depends on the week
            "start_week": 15.0,
            "end_week": 45.0,
            "output_weeks": [15.0, 45.0],
            "fissure_x_mm": self.width_mm / 2,
            "thickness_mm": 1.0,
            "shear_modulus_core_pa": 300.0,
            "shear_modulus_cortex_pa": 300.0 * self.contrast,
            "growth_rate_per_s": RATE_PER_S,
            "step_s": self.growth / RATE_PER_S,
            "stress_memory_gw": "infinite" if np.isinf(memory_gw) else memory_gw,
            "time_scheme": self.scheme,
            "support": "box",
            "contact": {"kind": "none"},
            "no_growth": {"kind": "none"},
            "solver": {"newton_tolerance": 1e-11, "krylov_tolerance": 1e-6},
        }
        return parameters_from(values)


def mesh_of(case: Waved, cells: int, height_mm: float) -> TetrahedralMesh:
    """Returns a slab with `cells` cells to a cortical thickness, coarser below, and waves of a height on top."""
    down, size = [0.0], 1 / cells
    while down[-1] < case.width_mm:
        if down[-1] >= FINE_DEPTH_MM - 1e-9:
            size = min(size * COARSENING ** (1 / cells), LARGEST / cells)
        down.append(down[-1] + size)
    down = np.array(down)
    down = np.where(
        down > FINE_DEPTH_MM,
        FINE_DEPTH_MM + (down - FINE_DEPTH_MM) * (case.width_mm - FINE_DEPTH_MM) / (down[-1] - FINE_DEPTH_MM),
        down,
    )
    x = np.linspace(0.0, case.width_mm, round(case.width_mm * cells) + 1)
    slab = grid([x, np.arange(ROWS) / cells, -down[::-1]])
    vertices = slab.vertices.copy()
    waves = np.cos(np.outer(vertices[:, 0], np.pi * WAVES / case.width_mm)).sum(axis=1)
    vertices[:, 2] += height_mm * waves * (1 + vertices[:, 2] / case.width_mm) ** 2
    return TetrahedralMesh(vertices, slab.tets)


def heights(case: Waved, cells: int, height_mm: float, comm: MPI.Comm) -> Floats:
    """Returns the (steps + 1, waves) heights in mm of the waves at the start and after each step."""
    mesh = mesh_of(case, cells, height_mm)
    p = case.parameters()
    folding = Folding(comm, mesh, zones_of_run(mesh, p), p)
    states = [State.at_start(mesh.vertices * M_PER_MM, p.step_s)]
    for _ in range(case.steps):
        states.append(folding.step(states[-1], p.step_s))
    columns = round(case.width_mm * cells) + 1
    # vertices are numbered along z first: the surface comes last
    surface = np.array([s.positions.reshape(columns, ROWS, -1, 3)[:, :, -1, 2].mean(axis=1) for s in states])
    return (dct(surface, type=1, axis=1) / (columns - 1))[:, WAVES] * MM_PER_M


def amplified(case: Waved, cells: int, comm: MPI.Comm = MPI.COMM_WORLD) -> Floats:
    """Returns the (steps + 1, waves) heights over those at the start, less what a flat slab shows."""
    flat, waved = (heights(case, cells, height, comm) for height in (0.0, HEIGHT_MM))
    return (waved - flat) / waved[0]
