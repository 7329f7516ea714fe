"""Tetrahedral meshes and their boundary."""

import numpy as np
import pytest
from shapes import box_mesh

from gyriflow.geometry.tetrahedra import (
    TetrahedralMesh,
    boundary_faces,
    boundary_surface,
    grid,
    linear_pieces,
    quadratic,
    signed_volumes,
)
from gyriflow.geometry.triangles import area, euler_number, is_closed, signed_volume


def test_boundary_of_a_box_is_its_surface_outward():
    mesh = box_mesh((2, 3, 4), (2.0, 3.0, 4.0))
    surface, used = boundary_surface(mesh)
    assert area(surface) == pytest.approx(52.0)
    assert signed_volume(surface) == pytest.approx(24.0)
    assert is_closed(surface)
    assert euler_number(surface) == 2
    np.testing.assert_array_equal(mesh.vertices[used], surface.vertices)


def test_a_quadratic_mesh_is_filled_by_eight_linear_pieces_of_each_element():
    mesh = grid([np.linspace(0, 2, 3), np.linspace(0, 3, 3), np.linspace(0, 1, 2)])
    fine = quadratic(mesh)
    pieces = TetrahedralMesh(fine.vertices, linear_pieces(fine))
    volumes = signed_volumes(pieces).reshape(-1, 8)
    np.testing.assert_allclose(volumes, np.repeat(signed_volumes(mesh)[:, None] / 8, 8, axis=1))
    # neighbours meet: the boundary is that of the quadratic elements
    assert len(boundary_faces(pieces)[0]) == len(boundary_faces(fine)[0])
    assert linear_pieces(mesh) is mesh.tets
