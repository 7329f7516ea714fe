"""The plane of a medial wall: exact where hemispheres were cut apart, steady where the wall is bent."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from shapes import ellipsoid

from gyriflow.anatomy.outlines import CUT_ERROR_DEG, FITTED_ERROR_DEG, medial_wall
from gyriflow.geometry.triangles import TriangleMesh, vertex_areas, vertex_normals

START = np.array([-1.0, 0.0, 0.0])


def half_ellipsoid(bend):
    """Returns half an ellipsoid of about unit volume, its flat side at x = 0 and bent by `bend` in waves."""
    ball = ellipsoid((0.6, 1.0, 0.75), 5)
    points = ball.vertices.copy()
    wall = points[:, 0] < 0
    points[wall, 0] = bend * np.sin(3.0 * points[wall, 1]) * np.cos(4.0 * points[wall, 2])
    mesh = TriangleMesh(points, ball.faces)
    return points, vertex_normals(mesh), vertex_areas(mesh)


@pytest.mark.parametrize("tilt", [0.0, 10.0])
def test_a_cut_is_found_exactly(tilt):
    points, normals, areas = half_ellipsoid(0.0)
    turn = Rotation.from_rotvec(np.array([0.0, 0.6, 0.8]) * tilt, degrees=True).as_matrix()
    wall = medial_wall(points @ turn.T, normals @ turn.T, areas, START)
    assert np.degrees(np.arccos(wall.normal @ turn @ START)) < 0.05
    assert wall.offset == pytest.approx(0.0, abs=1e-3)
    assert wall.error_deg == CUT_ERROR_DEG


def test_a_bent_wall_is_no_cut_and_its_plane_is_that_of_all_of_it():
    wall = medial_wall(*half_ellipsoid(0.04), START)
    assert wall.error_deg == FITTED_ERROR_DEG
    assert np.degrees(np.arccos(-wall.normal[0])) < 2.0
