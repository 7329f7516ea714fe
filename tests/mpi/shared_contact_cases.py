"""Contact on several ranks: together they find the same as a single one, and each of
them does its part."""

import numpy as np
import pytest
from boxes import COMM
from contact_bodies import GAP_MM, MU, two_blocks
from mpi4py import MPI

from gyriflow.folding.contact import SelfContact
from gyriflow.folding.domain import Domain
from gyriflow.geometry.tetrahedra import TetrahedralMesh, boundary_faces, quadratic
from gyriflow.units import M_PER_MM


def contact_in(comm, mesh):
    """Return a domain, and the contact of the mesh with itself."""
    domain = Domain(comm, mesh)
    return domain, SelfContact(domain, boundary_faces(mesh)[0], 2 * MU, 0.15)


def blocks(order):
    """Return two blocks whose meshes do not match, and a shaken displacement in mm that
    brings them near each other."""
    mesh = two_blocks(upper=(4, 3, 3))
    if order == 2:
        mesh = quadratic(two_blocks(cells=(3, 3, 1), upper=(2, 2, 1)))
    shaken = np.random.default_rng(7).uniform(-0.03, 0.03, mesh.vertices.shape)
    # no face may cross one that adjoins it
    shaken[:, 2] *= 0.3
    shaken[:, 2] -= np.sign(mesh.vertices[:, 2]) * GAP_MM / 4
    return mesh, shaken


def what_is_found(comm, mesh, moved_mm, further_mm):
    """Return numbers and fields of contact for a displaced body, and the pairs of this
    rank."""
    domain, contact = contact_in(comm, mesh)
    u = domain.local(moved_mm) * M_PER_MM
    x = np.random.default_rng(8).standard_normal(mesh.vertices.shape)
    stiffness = contact.stiffness(u)
    factor, product = stiffness.createVecs()
    factor.array[:] = domain.local(x)[: domain.n_owned].ravel()
    stiffness.mult(factor, product)
    forces = np.zeros(3 * domain.n_owned)
    contact.add_forces(u, forces)
    return {
        "pairs": contact.pair_count(u),
        "energy": contact.energy(u),
        "smallest": contact.smallest_distance_mm(u),
        "step": contact.max_step(u, domain.local(further_mm) * M_PER_MM),
        "forces": contact.forces(u),
        "residual": domain.gather(forces.reshape(-1, 3)),
        "product": domain.gather(product.array_r.reshape(-1, 3)),
        "pressure": contact.pressure(u),
    }, contact._near_pairs(u).pairs


@pytest.mark.parametrize("order", [1, 2])
def test_all_ranks_together_find_what_one_finds_alone(order):
    mesh, moved = blocks(order)
    closer = np.zeros_like(moved)
    closer[:, 2] = -np.sign(mesh.vertices[:, 2]) * GAP_MM
    found, own = what_is_found(COMM, mesh, moved, closer)
    alone, kinds = what_is_found(MPI.COMM_SELF, mesh, moved, closer)
    pairs = alone["pairs"]
    assert pairs > 100
    # none does all of it
    assert len(own) <= (1 if COMM.size == 1 else 0.8) * pairs
    for kind in (kinds.ev_collisions, kinds.ee_collisions, kinds.fv_collisions):
        assert len(kind) > 5
    assert found["pairs"] == pairs
    assert 0 < alone["step"] < 1
    for name in ("energy", "smallest", "step"):
        assert found[name] == pytest.approx(alone[name], rel=1e-10), name
    for name in ("forces", "residual", "product", "pressure"):
        size = np.abs(alone[name]).max()
        assert size > 0
        assert np.abs(found[name] - alone[name]).max() <= 1e-10 * size, name


@pytest.mark.parametrize("order", [1, 2])
def test_parts_of_the_ranks_follow_a_surface_that_moves_far(order):
    mesh, moved = blocks(order)
    domain, contact = contact_in(COMM, mesh)
    found = []
    for shift in (0.0, 30.0, -4.0):
        u = domain.local(moved + [shift, -shift / 2, 0.0]) * M_PER_MM
        # a way longer than the part has room for
        aside = np.tile([0.0, 0.0, 7.0], (len(u), 1)) * M_PER_MM
        assert contact.max_step(u, aside) == 1.0
        force = np.abs(contact.forces(u)).sum()
        found.append([contact.pair_count(u), contact.energy(u), force])
    assert found[0][0] > 100
    np.testing.assert_allclose(found[1:], [found[0]] * 2, rtol=1e-9)


def test_parts_that_touch_are_joined_on_all_ranks():
    # only one corner of the blocks comes near, in one rank's part
    mesh = two_blocks(gap=0.5)
    x, y, z = mesh.vertices.T
    lifted = mesh.vertices.copy()
    lifted[:, 2] += np.where(z > 0, -0.4 * np.exp(-((x - 3) ** 2) - (y - 3) ** 2), 0.0)
    for vertices, parts in ((mesh.vertices, 2), (lifted, 1)):
        domain, contact = contact_in(COMM, TetrahedralMesh(vertices, mesh.tets))
        assert domain.part.max() == 1
        assert len(np.unique(contact.join_touching(domain.part))) == parts
