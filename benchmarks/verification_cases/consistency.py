"""Consistency of energy, forces and stiffness: Taylor remainders and the patch test."""

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from gyriflow.folding.domain import Domain
from gyriflow.folding.growth import layered_inverse
from gyriflow.folding.problem import NonlinearProblem
from gyriflow.folding.zones import Zones
from gyriflow.geometry.tetrahedra import (
    TetrahedralMesh,
    boundary_faces,
    grid,
    quadratic,
)
from gyriflow.mechanics.materials import NeoHookean
from gyriflow.settings.terms import CLAMPED, FREE, LEFT_CONTACT, RIGHT_CONTACT

from .manufactured import STRETCH

Floats = NDArray[np.float64]

SIDE_MM = 6.0
AFFINE = np.array([[0.06, 0.02, -0.01], [0.03, -0.05, 0.02], [0.0, 0.04, 0.03]])
LENGTHS = 0.4 * 0.5 ** np.arange(5)
"""Steps along a direction."""


def cube(order: int) -> TetrahedralMesh:
    """Return a cube (mm) around the origin with inner vertices moved at random
    (seeded), so that sides are curved."""
    mesh = grid([np.linspace(-SIDE_MM / 2, SIDE_MM / 2, 5)] * 3)
    mesh = _shaken(mesh, 0.3)
    return mesh if order == 1 else _shaken(quadratic(mesh), 0.08)


def _shaken(mesh: TetrahedralMesh, by: float) -> TetrahedralMesh:
    inner = np.setdiff1d(np.arange(len(mesh.vertices)), boundary_faces(mesh)[0])
    vertices = mesh.vertices.copy()
    vertices[inner] += np.random.default_rng(3).uniform(-by, by, (len(inner), 3))
    return TetrahedralMesh(vertices, mesh.tets)


def problem_of(zone_of, comm: MPI.Comm, uniform: bool, order: int) -> NonlinearProblem:
    """Return a problem on the cube with growth, oblique normals, remembered stretch and
    zones by facet centroid."""
    mesh = cube(order)
    facets, _ = boundary_faces(mesh)
    zones = Zones(
        facets,
        zone_of(mesh.vertices[facets].mean(axis=1)),
        np.ones(len(mesh.vertices)),
        0.0,
        (-3.2, 3.2),
    )
    domain = Domain(comm, mesh)
    problem = NonlinearProblem(domain, zones, NeoHookean(0.45), has_planes=True)
    x = 0 if uniform else domain.local(domain.positions)[:, 2] / (SIDE_MM * 1e-3)
    ones, cells = np.ones(len(domain.vertex_of_node)), len(domain.cells)
    to_points = problem.points.interpolation.T
    mu, dg, dr = (
        nodal[domain.cells] @ to_points
        for nodal in (1000 * (ones + x), 0.05 * (ones + x), -0.02 * ones)
    )
    normals = np.tile([1 / 3, 2 / 3, 2 / 3], (*mu.shape, 1))
    V = np.tile(STRETCH, (cells, len(problem.points.weights), 1, 1))
    problem.set_step(mu, layered_inverse(dg, dr, np.ones(cells, bool), normals), V)
    return problem


def slopes_of_remainders(comm: MPI.Comm = MPI.COMM_WORLD, order: int = 1) -> Floats:
    """Return the (4, 2) orders of convergence of the Taylor remainders of a problem
    with all terms.

    These are |E(u + hv) − E(u) − h E'(u)v| and |r(u + hv) − r(u) − h K(u)v| at
    `LENGTHS`, with layers, remembered stress, a clamped base and both planes.
    """

    def zone_of(centre):
        zone = np.full(len(centre), FREE)
        zone[centre[:, 0] < -0.499 * SIDE_MM] = LEFT_CONTACT
        zone[centre[:, 0] > 0.499 * SIDE_MM] = RIGHT_CONTACT
        zone[centre[:, 2] < -0.499 * SIDE_MM] = CLAMPED
        return zone

    problem = problem_of(zone_of, comm, uniform=False, order=order)
    domain = problem.domain
    # sides at -3 and 3 mm, planes at 3.2 and -3.2 mm: contact is active everywhere
    x = domain.local(domain.positions) * 1e3
    u = 2e-4 * np.stack(
        [
            np.sin(0.3 * x[:, 1]),
            np.cos(0.25 * x[:, 2]),
            np.sin(0.05 * x[:, 0] * x[:, 1]),
        ],
        axis=1,
    )
    v = np.ascontiguousarray(u[:, [2, 0, 1]]) / 2
    v[x[:, 2] < -0.499 * SIDE_MM] = 0.0
    energy = problem.energy(u)
    residual = problem.residual(u)
    owned = v[: domain.n_owned].ravel()
    tangent = problem.tangent(residual).matrix
    direction, change = tangent.createVecs()
    direction.array[:] = owned
    tangent.mult(direction, change)
    remainders = []
    for h in LENGTHS:
        energy_remainder = abs(
            problem.energy(u + h * v) - energy - h * domain.dot(residual.owned, owned)
        )
        force_remainder = domain.norm(
            problem.residual(u + h * v).owned - residual.owned - h * change.array_r
        )
        remainders.append([energy_remainder, force_remainder])
    return np.diff(np.log(remainders), axis=0) / np.diff(np.log(LENGTHS))[:, None]


def patch_residual(comm: MPI.Comm = MPI.COMM_WORLD, order: int = 1) -> float:
    """Return the residual inside a uniform body under an affine displacement, over the
    force on its surface."""
    norms = []
    for zone in (CLAMPED, FREE):
        problem = problem_of(
            lambda centre, zone=zone: np.full(len(centre), zone),
            comm,
            uniform=True,
            order=order,
        )
        norms.append(
            problem.residual(
                problem.domain.local(problem.domain.positions) @ AFFINE.T
            ).norm
        )
    return float(norms[0] / norms[1])
