"""Contraction of surfaces to fewer vertices in the same topology."""

import numpy as np
import pytest
import shapes
from numpy.testing import assert_array_equal

from gyriflow.geometry.contraction import contract
from gyriflow.geometry.matching import nearest_on
from gyriflow.geometry.triangles import (
    TriangleMesh,
    area,
    euler_number,
    face_components,
    is_closed,
    mean_edge_length,
    merged,
    signed_volume,
)

VOXEL_MM = 0.4


def block_with_slit():
    """Return the surface of a block of 16 x 16 x 12 mm, with a slit of one voxel, 8 mm
    deep."""
    mask = np.zeros((50, 50, 40), dtype=bool)
    mask[5:45, 5:45, 5:35] = True
    mask[24, 5:45, 15:35] = False
    return shapes.mask_surface(mask, np.diag([VOXEL_MM] * 3 + [1.0]))


@pytest.mark.parametrize(
    ("mesh", "euler", "tolerance"),
    [
        (shapes.sphere(10.0, 6), 2, 0.01),
        (shapes.torus(12.0, 4.0, 240, 90), 0, 0.015),
        (block_with_slit(), 2, 0.03),
        (
            merged(shapes.sphere(6.0, 5), shapes.moved(shapes.sphere(6.0, 5), 12.4)),
            4,
            0.02,
        ),
    ],
    ids=["sphere", "torus", "slit", "two spheres"],
)
def test_fewer_vertices_have_the_same_topology_area_and_volume(mesh, euler, tolerance):
    few = contract(mesh, 1.0)
    assert len(few.vertices) < len(mesh.vertices) / 2
    assert is_closed(few)
    assert euler_number(few) == euler
    assert face_components(few).max() == face_components(mesh).max()
    assert area(few) == pytest.approx(area(mesh), rel=tolerance)
    assert signed_volume(few) == pytest.approx(signed_volume(mesh), rel=tolerance)
    assert nearest_on(few.vertices, mesh)[0].max() < 0.3


def test_edges_are_about_as_long_as_patches():
    ball = shapes.sphere(10.0, 6)
    for size_mm in (0.8, 1.2, 1.6):
        edge_mm = mean_edge_length(contract(ball, size_mm))
        assert edge_mm == pytest.approx(size_mm, rel=0.2)


def test_patches_of_a_coarse_surface_are_its_vertices():
    ball = shapes.sphere(10.0, 3)
    same = contract(ball, 0.1)
    assert_array_equal(same.faces, ball.faces)
    assert same.vertices == pytest.approx(ball.vertices)


def test_patches_larger_than_the_surface_leave_it_closed():
    few = contract(shapes.sphere(1.0, 4), 50.0)
    assert is_closed(few)
    assert euler_number(few) == 2
    assert signed_volume(few) > 0.0


def test_a_piece_as_thin_and_small_as_a_patch_stays():
    ball = shapes.sphere(0.3, 2)
    lens = TriangleMesh(ball.vertices * [1.0, 1.0, 0.05], ball.faces)
    few = contract(merged(shapes.sphere(10.0, 5), shapes.moved(lens, 20.0)), 2.0)
    assert is_closed(few)
    assert euler_number(few) == 4
    assert face_components(few).max() == 1


def test_a_surface_that_lies_elsewhere_has_as_many_patches():
    ball = shapes.sphere(10.0, 5)
    far = TriangleMesh(ball.vertices + [1234.0, -500.0, 77.0], ball.faces)
    assert_array_equal(contract(far, 1.5).faces, contract(ball, 1.5).faces)
