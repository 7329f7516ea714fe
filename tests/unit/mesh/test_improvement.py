"""Inner vertices of poor elements go where they are better, and nothing else changes."""

import numpy as np
import pytest
from shapes import box_mesh

from gyriflow.geometry.tetrahedra import TetrahedralMesh, boundary_surface, signed_volumes
from gyriflow.mesh.nodes import improve
from gyriflow.mesh.quality import radius_ratios

BOX = box_mesh((4, 4, 4), (4.0, 4.0, 4.0))
CENTRE = int(np.argmin(np.linalg.norm(BOX.vertices, axis=1)))


def test_a_vertex_that_flattens_its_elements_is_moved():
    vertices = BOX.vertices.copy()
    vertices[CENTRE] = [0.6, -0.3, 0.2]
    poor = TetrahedralMesh(vertices, BOX.tets)
    assert 0 < radius_ratios(poor).min() < 0.03
    good = improve(poor)
    assert radius_ratios(good).min() > 0.3
    assert (signed_volumes(good) > 0).all()
    np.testing.assert_array_equal(good.tets, BOX.tets)


def test_the_surface_and_good_elements_stay_where_they_are():
    np.testing.assert_array_equal(improve(BOX).vertices, BOX.vertices)
    noise = np.random.default_rng(0).uniform(-0.3, 0.3, BOX.vertices.shape)
    rough = TetrahedralMesh(BOX.vertices + noise, BOX.tets)
    assert (signed_volumes(rough) > 0).all()
    better = improve(rough)
    surface, used = boundary_surface(rough)
    np.testing.assert_array_equal(better.vertices[used], surface.vertices)
    assert signed_volumes(better).sum() == pytest.approx(signed_volumes(rough).sum())
    assert radius_ratios(better).min() >= radius_ratios(rough).min()
    assert (radius_ratios(better) < 0.2).sum() < (radius_ratios(rough) < 0.2).sum()


def test_a_mesh_without_inner_vertices_stays():
    flat = TetrahedralMesh([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0.3, 0.3, 1e-2]], [[0, 1, 2, 3]])
    np.testing.assert_array_equal(improve(flat).vertices, flat.vertices)
