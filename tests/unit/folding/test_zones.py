"""Contact, clamped and growing zones on an ellipsoid, whose answer is known by
symmetry."""

import numpy as np
import pytest
from ellipsoid import CENTRE_MM, GAP_MM, RUN, brain_mesh
from facts import Facts
from shapes import box_mesh
from verification_cases.boxes import box_zones

from gyriflow.errors import InputError, MeshError
from gyriflow.folding import zones as zones_module
from gyriflow.folding.checks import refuse_impossible, zone_report
from gyriflow.folding.zones import brain_box, cell_tags, inside_ellipsoid, zones_of_run
from gyriflow.geometry.tetrahedra import TetrahedralMesh, signed_volumes
from gyriflow.geometry.triangles import TriangleMesh, area, face_areas
from gyriflow.settings.folding import parameters_from
from gyriflow.settings.terms import (
    BRIDGE,
    CLAMPED,
    CORE,
    CORTEX,
    LEFT,
    LEFT_CONTACT,
    MEDIAL_WALL,
    RIGHT,
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


def test_the_ellipsoid_is_where_the_model_puts_it():
    box = np.array([[-10.0, -20.0, -30.0], [10.0, 20.0, 30.0]]) + CENTRE_MM
    centre = CENTRE_MM + np.array([0.0, 0.05 * 40, -0.15 * 60])
    tips = centre + np.diag([0.35 * 20, 0.40 * 40, 0.50 * 60])
    points = np.concatenate(
        [box, centre + 0.999 * (tips - centre), centre + 1.001 * (tips - centre)]
    )
    inside = inside_ellipsoid(points, *brain_box(points))
    assert inside.tolist() == [False, False, True, True, True, False, False, False]


def test_contact_facets_lie_on_their_side_and_are_mirror_images(brain):
    zones = find_zones(brain)
    x = brain.vertices[zones.facets, 0] - MIDDLE_MM
    left = x[zones.facet_zone == LEFT_CONTACT]
    right = x[zones.facet_zone == RIGHT_CONTACT]
    assert len(left)
    assert left.min() > -5.0
    assert left.max() <= -0.625
    np.testing.assert_allclose(
        np.sort(left.ravel()), np.sort(-right.ravel()), atol=1e-9
    )


def test_clamped_facets_lie_in_the_ellipsoid_and_outside_the_contact(brain):
    zones = find_zones(brain)
    clamped = zones.vertices_of(CLAMPED)
    assert len(clamped)
    inside = inside_ellipsoid(brain.vertices, *brain_box(brain.vertices))
    assert inside[clamped].all()
    # nothing inside grows, at the surface or below it
    assert inside.sum() > 2 * len(clamped)
    assert (zones.growing[inside] == 0).all()


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
    boxes = [box_mesh((4, 3, 3), (8.0, 6.0, 6.0)) for _ in range(2)]
    x = [
        mesh.vertices + CENTRE_MM + [shift, 0.0, 0.0]
        for mesh, shift in zip(boxes, (-4 - gap / 2, 4 + gap / 2), strict=True)
    ]
    tets = [boxes[0].tets, boxes[1].tets + len(x[0])]
    pair = TetrahedralMesh(np.concatenate(x), np.concatenate(tets))
    zones = find_zones(pair)
    planes = min(gap / 2, 0.625)
    expected = [MIDDLE_MM - planes, MIDDLE_MM + planes]
    np.testing.assert_allclose(zones.planes_mm, expected, rtol=1e-12)
    from_middle = np.abs(pair.vertices[zones.facets, 0] - MIDDLE_MM).max(axis=1)
    walls = np.abs(from_middle - gap / 2) < 1e-9
    assert set(zones.facet_zone[walls]) == {LEFT_CONTACT, RIGHT_CONTACT}
    assert (zones.growing == 1).all()


def test_tissue_between_the_planes_does_not_grow_with_planes(brain):
    """As in the prototype of the paper: elements whose most medial vertex lies between
    the planes."""
    zones = find_zones(brain)
    left, right = zones.planes_mm
    x = brain.vertices[:, 0]
    assert (zones.growing[(left < x) & (x < right)] == 0).all()


def test_the_report_adds_up(brain):
    zones = find_zones(brain)
    report = zone_report(brain, zones, 3.0)
    assert sum(zone["facets"] for zone in report["zones"].values()) == len(zones.facets)
    surface = TriangleMesh(brain.vertices, zones.facets)
    areas = [zone["area_mm2"] for zone in report["zones"].values()]
    assert sum(areas) == pytest.approx(area(surface))
    assert report["zones"]["clamped"]["facets"] == (zones.facet_zone == CLAMPED).sum()
    assert report["initial_penetration_mm"] == 0
    assert report["clamped_share"]["left"] == pytest.approx(
        report["clamped_share"]["right"], rel=0.05
    )


def test_the_clamped_share_is_that_of_the_area_on_each_side_of_the_fissure(brain):
    # 6 mm beside the middle, so that the sides differ
    zones = find_zones(brain, fissure_x_mm=MIDDLE_MM + 6.0)
    shares = zone_report(brain, zones, 3.0)["clamped_share"]
    triangles = brain.vertices[zones.facets]
    areas = face_areas(TriangleMesh(brain.vertices, zones.facets))
    is_clamped = zones.facet_zone == CLAMPED
    on_left = triangles[:, :, 0].mean(axis=1) < MIDDLE_MM + 6.0
    for side, mask in (("left", on_left), ("right", ~on_left)):
        expected = areas[mask & is_clamped].sum() / areas[mask].sum()
        assert shares[side] == pytest.approx(expected)
    assert abs(shares["left"] - shares["right"]) > 0.02


def test_elements_through_the_cortex_are_counted_by_the_edges_in_it():
    box = box_mesh((8, 8, 8), (8.0, 8.0, 8.0))
    vertices = box.vertices + CENTRE_MM
    # the inner half is made of longer elements
    depth = np.abs(box.vertices).max(axis=1)
    vertices += box.vertices * np.where(depth < 2.5, 0.3, 0.0)[:, None]
    mesh = TetrahedralMesh(vertices, box.tets)
    zones = find_zones(mesh, contact="none", support="free")
    edge = (3 + 2 * np.sqrt(2) + np.sqrt(3)) / 6
    found = zone_report(mesh, zones, 0.8)["elements_through_cortex"]
    assert found == pytest.approx(0.8 / edge)


def test_few_walls_lie_between_the_planes(brain):
    zones = zone_report(brain, find_zones(brain, 20.0), 8.0)["zones"]
    assert zones["between planes"]["area_mm2"] <= 0.01 * sum(
        zone["area_mm2"] for zone in zones.values()
    )


def test_the_sides_of_a_box_slide_in_their_planes():
    box = box_mesh((4, 3, 2), (8.0, 6.0, 4.0))
    values = {
        "contact": "none",
        "support": "free",
    }
    zones = box_zones(box, parameters_from(RUN | values))
    x, y, z = box.vertices.T
    low = z == -2.0
    np.testing.assert_array_equal(zones.fixed[:, 0], (np.abs(x) == 4.0) | low)
    np.testing.assert_array_equal(zones.fixed[:, 1], (np.abs(y) == 3.0) | low)
    np.testing.assert_array_equal(zones.fixed[:, 2], low)
    assert (box.vertices[zones.cortex_facets][:, :, 2] == 2.0).all()
    assert (zones.growing == 1).all()


@pytest.mark.usefixtures("tiny_ellipsoid")
def test_a_brain_without_clamped_facets_is_refused(brain):
    zones = find_zones(brain)
    with pytest.raises(InputError, check=Facts("folding.support")):
        refuse_impossible(brain, zones)


def test_a_floating_part_is_refused(brain):
    far = box_mesh((2, 2, 2), (2.0, 2.0, 2.0))
    both = TetrahedralMesh(
        np.concatenate([brain.vertices, far.vertices + CENTRE_MM + [0.0, 0.0, 24.0]]),
        np.concatenate([brain.tets, far.tets + len(brain.vertices)]),
    )
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
    # pressed flat: the other half becomes a sheet, so only elements of one side are
    # kept
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
    assert (
        not np.isin(zones.facets[zones.facet_zone == MEDIAL_WALL], zones.cortex_facets)
        .all(axis=1)
        .all()
    )
    assert len(zones.measured_facets) == len(zones.facets)
    refuse_impossible(mesh, zones)


def test_a_sliding_wall_alone_leaves_no_rigid_motion():
    mesh = half("right")
    fissure = MIDDLE_MM - 0.5
    zones = find_zones(mesh, fissure_x_mm=fissure, side="right", support="free")
    assert not zones.free
    x, y, z = mesh.vertices.T
    zero, one = np.zeros_like(x), np.ones_like(x)
    turns = np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]])
    motions = np.concatenate(
        [np.array([[one, zero, zero], [zero, one, zero], [zero, zero, one]]), turns]
    )
    fixed = motions.transpose(0, 2, 1)[:, zones.fixed]
    assert np.linalg.matrix_rank(fixed) == 6
    assert zones.fixed[:, 1:].sum() == 3
    refuse_impossible(mesh, zones)


def test_elements_are_left_right_or_between_the_planes():
    mesh = brain_mesh(12)
    tags = cell_tags(
        mesh,
        find_zones(mesh, GAP_MM),
        (mesh.vertices[:, 1] > CENTRE_MM[1]).astype(float),
    )
    growing = find_zones(mesh, GAP_MM).growing[mesh.tets]
    assert set(tags["growing"][(growing > 0).any(axis=1)]) == {1}
    assert set(tags["growing"][(growing == 0).all(axis=1)]) == {0}
    y = mesh.vertices[mesh.tets, 1] - CENTRE_MM[1]
    assert set(tags["layer"][y.min(axis=1) > 0]) == {CORTEX}
    assert set(tags["layer"][y.max(axis=1) <= 0]) == {CORE}
    x = mesh.vertices[mesh.tets, 0].mean(axis=1) - MIDDLE_MM
    # the planes stand a quarter of the gap to both sides
    np.testing.assert_array_equal(tags["hemisphere"] == LEFT, x <= -2.0)
    np.testing.assert_array_equal(tags["hemisphere"] == RIGHT, x >= 2.0)
    assert (np.abs(x[tags["hemisphere"] == BRIDGE]) < 2.0).all()
    # the numbers that docs/outputs.md has
    assert (LEFT, RIGHT, BRIDGE, CORTEX, CORE) == (1, 2, 3, 1, 2)
    volumes = signed_volumes(mesh)
    left, right = (volumes[tags["hemisphere"] == side].sum() for side in (LEFT, RIGHT))
    assert left == pytest.approx(right)
