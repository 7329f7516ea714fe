"""Manufactured solutions: body forces that make a given displacement exact, and the
error of the solver.

The stress is written out by hand, so that a wrong energy in the solver would not
converge to the given displacement.
"""

from dataclasses import dataclass

import dolfinx
import numpy as np
import ufl
from mpi4py import MPI
from numpy.typing import NDArray

from gyriflow.folding.compilation import form_compiler
from gyriflow.folding.domain import Domain
from gyriflow.folding.growth import layered_inverse
from gyriflow.folding.newton import NewtonSettings, NewtonSolver
from gyriflow.folding.problem import NonlinearProblem
from gyriflow.folding.zones import Zones
from gyriflow.geometry.tetrahedra import (
    TetrahedralMesh,
    boundary_faces,
    grid,
    quadratic,
)
from gyriflow.mechanics.materials import NeoHookean
from gyriflow.settings.terms import CLAMPED

Floats = NDArray[np.float64]

POISSON_RATIO = 0.45
SIDE_MM = 10.0
UNIFORM, GRADED, STRETCHED = "uniform", "graded", "stretched"
CASES = (UNIFORM, GRADED, STRETCHED)
"""Uniform growth and stiffness; smooth functions of the position; or uniform with a
remembered stretch."""
STRETCH = np.array([[1.06, 0.03, 0.0], [0.03, 0.96, -0.02], [0.0, -0.02, 1.01]])
QUADRATURE = 5
"""Degree for the body force and the errors, far finer than the solver's own."""


@dataclass(frozen=True)
class Errors:
    """Relative errors of the displacement in L2, and of its gradient, on a mesh of
    `cells` cells along each side."""

    cells: int
    displacement: float
    gradient: float


def cube(cells: int, order: int) -> TetrahedralMesh:
    """Return a cube (mm) with inner vertices moved smoothly, since errors could cancel
    on an even grid."""
    x = grid([np.linspace(0.0, 1.0, cells + 1)] * 3)
    x = x if order == 1 else quadratic(x)
    bubble = np.sin(np.pi * x.vertices).prod(axis=1)[:, None]
    moved = x.vertices + 0.06 * bubble * np.cos(np.pi * x.vertices[:, [1, 2, 0]])
    return TetrahedralMesh(SIDE_MM * moved, x.tets)


class BodyForce:
    """A force f per volume of the updated reference configuration, with the energy −∫
    f·u dV."""

    def __init__(self, problem: NonlinearProblem, density) -> None:
        self.problem = problem
        dx = ufl.dx(metadata={"quadrature_degree": QUADRATURE})
        form = ufl.inner(density, ufl.TestFunction(problem.domain.space)) * dx
        with form_compiler(problem.domain.comm) as options:
            compiled = dolfinx.fem.form(form, jit_options=options)
        load = dolfinx.fem.assemble_vector(compiled)
        load.scatter_reverse(dolfinx.la.InsertMode.add)
        self.load = load.array[: 3 * problem.domain.n_owned]

    def energy(self, u: Floats) -> float:
        domain = self.problem.domain
        return -domain.dot(self.load, u[: domain.n_owned].ravel())

    def add_forces(self, u: Floats, out: Floats) -> None:
        out -= self.load

    def stiffness(self, u: Floats, *, convex: bool = False) -> None:
        return None

    def max_step(self, u: Floats, direction: Floats) -> float:
        return 1.0


def layers(case: str, x, sin):
    """Return μ (Pa), dg, dr and the angle of the normal (rad) at x (in side lengths),
    for NumPy's or UFL's sine."""
    if case == GRADED:
        wave = sin(2 * x[0] + x[1])
        return (
            900 + 600 * wave,
            0.10 + 0.05 * sin(3 * x[2] + x[0]),
            -0.04 + 0.03 * wave,
            0.8 * x[2] + 0.5 * x[0],
        )
    return 1000.0, 0.12, -0.05, 0.6


def exact_displacement(x):
    """Return the given displacement at x, both in side lengths: zero on the surface,
    gradients up to 0.4."""
    bubble = ufl.sin(ufl.pi * x[0]) * ufl.sin(ufl.pi * x[1]) * ufl.sin(ufl.pi * x[2])
    return bubble * ufl.as_vector(
        [0.1 * ufl.cos(2 * x[1]), 0.08 - 0.1 * x[0], 0.06 + 0.08 * x[1] * x[2]]
    )


def normal_at(angle):
    """Return the unit normal of an angle."""
    return ufl.as_vector([0.6 * ufl.cos(angle), 0.6 * ufl.sin(angle), 0.8])


def first_piola_stress(u, mu, dg, dr, N, V):
    """Return P = ∂ψ/∂F (Pa) of Fe = F·V·Fg⁻¹; ψ is per volume of the stress-free state,
    divided by det V."""
    K = 2 * mu * (1 + POISSON_RATIO) / (3 * (1 - 2 * POISSON_RATIO))
    F = ufl.Identity(3) + ufl.grad(u)
    growth = (1 + dg) * (ufl.Identity(3) - ufl.outer(N, N)) + (1 + dr) * ufl.outer(N, N)
    before = V * ufl.inv(growth)
    Fe = F * before
    J = ufl.det(Fe)
    cofactor = ufl.inv(Fe).T
    by_Fe = (
        mu * J ** (-2 / 3) * (Fe - ufl.tr(Fe.T * Fe) / 3 * cofactor)
        + K * (J - 1) * J * cofactor
    )
    return by_Fe * before.T / ufl.det(V)


def solved(
    case: str, cells: int, comm: MPI.Comm = MPI.COMM_WORLD, order: int = 1
) -> Errors:
    """Solve the cube with a case's body force and return the errors."""
    mesh = cube(cells, order)
    facets = boundary_faces(mesh)[0]
    zones = Zones(
        facets,
        np.full(len(facets), CLAMPED),
        np.ones(len(mesh.vertices)),
        0.0,
        (-1.0, 1.0),
    )
    domain = Domain(comm, mesh)
    has_stretch = case == STRETCHED
    problem = NonlinearProblem(domain, zones, NeoHookean(POISSON_RATIO))

    side = SIDE_MM * 1e-3
    nodes = domain.local(domain.positions) / side
    to_points = problem.points.interpolation.T
    points = np.matmul(problem.points.interpolation, nodes[domain.cells])
    mu, dg, dr = (
        np.broadcast_to(values, len(nodes))
        for values in layers(case, nodes.T, np.sin)[:3]
    )
    angle = np.broadcast_to(
        layers(case, np.moveaxis(points, 2, 0), np.sin)[3], points.shape[:2]
    )
    normals = np.stack(
        [0.6 * np.cos(angle), 0.6 * np.sin(angle), np.full(angle.shape, 0.8)], axis=2
    )
    mu, dg, dr = (values[domain.cells] @ to_points for values in (mu, dg, dr))
    V = np.tile(STRETCH, (*points.shape[:2], 1, 1))
    problem.set_step(
        mu,
        layered_inverse(dg, dr, np.ones(len(mu), bool), normals),
        V if has_stretch else None,
    )

    x = ufl.SpatialCoordinate(domain.mesh) / side
    exact = side * exact_displacement(x)
    V = ufl.as_matrix((STRETCH if has_stretch else np.eye(3)).tolist())
    mu, dg, dr, angle = layers(case, x, ufl.sin)
    stress = first_piola_stress(exact, mu, dg, dr, normal_at(angle), V)
    problem.contributions.append(BodyForce(problem, -ufl.div(stress)))
    solver = NewtonSolver(
        problem, NewtonSettings(1e-10, krylov_tolerance=1e-6), residual_floor=0.0
    )
    found = dolfinx.fem.Function(domain.space)
    found.x.array[:] = solver.solve().displacement.ravel()

    dx = ufl.dx(metadata={"quadrature_degree": QUADRATURE})
    gap, norms = found - exact, []
    with form_compiler(comm) as options:
        for field in (gap, exact, ufl.grad(gap), ufl.grad(exact)):
            form = dolfinx.fem.form(ufl.inner(field, field) * dx, jit_options=options)
            norms.append(np.sqrt(comm.allreduce(dolfinx.fem.assemble_scalar(form))))
    return Errors(cells, norms[0] / norms[1], norms[2] / norms[3])


def rates(errors: list[Errors]) -> Floats:
    """Return the (k - 1, 2) observed orders in L2 and in the gradient from each of k
    meshes to the next."""
    values = np.array([[e.displacement, e.gradient] for e in errors])
    h = 1 / np.array([e.cells for e in errors])
    return np.diff(np.log(values), axis=0) / np.diff(np.log(h))[:, None]
