"""Fold two hemispheres that are mirror images: the result must stay symmetric."""

from dataclasses import dataclass
from unittest import mock

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from gyriflow.folding import zones as zones_module
from gyriflow.folding.checkpoint import State
from gyriflow.folding.simulation import Folding
from gyriflow.folding.zones import Zones, zones_of_run
from gyriflow.geometry.tetrahedra import (
    TetrahedralMesh,
    boundary_faces,
    grid,
    quadratic,
)
from gyriflow.settings.folding import FoldingParameters, parameters_from
from gyriflow.units import M_PER_MM, MM_PER_M

Floats = NDArray[np.float64]

SEMI_AXES_MM = np.array([7.0, 12.0, 9.0])
MIDDLE_MM = 7.5
"""Distance of a hemisphere's centre from the midline."""
GAP_MM = 1.9
"""Width of the fissure for the contact planes, which the hemispheres almost touch at
the start."""
CLAMPED_BELOW = {
    "ELLIPSOID_SHIFT": (0.0, 0.0, -0.5),
    "ELLIPSOID_SEMI_AXES": (0.6, 0.45, 0.25),
}
"""The ellipsoid without growth at the bottom, so that growth pushes the hemispheres
against the planes."""
STEP_S = 86_400.0
TURNED = {1: [0, 1, 3, 2], 2: [0, 1, 3, 2, 4, 8, 7, 6, 5, 9]}
"""An element's nodes, by its order, after exchanging corners 2 and 3."""


@dataclass(frozen=True)
class Asymmetry:
    """Asymmetry of two mirrored hemispheres after some steps.

    Attributes
    ----------
    relative
        Largest distance of a vertex from its partner's mirror image, over the largest
        displacement.
    displacement_mm, penetration_mm
        Largest displacement from the start, and the largest depth beyond a contact
        plane.
    """

    relative: float
    displacement_mm: float
    penetration_mm: float


def hemisphere(cells: int, by: float = 0.05) -> TetrahedralMesh:
    """Return a right half (mm): an ellipsoid right of the midline, its vertices moved
    by up to `by` of a cell.

    They are moved at random (seeded), so that hardly any point has two nearest pial
    vertices.
    """
    cube = grid([np.linspace(-1.0, 1.0, cells + 1)] * 3)
    shell = np.abs(cube.vertices).max(axis=1, keepdims=True)
    length = np.linalg.norm(cube.vertices, axis=1, keepdims=True)
    ball = cube.vertices * shell / np.where(length > 0, length, 1.0)
    x = shell * ball + (1 - shell) * cube.vertices
    x += np.random.default_rng(11).uniform(-by, by, x.shape) * 2 / cells
    pial = np.unique(boundary_faces(cube)[0])
    x[pial] /= np.linalg.norm(x[pial], axis=1, keepdims=True)
    return TetrahedralMesh(x * SEMI_AXES_MM + [MIDDLE_MM, 0.0, 0.0], cube.tets)


def rounded(half: TetrahedralMesh, part: float = 0.5) -> TetrahedralMesh:
    """Return a `hemisphere` with quadratic elements whose outer edges are curved a part
    of the way to the ellipsoid."""
    straight = quadratic(half)
    pial = np.unique(boundary_faces(straight)[0])
    x = (straight.vertices[pial] - [MIDDLE_MM, 0.0, 0.0]) / SEMI_AXES_MM
    vertices = straight.vertices.copy()
    vertices[pial] += (
        part * SEMI_AXES_MM * x * (1 / np.linalg.norm(x, axis=1, keepdims=True) - 1)
    )
    return TetrahedralMesh(vertices, straight.tets)


def block(cells: int) -> TetrahedralMesh:
    """Return a right half in mm: a box of even cells, where most points have several
    nearest pial vertices."""
    span = np.linspace(-1.0, 1.0, cells + 1)
    return grid(
        [
            semi * span + middle
            for semi, middle in zip(SEMI_AXES_MM, (MIDDLE_MM, 0.0, 0.0), strict=True)
        ]
    )


def reflected_and_merged(half: TetrahedralMesh) -> TetrahedralMesh:
    """Return a half with its mirror image at x = 0; the partner of vertex i is vertex n
    + i."""
    image = half.vertices * [-1.0, 1.0, 1.0]
    # a mirrored element is inside out: exchange two of its corners and the nodes on
    # their edges
    tets = half.tets[:, TURNED[half.order]] + len(half.vertices)
    return TetrahedralMesh(
        np.concatenate([half.vertices, image]), np.concatenate([half.tets, tets])
    )


def parameters(**changes) -> FoldingParameters:
    """Return the parameters of a run with tight tolerances."""
    values = {
        "start_week": 21.0,
        "end_week": 36.0,
        "fissure_x_mm": 0.0,
        "output_weeks": [21.0, 36.0],
        "step_s": STEP_S,
        "thickness_mm": 2.5,
        "core_growth_rate_per_s": 1e-7,
        "contact": "planes",
        "newton_tolerance": 1e-12,
    }
    return parameters_from(values | changes)


def asymmetry(mesh: TetrahedralMesh, state: State, zones: Zones) -> Asymmetry:
    """Measure the asymmetry of a `reflected_and_merged` mesh in a state."""
    right, left = np.split(state.positions * MM_PER_M, 2)
    moved = np.linalg.norm(state.positions * MM_PER_M - mesh.vertices, axis=1).max()
    gap = np.linalg.norm(right - left * [-1.0, 1.0, 1.0], axis=1).max()
    return Asymmetry(
        float(gap / moved),
        float(moved),
        zones.penetration_mm(state.positions * MM_PER_M),
    )


def folded(
    half: TetrahedralMesh, steps: int, comm: MPI.Comm = MPI.COMM_WORLD, **changes
) -> tuple[State, Asymmetry]:
    """Fold a half with its mirror image and return the state and its asymmetry after
    some steps."""
    mesh = reflected_and_merged(half)
    p = parameters(**changes)
    with mock.patch.multiple(zones_module, **CLAMPED_BELOW):
        zones = zones_of_run(mesh, p, GAP_MM)
    folding = Folding(comm, mesh, zones, p)
    state = State.at_start(mesh.vertices * M_PER_MM, p.step_s)
    for _ in range(steps):
        state = folding.step(state, p.step_s)
    return state, asymmetry(mesh, state, zones)
