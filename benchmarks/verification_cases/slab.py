"""Fold a growing slab with small waves on its surface; `modes` predicts how they grow.

One mesh has waves of many lengths, cos(nπx/width), which fit between its sliding sides.
They are so small that they do not interact; a cosine transform of the surface separates
them. The waves of a flat slab, due to the mesh itself, are subtracted. All lengths are
in mm, and the cortex is 1 mm thick.
"""

import time
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from scipy.fft import dct

from gyriflow.folding.checkpoint import State
from gyriflow.folding.simulation import Folding
from gyriflow.geometry.tetrahedra import TetrahedralMesh, grid, quadratic
from gyriflow.settings.folding import FoldingParameters
from gyriflow.units import M_PER_MM, MM_PER_M, SECONDS_PER_GW

from .boxes import RATE_PER_S, box_zones, graded_depths, slab_parameters
from .modes import Slab, amplifications

Floats = NDArray[np.float64]

WAVES = np.arange(1, 13)
"""Half waves across the width."""
HEIGHT_MM = 1e-4
REFERENCE_GROWTH = 0.0086
"""Growth in a step of the reference model."""
FINE_DEPTH_MM = 2.0
COARSENING = 1.8
"""Ratio of heights of neighbouring elements below `FINE_DEPTH_MM`, to the power
1/(cells per cortical thickness)."""
MAX_COARSENING = 8
"""Height of the deepest elements over that of the finest."""
ROWS = 2
"""Corners across the slab; all are on sides where they cannot move across it."""


@dataclass(frozen=True)
class Waved:
    """A slab with waves, whose cortex grows by `growth` in each step.

    `memory` is the growth during which stress relaxes, `order` the element order. Width
    and depth are two wavelengths of the fastest wave.
    """

    contrast: float
    growth: float
    steps: int
    memory: float = 0.0
    poisson_ratio: float = 0.45
    order: int = 1

    @property
    def width_mm(self) -> float:
        return float(round(4 * np.pi * (self.contrast / 3) ** (1 / 3)))

    @property
    def lengths_mm(self) -> Floats:
        """The wavelengths."""
        return 2 * self.width_mm / WAVES

    @property
    def in_theory(self) -> Slab:
        return Slab(
            self.contrast, self.poisson_ratio, depth=self.width_mm, memory=self.memory
        )

    def expected(self) -> Floats:
        """Return the (steps + 1, waves) heights over those at the start, from
        `modes`."""
        return amplifications(
            self.in_theory, 2 * np.pi / self.lengths_mm, self.growth, self.steps
        )

    def parameters(self) -> FoldingParameters:
        """Return the parameters of the run."""
        memory_gw = self.memory / RATE_PER_S / SECONDS_PER_GW
        return slab_parameters(
            self.contrast,
            self.growth,
            fissure_x_mm=self.width_mm / 2,
            poisson_ratio=self.poisson_ratio,
            stress_memory_gw="infinite" if np.isinf(memory_gw) else memory_gw,
            contact="none",
            newton_tolerance=1e-11,
        )


def mesh_of(case: Waved, cells: int, height_mm: float) -> TetrahedralMesh:
    """Return a slab with `cells` cells per cortical thickness, coarser below, and waves
    of a height on top."""
    down = graded_depths(
        case.width_mm, cells, FINE_DEPTH_MM, COARSENING, MAX_COARSENING / cells
    )
    stretch = (case.width_mm - FINE_DEPTH_MM) / (down[-1] - FINE_DEPTH_MM)
    down = np.where(
        down > FINE_DEPTH_MM, FINE_DEPTH_MM + (down - FINE_DEPTH_MM) * stretch, down
    )
    x = np.linspace(0.0, case.width_mm, round(case.width_mm * cells) + 1)
    slab = grid([x, np.arange(ROWS) / cells, -down[::-1]])
    slab = slab if case.order == 1 else quadratic(slab)
    vertices = slab.vertices.copy()
    waves = np.cos(np.outer(vertices[:, 0], np.pi * WAVES / case.width_mm)).sum(axis=1)
    vertices[:, 2] += height_mm * waves * (1 + vertices[:, 2] / case.width_mm) ** 2
    return TetrahedralMesh(vertices, slab.tets)


def fastest_wave(case: Waved, cells: int, timed_steps: int = 4) -> dict[str, float]:
    """Return error and cost of a mesh for the fastest wave, on one rank.

    `rate_error` is the error of the growth rate in the first step, relative to the
    theory. `unknowns_per_mm` and `seconds_per_mm` are per mm across the slab; the
    latter is the processor time of a step with usual tolerances. The first steps, which
    compile and set up, are not counted.
    """
    comm = MPI.COMM_SELF
    mesh, p = mesh_of(case, cells, HEIGHT_MM), case.parameters()
    p = p.model_copy(
        update={
            "newton_tolerance": FoldingParameters.model_fields[
                "newton_tolerance"
            ].default,
            "step_s": REFERENCE_GROWTH / RATE_PER_S,
        }
    )
    folding = Folding(comm, mesh, box_zones(mesh, p), p)
    state, seconds = State.at_start(mesh.vertices * M_PER_MM, p.step_s), []
    for _ in range(2 + timed_steps):
        began = time.process_time()
        state = folding.step(state, p.step_s)
        seconds.append(time.process_time() - began)
    width_mm = (ROWS - 1) / cells
    return {
        "order": case.order,
        "cells": cells,
        "poisson_ratio": case.poisson_ratio,
        "rate_error": rate_error(case, cells, comm),
        "unknowns_per_mm": 3 * len(mesh.vertices) / width_mm,
        "seconds_per_mm": float(np.median(seconds[2:])) / width_mm,
    }


def rate_error(case: Waved, cells: int, comm: MPI.Comm = MPI.COMM_WORLD) -> float:
    """Return the relative error of the fastest wave's rate in the first step."""
    exact = np.log(case.expected()[1])
    return float((np.log(amplified(case, cells, comm)[1]) / exact - 1)[exact.argmax()])


def heights(case: Waved, cells: int, height_mm: float, comm: MPI.Comm) -> Floats:
    """Return the (steps + 1, waves) heights (mm) of the waves at the start and after
    each step."""
    mesh = mesh_of(case, cells, height_mm)
    p = case.parameters()
    folding = Folding(comm, mesh, box_zones(mesh, p), p)
    states = [State.at_start(mesh.vertices * M_PER_MM, p.step_s)]
    for _ in range(case.steps):
        states.append(folding.step(states[-1], p.step_s))
    flat = mesh_of(case, cells, 0.0).vertices
    top = np.flatnonzero(flat[:, 2] == 0.0)
    # evenly spaced along x, several across
    spacings = case.order * round(case.width_mm * cells)
    column = np.rint(flat[top, 0] * spacings / case.width_mm).astype(int)
    counts = np.bincount(column)
    surface = np.array(
        [np.bincount(column, state.positions[top, 2]) / counts for state in states]
    )
    return (dct(surface, type=1, axis=1) / spacings)[:, WAVES] * MM_PER_M


def amplified(case: Waved, cells: int, comm: MPI.Comm = MPI.COMM_WORLD) -> Floats:
    """Return the (steps + 1, waves) heights over those at the start, less those of a
    flat slab."""
    flat, waved = (heights(case, cells, height, comm) for height in (0.0, HEIGHT_MM))
    return (waved - flat) / waved[0]
