"""Simple shapes through the surface stage: nothing is moved, left and right meet at x =
0."""

import numpy as np
import pytest
from facts import Facts

from gyriflow.anatomy.pial import from_shape
from gyriflow.anatomy.shapes import shape_surface
from gyriflow.errors import InputError, MeshError
from gyriflow.geometry.triangles import (
    TriangleMesh,
    area,
    corners,
    edges,
    euler_number,
    face_normals,
    is_closed,
    signed_volume,
    submesh,
    unit,
)

AXES = (10.0, 13.0, 8.0)


def test_an_ellipsoid_has_the_analytic_size_and_even_triangles_that_look_outwards():
    volume = 4 / 3 * np.pi * np.prod(AXES)
    coarse, mesh = (
        shape_surface(AXES, edge_length_mm=edge_mm, noise_mm=0.0)
        for edge_mm in (2.0, 1.0)
    )
    assert is_closed(mesh)
    assert euler_number(mesh) == 2
    assert signed_volume(mesh) == pytest.approx(volume, rel=0.01)
    missing = [1 - signed_volume(each) / volume for each in (coarse, mesh)]
    assert missing[0] / missing[1] == pytest.approx(4.0, rel=0.25)
    lengths = np.linalg.norm(np.diff(mesh.vertices[edges(mesh)[0]], axis=1), axis=-1)
    assert lengths.mean() == pytest.approx(1.0, rel=0.1)
    assert 0.2 < lengths.min() < lengths.max() < 2.2
    assert np.linalg.norm(mesh.vertices / AXES, axis=1) == pytest.approx(1.0, abs=1e-12)
    normals = unit(corners(mesh).mean(axis=1) / np.square(AXES))
    assert np.einsum("ij,ij->i", normals, face_normals(mesh)).min() > 0.9


def test_bumps_have_the_given_height_and_one_pattern_at_any_edge_length():
    def heights(edge_mm):
        mesh = shape_surface((40.0, 40.0, 40.0), edge_length_mm=edge_mm, noise_mm=0.2)
        return np.linalg.norm(mesh.vertices, axis=1) - 40.0, unit(mesh.vertices)

    fine, directions = heights(3.0)
    assert np.sqrt((fine**2).mean()) == pytest.approx(0.2, rel=0.3)
    assert np.array_equal(fine, heights(3.0)[0])
    coarse, coarse_directions = heights(4.0)
    nearest = (directions @ coarse_directions.T).argmax(axis=1)
    assert np.corrcoef(fine, coarse[nearest])[0, 1] > 0.8


def test_edges_too_long_for_the_shape_are_refused_with_the_bound():
    with pytest.raises(InputError, check=Facts("2.5 mm", "2.46 mm")):
        shape_surface(AXES, edge_length_mm=2.5)


def test_a_shape_is_left_as_it_is_and_cut_at_x_0():
    shape = shape_surface((10.0, 8.0, 9.0), edge_length_mm=1.0, noise_mm=0.05)
    surface = from_shape(shape, week=21.0)
    assert np.array_equal(surface.whole.vertices, shape.vertices)
    assert np.array_equal(surface.pose.world, np.eye(4))
    assert surface.fissure_x_mm == 0.0
    expected = {"source": "shape", "week": 21.0, "fissure_x_mm": 0.0, "warnings": []}
    assert {name: surface.report[name] for name in expected} == expected
    left, right = (
        corners(side)[:, :, 0].mean(axis=1) for side in (surface.left, surface.right)
    )
    assert left.max() < 0 < right.min()
    assert area(surface.left) + area(surface.right) == pytest.approx(area(shape))


def test_a_shape_that_is_not_closed_or_cuts_itself_is_refused():
    mesh = shape_surface((15.0, 15.0, 15.0), edge_length_mm=1.5, noise_mm=0.0)
    holed, _ = submesh(mesh, np.arange(len(mesh.faces)) > 0)
    with pytest.raises(MeshError, check=Facts("[1]", 2)):
        from_shape(holed, week=21.0)
    vertices = mesh.vertices.copy()
    vertices[0] *= -1.2
    with pytest.raises(MeshError, check=Facts(8, 2)):
        from_shape(TriangleMesh(vertices, mesh.faces), week=21.0)
