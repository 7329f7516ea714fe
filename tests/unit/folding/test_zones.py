"""Contact, clamped and growing zones on an ellipsoid, whose answer is known by
symmetry."""

import numpy as np
import pytest
from ellipsoid import CENTRE_MM, RUN, brain_mesh
from facts import Facts
from shapes import box_mesh, joined

from gyriflow.errors import InputError, MeshError
from gyriflow.folding import zones as zones_module
from gyriflow.folding.checks import refuse_impossible
from gyriflow.folding.zones import zones_of_run
from gyriflow.geometry.tetrahedra import TetrahedralMesh
from gyriflow.settings.folding import parameters_from
from gyriflow.settings.terms import (
    BETWEEN_PLANES,
    CLAMPED,
    LEFT_CONTACT,
    MEDIAL_WALL,
    RIGHT_CONTACT,
)

MIDDLE_MM = CENTRE_MM[0]


def find_zones(mesh, gap_mm=2.5, contact="planes", **given):
    """Return the zones of a run by the settings that decide them."""
    parameters = parameters_from(RUN | {"contact": contact} | given)
    return zones_of_run(mesh, parameters, gap_mm)


@pytest.fixture
def tiny_ellipsoid(monkeypatch):
    monkeypatch.setattr(zones_module, "ELLIPSOID_SEMI_AXES", (0.01, 0.01, 0.01))


@pytest.fixture(scope="module")
def brain():
    return brain_mesh(12)


def test_nothing_in_the_model_s_ellipsoid_grows_and_its_facets_are_clamped(brain):
    zones = find_zones(brain)
    low, high = brain.vertices.min(axis=0), brain.vertices.max(axis=0)
    middle, extent = (low + high) / 2, high - low
    centre = middle + [0.0, 0.05, -0.15] * extent
    semi_axes = [0.35, 0.40, 0.50] * extent
    inside = (((brain.vertices - centre) / semi_axes) ** 2).sum(axis=1) <= 1
    assert (zones.growing[inside] == 0).all()
    at_planes = [LEFT_CONTACT, RIGHT_CONTACT, BETWEEN_PLANES]
    is_clamped = inside[zones.facets].all(axis=1)
    is_clamped &= ~np.isin(zones.facet_zone, at_planes)
    np.testing.assert_array_equal(zones.facet_zone == CLAMPED, is_clamped)
    assert inside.sum() > 2 * is_clamped.sum() > 0


@pytest.mark.usefixtures("tiny_ellipsoid")
def test_tissue_that_bridges_the_planes_does_not_grow():
    # a vertex between the planes under the pial surface: its elements are the bridge
    mesh = brain_mesh(6)
    zones = find_zones(mesh)
    top = np.argmax(mesh.vertices[:, 2])
    assert zones.growing[top] == 0
    assert zones.growing[np.argmax(mesh.vertices[:, 0])] == 1


@pytest.mark.usefixtures("tiny_ellipsoid")
@pytest.mark.parametrize("gap", [0.5, 2.0, 4.0])
def test_the_planes_follow_the_fissure(gap):
    """Walls of separate hemispheres have contact and grow at any distance; the planes
    stay within the paper's."""
    half = box_mesh((4, 3, 3), (8.0, 6.0, 6.0))
    x = 4 + gap / 2
    pair = joined(
        (half, np.subtract(CENTRE_MM, [x, 0, 0])), (half, np.add(CENTRE_MM, [x, 0, 0]))
    )
    zones = find_zones(pair)
    planes = min(gap / 2, 0.625)
    expected = [MIDDLE_MM - planes, MIDDLE_MM + planes]
    np.testing.assert_allclose(zones.planes_mm, expected, rtol=1e-12)
    from_middle = np.abs(pair.vertices[zones.facets, 0] - MIDDLE_MM).max(axis=1)
    walls = np.abs(from_middle - gap / 2) < 1e-9
    assert set(zones.facet_zone[walls]) == {LEFT_CONTACT, RIGHT_CONTACT}
    assert (zones.growing == 1).all()


@pytest.mark.usefixtures("tiny_ellipsoid")
def test_a_brain_without_clamped_facets_is_refused(brain):
    zones = find_zones(brain)
    with pytest.raises(InputError, check=Facts("folding.support")):
        refuse_impossible(brain, zones)


def test_a_floating_part_is_refused(brain):
    small = box_mesh((2, 2, 2), (2.0, 2.0, 2.0))
    both = joined((brain, np.zeros(3)), (small, np.add(CENTRE_MM, [0, 0, 24])))
    zones = find_zones(both)
    with pytest.raises(MeshError, check=Facts("1 of 2", 27)):
        refuse_impossible(both, zones)


def test_a_fissure_outside_the_brain_is_refused(brain):
    with pytest.raises(InputError, check=Facts("fissure_x_mm", 50, 130, 170)):
        refuse_impossible(brain, find_zones(brain, fissure_x_mm=50.0))


def half(side):
    """Return the half of an ellipsoid on one side of its middle, flat there."""
    mesh = brain_mesh(12)
    sign = -1.0 if side == "left" else 1.0
    x = mesh.vertices[mesh.tets, 0] - MIDDLE_MM
    kept = (sign * x).min(axis=1) > -1e-9
    used, tets = np.unique(mesh.tets[kept], return_inverse=True)
    return TetrahedralMesh(mesh.vertices[used], tets.reshape(-1, 4))


@pytest.mark.parametrize("side", ["left", "right"])
def test_the_medial_wall_of_a_single_hemisphere_slides_in_its_plane(side):
    mesh = half(side)
    fissure = MIDDLE_MM + (0.5 if side == "left" else -0.5)
    zones = find_zones(mesh, fissure_x_mm=fissure, side=side)
    wall = zones.vertices_of(MEDIAL_WALL)
    inner = np.flatnonzero(np.abs(mesh.vertices[:, 0] - MIDDLE_MM) < 1e-6)
    assert np.isin(inner, wall).all()
    assert zones.fixed[wall, 0].all()
    free_in_plane = np.setdiff1d(wall, zones.vertices_of(CLAMPED))
    assert not zones.fixed[free_in_plane, 1:].any()
    assert zones.penetration_mm(mesh.vertices) == 0.0
    assert not zones.vertices_of(RIGHT_CONTACT if side == "left" else LEFT_CONTACT).size
    # without cortex, but part of the area that is measured
    n_wall = (zones.facet_zone == MEDIAL_WALL).sum()
    assert len(zones.cortex_facets) == len(zones.facets) - n_wall
    assert len(zones.measured_facets) == len(zones.facets)
    refuse_impossible(mesh, zones)


def test_a_sliding_wall_alone_leaves_no_rigid_motion():
    mesh = half("right")
    fissure = MIDDLE_MM - 0.5
    zones = find_zones(mesh, fissure_x_mm=fissure, side="right", support="free")
    assert not zones.free
    axes = np.eye(3)[:, None]
    shifts = np.broadcast_to(axes, (3, *mesh.vertices.shape))
    motions = np.concatenate([shifts, np.cross(axes, mesh.vertices)])
    fixed = motions[:, zones.fixed]
    assert np.linalg.matrix_rank(fixed) == 6
    assert zones.fixed[:, 1:].sum() == 3
    refuse_impossible(mesh, zones)
