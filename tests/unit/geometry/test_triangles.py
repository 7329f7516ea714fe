"""Triangle surfaces against shapes whose measures are known."""

import numpy as np
import pytest
import shapes

from gyriflow.geometry.triangles import (
    TriangleMesh,
    area,
    edges,
    face_components,
    flipped,
    is_closed,
    mean_edge_length,
    merged,
    signed_volume,
    submesh,
    transformed,
    vertex_areas,
    vertex_normals,
)


@pytest.fixture(scope="module")
def box():
    return shapes.box((2.0, 3.0, 4.0))


@pytest.fixture(scope="module")
def ball():
    return shapes.sphere(5.0)


def test_measures_of_a_ball_near_those_of_the_sphere(ball):
    assert area(ball) == pytest.approx(100 * np.pi, rel=0.01)
    assert signed_volume(ball) == pytest.approx(500 / 3 * np.pi, rel=0.01)
    assert vertex_areas(ball).sum() == pytest.approx(area(ball))
    np.testing.assert_allclose(vertex_normals(ball), ball.vertices / 5.0, atol=0.01)


def test_edges_count_their_faces(box):
    pairs, faces = edges(box)
    assert len(pairs) == 18
    assert (faces == 2).all()
    assert mean_edge_length(
        TriangleMesh([[0, 0, 0], [3, 0, 0], [0, 4, 0]], [[0, 1, 2]])
    ) == pytest.approx(4.0)


def test_open_or_inconsistent_surfaces_are_not_closed(box):
    faces = box.faces.copy()
    assert not is_closed(TriangleMesh(box.vertices, faces[1:]))
    faces[0] = faces[0, ::-1]
    assert not is_closed(TriangleMesh(box.vertices, faces))


def test_components_are_numbered_by_area(ball, box):
    both = merged(box, ball)
    component = face_components(both)
    assert (component[: len(box.faces)] == 1).all()
    assert (component[len(box.faces) :] == 0).all()
    largest, used = submesh(both, component == 0)
    assert area(largest) == pytest.approx(area(ball))
    np.testing.assert_array_equal(both.vertices[used], largest.vertices)


def test_a_mirroring_motion_keeps_the_surface_outward(box):
    mirror = np.diag([-1.0, 1.0, 1.0, 1.0])
    assert signed_volume(transformed(box, mirror)) == pytest.approx(24.0)
    assert signed_volume(flipped(box)) == pytest.approx(-24.0)
    shifted = transformed(box, [[1, 0, 0, 5], [0, 1, 0, 6], [0, 0, 1, 7], [0, 0, 0, 1]])
    np.testing.assert_allclose(
        shifted.vertices.mean(axis=0) - box.vertices.mean(axis=0), [5, 6, 7]
    )
