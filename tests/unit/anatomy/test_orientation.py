"""The mid-sagittal plane and the fissure: found on shifted, turned, sheared and asymmetric brains."""

import numpy as np
import pytest
from phantoms import CENTRE_MM
from shapes import cerebrum_surface, ellipsoid, phantom, rigid

from gyriflow.anatomy.fissure import mid_plane, upright
from gyriflow.geometry.remeshing import remesh
from gyriflow.geometry.triangles import TriangleMesh, transformed


@pytest.fixture(scope="module")
def brain():
    mesh = cerebrum_surface(*phantom())
    # the phantom's own centre to the origin: its fissure is x = 0 there
    return TriangleMesh(mesh.vertices - CENTRE_MM, mesh.faces)


def angle_to(plane, normal):
    return np.degrees(np.arccos(np.clip(plane.normal @ normal / np.linalg.norm(normal), -1, 1)))


@pytest.mark.parametrize("turn", [(0, 0, 45), (30, 20, -30), (90, 0, 0)])
def test_turned_and_shifted_brain(brain, turn):
    matrix = rigid(*turn, shift=(31.0, -4.0, 9.0))
    plane = mid_plane(transformed(brain, matrix))
    assert angle_to(plane, matrix[:3, 0]) < 1.0
    # the origin of the unmoved brain lies in its fissure
    assert plane.offset - plane.normal @ matrix[:3, 3] == pytest.approx(0.0, abs=0.4)
    assert plane.fissure_points > 500


@pytest.mark.parametrize("shear", [(0.0, 0.15), (-0.1, 0.1)])
def test_sheared_brain_where_symmetry_and_fissure_differ(brain, shear):
    matrix = np.eye(4)
    matrix[0, 1:3] = shear
    plane = mid_plane(transformed(brain, matrix))
    assert angle_to(plane, np.array([1.0, *(-s for s in shear)])) < 1.5
    assert plane.offset == pytest.approx(0.0, abs=0.4)


@pytest.mark.parametrize("stretch", [1.1, 1.25])
def test_brain_with_a_larger_right_hemisphere(brain, stretch):
    vertices = brain.vertices.copy()
    vertices[vertices[:, 0] > 0, 0] *= stretch
    mesh = TriangleMesh(vertices, brain.faces)
    middle_of_box = 0.5 * (vertices[:, 0].min() + vertices[:, 0].max())
    plane = mid_plane(mesh)
    assert abs(middle_of_box) > 1.0
    assert angle_to(plane, np.array([1.0, 0, 0])) < 1.0
    assert plane.offset == pytest.approx(0.0, abs=0.5)


def test_upright_turns_the_plane_to_constant_x_and_little_else(brain):
    rotation = rigid(0, 15, -25)
    mesh = transformed(brain, rotation)
    centre = mesh.vertices.mean(axis=0)
    plane = mid_plane(mesh)
    matrix, angle = upright(plane, centre)
    assert matrix[:3, :3] @ plane.normal == pytest.approx([1, 0, 0], abs=1e-9)
    assert angle == pytest.approx(np.degrees(np.arccos(rotation[0, 0])), abs=1.0)
    assert matrix[:3, :3] @ centre + matrix[:3, 3] == pytest.approx(centre, abs=1e-9)
    # anterior and superior keep their sense
    assert (matrix @ rotation)[1, 1] > 0.9
    assert (matrix @ rotation)[2, 2] > 0.9


def test_tiny_tilt_is_left_alone(brain):
    matrix, angle = upright(mid_plane(transformed(brain, rigid(0, 0, 0.2))), np.zeros(3))
    assert angle == 0.0
    assert np.array_equal(matrix, np.eye(4))


def test_named_coordinates_are_kept_by_a_body_with_many_mirror_planes(brain):
    # bodies of revolution about z and, of coarse and uneven triangles, about y
    for body in (ellipsoid((24.0, 24.0, 33.0)), remesh(ellipsoid((30.0, 36.0, 30.0)), 2.5)):
        assert angle_to(mid_plane(body, named=True), np.array([1.0, 0, 0])) == pytest.approx(0.0, abs=1e-6)
    # a brain has one plane, in whatever coordinates
    rotation = rigid(0, 15, -25)
    assert angle_to(mid_plane(transformed(brain, rotation), named=True), rotation[:3, 0]) < 1.0
