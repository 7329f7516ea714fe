"""Bodies that come into contact with each other or with themselves."""

import numpy as np
from boxes import COMM, MATERIAL, set_layers, smooth_displacement
from shapes import box_mesh
from verification_cases.boxes import box_zones

from gyriflow.folding.checkpoint import State
from gyriflow.folding.contact import SelfContact
from gyriflow.folding.domain import Domain
from gyriflow.folding.problem import NonlinearProblem
from gyriflow.folding.simulation import Folding
from gyriflow.folding.zones import Zones, zones_of_run
from gyriflow.geometry.tetrahedra import TetrahedralMesh, boundary_faces, grid
from gyriflow.settings.folding import parameters_from
from gyriflow.settings.terms import CLAMPED, FREE, SIDE_X, SIDE_Y
from gyriflow.units import M_PER_MM

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
    vertices = np.concatenate([low.vertices - shift, high.vertices + shift])
    return TetrahedralMesh(
        vertices, np.concatenate([low.tets, high.tets + len(low.vertices)])
    )


def in_a_tube(mesh):
    """Return zones that hold the ends of two blocks and let their sides slide."""
    facets, _ = boundary_faces(mesh)
    centre = mesh.vertices[facets].mean(axis=1)
    zone = np.full(len(facets), FREE)
    zone[np.abs(centre[:, 0]) > SIDE_MM / 2 - 1e-6] = SIDE_X
    zone[np.abs(centre[:, 1]) > SIDE_MM / 2 - 1e-6] = SIDE_Y
    zone[np.abs(centre[:, 2]) > np.abs(mesh.vertices[:, 2]).max() - 1e-6] = CLAMPED
    return Zones(facets, zone, np.ones(len(mesh.vertices)), 0.0, (-0.5, 0.5))


def problem_with_contact(mesh, zones, distance, stiffness=2 * MU, growth_along_z=0.0):
    domain = Domain(COMM, mesh)
    problem = NonlinearProblem(domain, zones, MATERIAL)
    nodes, cells = len(domain.vertex_of_node), len(domain.cells)
    normal = np.tile([0.0, 0.0, 1.0], (cells, 1))
    set_layers(
        problem,
        np.full(nodes, MU),
        np.zeros(nodes),
        np.full(nodes, growth_along_z),
        normal,
    )
    contact = SelfContact(domain, zones.facets, stiffness, distance)
    problem.contributions.append(contact)
    return problem, contact


def approach(domain):
    """Return displacements of the local nodes in m by which two blocks close half of
    their gap, not evenly."""
    x = domain.local(domain.positions)
    u = smooth_displacement(domain, 1e-5)
    u[:, 2] -= np.sign(x[:, 2]) * GAP_MM / 4 * M_PER_MM
    return u


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
    mesh = grid(
        [
            np.linspace(-6.0, 6.0, 25),
            np.linspace(-1.5, 1.5, 4),
            np.linspace(0.0, 6.0, 11),
        ]
    )
    x, y, z = mesh.vertices.T
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
    return Folding(comm, mesh, zones, p), State.at_start(
        mesh.vertices * M_PER_MM, p.step_s
    )


def after_steps(folding, state, number):
    for _ in range(number):
        state = folding.step(state, state.step_s)
    return state
