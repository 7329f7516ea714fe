"""Small folding problems for the tests under MPI."""

from dataclasses import dataclass, replace

import numpy as np
from mpi4py import MPI
from shapes import box_mesh

from gyriflow.folding.domain import Domain
from gyriflow.folding.growth import StepGrowth, layered_inverse
from gyriflow.folding.newton import NewtonSettings, NewtonSolver
from gyriflow.folding.problem import NonlinearProblem
from gyriflow.folding.zones import Zones
from gyriflow.geometry.jacobians import EDGES
from gyriflow.geometry.tetrahedra import TetrahedralMesh, boundary_faces, quadratic
from gyriflow.mechanics.materials import NeoHookean
from gyriflow.settings.terms import CLAMPED, FREE, LEFT_CONTACT, RIGHT_CONTACT

COMM = MPI.COMM_WORLD
MATERIAL = NeoHookean(poisson_ratio=0.45)


def distorted_box(cells=(4, 3, 3), size=(8.0, 6.0, 6.0), by=0.2):
    """Return a box in mm whose inner vertices are moved at random (seeded): no symmetry
    helps."""
    return shaken(box_mesh(cells, size), by, seed=3)


def curved_box(cells=(3, 2, 2), size=(8.0, 6.0, 6.0), by=0.1):
    """Return a box in mm of quadratic elements, whose inner nodes are moved at random
    (seeded): sides are curved."""
    return shaken(quadratic(distorted_box(cells, size)), by, seed=5)


def shaken(mesh, by, seed):
    """Return a mesh whose inner vertices are moved at random by up to some mm."""
    inner = np.setdiff1d(np.arange(len(mesh.vertices)), boundary_faces(mesh)[0])
    vertices = mesh.vertices.copy()
    random = np.random.default_rng(seed)
    vertices[inner] += random.uniform(-by, by, (len(inner), 3))
    return TetrahedralMesh(vertices, mesh.tets)


def zones_of(
    mesh,
    clamped=lambda x: np.zeros(len(x), bool),
    left=None,
    right=None,
    planes=(-0.5, 0.5),
):
    """Return zones by conditions on the facets' centroids in mm."""
    facets, _ = boundary_faces(mesh)
    centre = mesh.vertices[facets].mean(axis=1)
    zone = np.full(len(facets), FREE)
    zone[clamped(centre)] = CLAMPED
    if left is not None:
        zone[left(centre)] = LEFT_CONTACT
    if right is not None:
        zone[right(centre)] = RIGHT_CONTACT
    return Zones(facets, zone, np.ones(len(mesh.vertices)), 0.0, planes)


def at_the_bottom(centre):
    return centre[:, 2] < -2.99


def set_layers(problem, mu, dg, dr, normals, V=None):
    """Set shear modulus in Pa and growth increments (k,) at the local nodes, with unit
    normals (c, 3) of the cells."""
    points = problem.points
    mu, dg, dr = (
        nodal[problem.domain.cells] @ points.interpolation.T for nodal in (mu, dg, dr)
    )
    repeated = np.repeat(normals[:, None], len(points.weights), axis=1)
    problem.set_step(mu, layered_inverse(dg, dr, np.ones(len(mu), bool), repeated), V)


@dataclass(frozen=True, eq=False)
class EvenGrowth(StepGrowth):
    """Growth by the same part in all directions everywhere, and the model of it."""

    by: float

    def growth(self, start):
        return replace(self, start=start)

    def inverse(self, tissue):
        elements = tissue.elements
        points = len(elements.cells), len(elements.points.weights)
        return np.tile(np.eye(3) / (1 + self.by), (*points, 1, 1))


def problem_on(mesh, zones, mu=1000.0, dg=0.0, dr=0.0, comm=COMM, stretch=None):
    """Return a problem with layers that are uniform, or nodal functions of the position
    in m, and an old stretch everywhere."""
    domain = Domain(comm, mesh)
    problem = NonlinearProblem(domain, zones, MATERIAL, has_planes=True)
    x = domain.local(domain.positions)

    def nodal(value):
        return value(x) if callable(value) else np.full(len(x), value)

    cells = len(domain.cells)
    V = None if stretch is None else np.tile(stretch, (cells, 1, 1, 1))
    up = np.tile([0.0, 0.0, 1.0], (cells, 1))
    set_layers(problem, nodal(mu), nodal(dg), nodal(dr), up, V)
    return problem


def solver_of(problem, **settings):
    return NewtonSolver(problem, NewtonSettings(**settings), residual_floor=0.0)


def solved(problem, **settings):
    """Return the solution of Newton's method from rest."""
    return solver_of(problem, **settings).solve()


def smooth_displacement(domain, size=1e-3):
    """Return a smooth displacement of the local nodes in m that does not depend on the
    ranks."""
    x, y, z = domain.local(domain.positions).T * 1e3
    across = np.sin(0.3 * y + 0.1), np.cos(0.25 * z) - 0.4 * x / 8
    return size * np.column_stack([*across, np.sin(0.2 * x * y / 4)])


def gathered(domain, u):
    """Return the displacement of all vertices: two domains of one mesh may be spread
    over the ranks differently."""
    return domain.gather(u[: domain.n_owned])


def box_with_a_bowed_side():
    """Return a box with an inner side of an element bowed by 0.15 of its length, and
    the node in its middle."""
    mesh = quadratic(box_mesh((3, 3, 3), (6.0, 5.0, 4.0)))
    middles, sides = mesh.tets[:, 4:].ravel(), mesh.tets[:, EDGES].reshape(-1, 2)
    inner = np.flatnonzero(~np.isin(middles, boundary_faces(mesh)[0]))[0]
    positions = mesh.vertices.copy()
    along = np.diff(positions[sides[inner]], axis=0)[0]
    across = np.cross(along, [0.3, 0.5, 0.8])
    length_mm = 0.15 * np.linalg.norm(along)
    positions[middles[inner]] += length_mm * across / np.linalg.norm(across)
    return TetrahedralMesh(positions, mesh.tets), middles[inner]
