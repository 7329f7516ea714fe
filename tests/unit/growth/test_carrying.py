"""Brains correspond by their matched surfaces or by registration, and what lies on them
is carried along."""

import numpy as np
import pytest
from facts import Facts
from shapes import ellipsoid_mesh, rigid, scaling, sphere

from gyriflow.errors import InputError
from gyriflow.geometry.deformations import Deformation, MatchedSurfaces, carry
from gyriflow.geometry.triangles import TriangleMesh, flipped, transformed
from gyriflow.growth.carrying import (
    carry_over_weeks,
    follow_surfaces,
    maps_on_template,
    match_surfaces,
)
from gyriflow.io.registrations import (
    WeeklyShapes,
    read_correspondence,
    read_weekly_shapes,
)

ATLAS = sphere()
STRETCH = np.array([1.2, 1.1, 1.0])
GROWN = MatchedSurfaces(ATLAS, ATLAS.vertices * STRETCH)
GRID = scaling(4.0, -30.0)
TURN = rigid(10, 20, 150)[:3, :3]


def test_surfaces_are_matched_whatever_the_order_of_their_triangles():
    later = TriangleMesh(GROWN.second, ATLAS.faces[::-1, [1, 2, 0]])
    found, report = match_surfaces(flipped(ATLAS), flipped(later))
    assert np.array_equal(found.second, GROWN.second)
    assert np.array_equal(found.first.faces, ATLAS.faces)
    assert report["vertices"] == len(ATLAS.vertices)
    assert report["turn_deg"] == pytest.approx(0, abs=1e-3)
    assert 0 < report["scatter"] < 0.1
    assert report["area_ratio"] == pytest.approx(1.21, abs=0.01)
    with pytest.raises(ValueError, match=r"2562 .*2561"):
        MatchedSurfaces(ATLAS, GROWN.second[1:])


OTHER_FACES = ATLAS.faces.copy()
OTHER_FACES[0, 2] = OTHER_FACES[400, 2]
SHUFFLED = np.random.default_rng(0).permutation(GROWN.second)
FACES = "2562", "5120", "growth.matched_surfaces"


@pytest.mark.parametrize(
    ("later", "facts"),
    [
        (sphere(subdivisions=3), (642, 1280, *FACES)),
        (TriangleMesh(GROWN.second, OTHER_FACES), FACES),
        (TriangleMesh(SHUFFLED, ATLAS.faces), ("129°", 1.39, "30°", 0.3)),
        (transformed(ATLAS, rigid(0, 30.5, 0)), ("30°",)),
    ],
)
def test_other_triangles_and_other_places_are_refused(later, facts):
    with pytest.raises(InputError, check=Facts(*facts)):
        match_surfaces(ATLAS, later)
    match_surfaces(ATLAS, transformed(ATLAS, rigid(0, 29.5, 0)))


def test_another_mesh_of_the_brain_follows_in_any_pose():
    own = transformed(sphere(10.1, 3), rigid(0, 0, 53))
    there = MatchedSurfaces(ATLAS, GROWN.second @ TURN.T + [5.0, 0, 0])
    back = MatchedSurfaces(TriangleMesh(there.second, ATLAS.faces), GROWN.second)
    found = follow_surfaces(own, [there, back])
    stretched = own.vertices * STRETCH
    assert found[0] == pytest.approx(own.vertices)
    assert found[1] == pytest.approx(stretched @ TURN.T + [5.0, 0, 0], abs=0.05)
    assert found[2] == pytest.approx(stretched, abs=0.05)


def test_a_surface_may_lie_2_mm_from_the_matched_one():
    follow_surfaces(sphere(11.9, 3), [GROWN])
    with pytest.raises(InputError, check=Facts("2 mm")):
        follow_surfaces(sphere(12.1, 3), [GROWN])


def test_points_outside_the_grid_of_a_registration_are_refused():
    body = ellipsoid_mesh(4, (10.0, 10.0, 10.0)).vertices + [60.0, 0, 0]
    chain = [Deformation(scaling(1.2), np.zeros((16, 16, 16, 3)), GRID)] * 2
    with pytest.raises(InputError, check=Facts(1, 2, len(body), "40 mm")):
        carry_over_weeks(body, chain)
    brain, template = sphere(), transformed(ATLAS, scaling(1, (60, 0, 0)))
    with pytest.raises(InputError, check=Facts(len(ATLAS.vertices), "40 mm")):
        maps_on_template({}, brain, template, chain)


def test_maps_come_to_the_vertices_of_a_template():
    """A brain that is the template bent and turned, with other triangles; its maps are
    functions of the place, one of them of whole numbers."""
    points = np.moveaxis(np.indices((16, 16, 16)), 0, -1) * 4.0 - 30.0
    bend = 1.5 * np.sin(points[..., [1, 2, 0]] / 8.0)
    between = Deformation(rigid(0, 0, 25, shift=(5, 0, -3)), bend, GRID)
    template, other = sphere(subdivisions=3), sphere(subdivisions=5)
    brain = TriangleMesh(carry(between, other.vertices), other.faces)
    x, y, _ = brain.vertices.T
    maps = {"wave": np.sin(x / 4.0), "half": (y > 0).astype(float)}
    found = maps_on_template(maps, brain, template, [between])
    x, y, _ = carry(between, template.vertices).T
    assert found["wave"] == pytest.approx(np.sin(x / 4.0), abs=0.01)
    assert set(found["half"]) == {0, 1}
    clear = np.abs(y) > 0.5
    assert (found["half"] == (y > 0))[clear].all()
    assert found["template_distance_mm"].max() < 0.05


def test_a_week_without_a_shape_is_refused():
    shapes = WeeklyShapes(np.array([21.0, 22.5]), np.zeros((2, 4, 3)))
    assert [shapes.index(week) for week in (21.0, 22.5)] == [0, 1]
    with pytest.raises(InputError, check=Facts("22 GW", "21, 22.5 GW")):
        shapes.index(22.0)


@pytest.mark.parametrize("read", [read_correspondence, read_weekly_shapes])
def test_a_torn_file_is_refused(tmp_path, read):
    (tmp_path / "torn.h5").write_bytes(b"torn")
    with pytest.raises(InputError, check=Facts(tmp_path / "torn.h5")):
        read(tmp_path / "torn.h5")
