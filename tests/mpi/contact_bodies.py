"""Bodies that come into contact with each other or with themselves."""

import numpy as np
from boxes import (
    COMM,
    MATERIAL,
    gathered,
    problem_on,
    smooth_displacement,
    zones_of,
)
from shapes import box_mesh, joined
from verification_cases.boxes import box_zones

from gyriflow.folding.checkpoint import State
from gyriflow.folding.contact import SelfContact
from gyriflow.folding.simulation import Folding
from gyriflow.folding.zones import zones_of_run
from gyriflow.geometry.tetrahedra import TetrahedralMesh, boundary_faces
from gyriflow.settings.folding import parameters_from
from gyriflow.settings.terms import CLAMPED, SIDE_X, SIDE_Y
from gyriflow.units import M_PER_MM, MM_PER_M

HEIGHT_MM, SIDE_MM, GAP_MM = 4.0, 6.0, 0.2
MU, NU = 1000.0, MATERIAL.poisson_ratio
RUN = {
    "start_week": 21.0,
    "end_week": 30.0,
    "output_weeks": [21.0, 30.0],
    "fissure_x_mm": 0.0,
    "support": "free",
}


def two_blocks(cells=(5, 5, 3), upper=(5, 5, 3), gap=GAP_MM):
    """Return a box above another with a gap between them."""
    low, high = (box_mesh(n, (SIDE_MM, SIDE_MM, HEIGHT_MM)) for n in (cells, upper))
    shift = np.array([0.0, 0.0, (HEIGHT_MM + gap) / 2])
    return joined((low, -shift), (high, shift))


def in_a_tube(mesh):
    """Return zones that hold the ends of two blocks and let their sides slide."""
    zones = zones_of(mesh)
    outside = np.abs(mesh.vertices).max(axis=0) - 1e-6
    centre = np.abs(mesh.vertices[zones.facets].mean(axis=1))
    for axis, zone in enumerate((SIDE_X, SIDE_Y, CLAMPED)):
        zones.facet_zone[centre[:, axis] > outside[axis]] = zone
    return zones


def problem_with_contact(mesh, distance, growth_along_z=0.0, comm=COMM):
    """Return the problem of two blocks in a tube, and their contact."""
    zones = in_a_tube(mesh)
    problem = problem_on(mesh, zones, MU, dr=growth_along_z, comm=comm)
    contact = SelfContact(problem.domain, zones.facets, 2 * MU, distance)
    problem.contributions.append(contact)
    return problem, contact


def approach(domain):
    """Return displacements of the local nodes in m by which two blocks close half of
    their gap, not evenly."""
    x = domain.local(domain.positions)
    u = smooth_displacement(domain, 1e-5)
    u[:, 2] -= np.sign(x[:, 2]) * GAP_MM / 4 * M_PER_MM
    return u


def gap_and_pressure(mesh, problem, contact, u):
    """Return the mean gap of two blocks in mm, and the pressure in Pa between them."""
    places = mesh.vertices + gathered(problem.domain, u) * MM_PER_M
    top, bottom = (
        np.isclose(mesh.vertices[:, 2], side * GAP_MM / 2) for side in (-1, 1)
    )
    forces = np.zeros_like(places)
    forces[np.unique(boundary_faces(mesh)[0])] = contact.forces(u)
    pressure = forces[top, 2].sum() / (SIDE_MM * M_PER_MM) ** 2
    return places[bottom, 2].mean() - places[top, 2].mean(), pressure


def stress_at(stretch, growth):
    """Return the first Piola-Kirchhoff stress in Pa along z of uniaxial strain after
    growth along z."""
    K = 2 * MU * (1 + NU) / (3 * (1 - 2 * NU))
    Fe = stretch / (1 + growth)
    by_Fe = MU / 2 * (2 * Fe ** (1 / 3) - 2 / 3 * (2 + Fe**2) * Fe ** (-5 / 3)) + K * (
        Fe - 1
    )
    return by_Fe / (1 + growth)


def slab_with_a_sulcus():
    """Return a block with a narrow groove along y in its top, in mm."""
    mesh = box_mesh((24, 2, 10), (12.0, 2.0, 6.0))
    x, y, z = mesh.vertices.T + [[0.0], [0.0], [3.0]]
    groove = 3.0 * np.exp(-((x / 0.5) ** 2))
    # even in y but for a trace, so that nothing meets exactly
    lift = 1 - groove / 6.0 + 1e-3 * np.sin(1.3 * y + x)
    return TetrahedralMesh(np.stack([x, y, z * lift], axis=1), mesh.tets)


def closing_sulcus(kind, comm=COMM, support="box", **changes):
    """Return what folds a block with a groove that closes in some steps, and the state
    at the start."""
    mesh = slab_with_a_sulcus()
    growth = {"thickness_mm": 2.0, "growth_rate_per_s": 1e-6, "contact": kind}
    p = parameters_from(RUN | growth | changes)
    zones = zones_of_run(mesh, p) if support == "free" else box_zones(mesh, p)
    return at_start(mesh, zones, p, comm)


def at_start(mesh, zones, p, comm=COMM, maps=None):
    """Return what folds a mesh, and its state at the start."""
    state = State.at_start(mesh.vertices * M_PER_MM, p.step_s)
    return Folding(comm, mesh, zones, p, maps), state


def after_steps(folding, state, number):
    for _ in range(number):
        state = folding.step(state, state.step_s)
    return state


def vertices_pulled_near(gap, count, growth_rate_per_s=0.0):
    """Return what folds two blocks in a tube, and their start: few vertices of the
    upper one almost touch the lower."""
    mesh = two_blocks(gap=gap)
    facing = np.isclose(mesh.vertices[:, 2], gap / 2)
    facing &= np.abs(mesh.vertices[:, :2]).max(axis=1) < SIDE_MM / 2 - 1e-6
    positions = mesh.vertices.copy()
    positions[np.flatnonzero(facing)[[1, 11][:count]], 2] = 0.01 - gap / 2
    mesh = TetrahedralMesh(positions, mesh.tets)
    p = parameters_from(RUN | {"growth_rate_per_s": growth_rate_per_s})
    return at_start(mesh, in_a_tube(mesh), p)
