"""Tetrahedral meshes and their boundary; quadratic elements: their Jacobian's bounds,
volumes, and finer surfaces."""

import numpy as np
import pytest
from shapes import box_mesh

from gyriflow.geometry.jacobians import (
    NODES,
    jacobians,
    lower_bounds,
    shape_slopes,
    shape_values,
)
from gyriflow.geometry.tetrahedra import (
    TetrahedralMesh,
    boundary_faces,
    boundary_surface,
    connected_parts,
    finer_surface,
    linear_pieces,
    quadratic,
    signed_volumes,
    whole_faces,
)
from gyriflow.geometry.triangles import (
    TriangleMesh,
    area,
    euler_number,
    is_closed,
    signed_volume,
)

RNG = np.random.default_rng(7)


@pytest.mark.parametrize("order", [1, 2])
def test_boundary_of_a_box_is_its_surface_outward(order):
    mesh = box_mesh((2, 3, 4), (2.0, 3.0, 4.0))
    mesh = quadratic(mesh) if order == 2 else mesh
    surface, used = boundary_surface(mesh)
    assert area(surface) == pytest.approx(52.0)
    assert signed_volume(surface) == pytest.approx(24.0)
    assert is_closed(surface)
    assert euler_number(surface) == 2
    np.testing.assert_array_equal(mesh.vertices[used], surface.vertices)


def test_a_straight_quadratic_mesh_is_the_linear_one():
    mesh = box_mesh((2, 3, 2), (2.0, 3.0, 1.0))
    straight = quadratic(mesh)
    assert (straight.order, mesh.order) == (2, 1)
    np.testing.assert_array_equal(straight.corners, mesh.tets)
    np.testing.assert_allclose(signed_volumes(straight), signed_volumes(mesh))
    np.testing.assert_allclose(
        lower_bounds(straight.vertices, straight.tets), 6 * signed_volumes(mesh)
    )
    assert connected_parts(straight).max() == 0


def test_faces_of_quadratic_elements_are_four_outward_triangles_each():
    mesh = box_mesh((2, 3, 2), (2.0, 3.0, 1.0))
    triangles, elements = boundary_faces(quadratic(mesh))
    faces, of_faces = boundary_faces(mesh)
    np.testing.assert_array_equal(whole_faces(triangles, 2), faces)
    np.testing.assert_array_equal(elements, np.repeat(of_faces, 4))


def test_a_quadratic_mesh_is_filled_by_eight_linear_pieces_of_each_element():
    mesh = box_mesh((2, 2, 1), (2.0, 3.0, 1.0))
    fine = quadratic(mesh)
    pieces = TetrahedralMesh(fine.vertices, linear_pieces(fine))
    volumes = signed_volumes(pieces).reshape(-1, 8)
    np.testing.assert_allclose(
        volumes, np.repeat(signed_volumes(mesh)[:, None] / 8, 8, axis=1)
    )
    # neighbours meet: the boundary is that of the quadratic elements
    assert len(boundary_faces(pieces)[0]) == len(boundary_faces(fine)[0])
    assert linear_pieces(mesh) is mesh.tets


def test_shape_functions_are_one_at_their_node_and_reproduce_quadratic_functions():
    np.testing.assert_allclose(shape_values(NODES), np.eye(10), atol=1e-15)
    places = RNG.dirichlet(np.ones(4), 20)
    value = lambda p: p[:, 1] ** 2 - 2 * p[:, 2] * p[:, 3] + p[:, 1]  # noqa: E731
    np.testing.assert_allclose(
        shape_values(places) @ value(NODES), value(places), atol=1e-14
    )
    slope = np.stack(
        [2 * places[:, 1] + 1, -2 * places[:, 3], -2 * places[:, 2]], axis=1
    )
    np.testing.assert_allclose(
        np.einsum("pni,n->pi", shape_slopes(places), value(NODES)), slope, atol=1e-14
    )


@pytest.mark.parametrize("by", [0.05, 0.1, 0.15])
def test_bounds_are_below_the_jacobian_and_close_where_they_must_be(by):
    mesh = quadratic(box_mesh((2, 2, 2), (2.0, 3.0, 1.0)))
    mesh = TetrahedralMesh(
        mesh.vertices + RNG.uniform(-by, by, mesh.vertices.shape), mesh.tets
    )
    places = np.concatenate([RNG.dirichlet([0.4] * 4, 4000), NODES])
    least = jacobians(mesh.vertices, mesh.tets, shape_slopes(places)).min(axis=1)
    bounds = lower_bounds(mesh.vertices, mesh.tets)
    assert (bounds <= least + 1e-12).all()
    # no element that is clearly sound is called unsound
    sound = least > 0.1 * 6 * np.abs(signed_volumes(mesh))
    assert sound.any()
    assert (bounds[sound] > 0).all()


def test_an_element_that_folds_over_at_a_corner_only_is_seen():
    mesh = TetrahedralMesh(np.vstack([np.zeros(3), np.eye(3)]), [[0, 1, 2, 3]])
    curved = quadratic(mesh)
    for part, sound in ((0.24, True), (0.26, False)):
        vertices = curved.vertices.copy()
        # along its edge: det = 1 + 4 part (λ0 − λ1)
        vertices[curved.tets[0, 4]] += [part, 0.0, 0.0]
        assert (lower_bounds(vertices, curved.tets)[0] > 0) == sound
        assert (
            jacobians(vertices, curved.tets, shape_slopes(np.full((1, 4), 0.25)))[0, 0]
            > 0.5
        )


def test_the_volume_of_curved_elements_is_exact():
    # x → (x, y, z + a x y): volumes stay, and quadratic elements follow the map exactly
    mesh = quadratic(box_mesh((2, 2, 2), (2.0, 2.0, 2.0)))
    x, y, z = mesh.vertices.T
    bent = TetrahedralMesh(
        np.column_stack([x, y, z + 0.3 * x * y + 0.2 * x**2]), mesh.tets
    )
    np.testing.assert_allclose(signed_volumes(bent), signed_volumes(mesh), rtol=1e-12)


def test_a_finer_surface_follows_the_nodes():
    mesh = quadratic(box_mesh((2, 2, 2), (2.0, 2.0, 2.0)))
    triangles, _ = boundary_faces(mesh)
    used, local = np.unique(triangles, return_inverse=True)
    weights, faces = finer_surface(local.reshape(-1, 3))
    assert len(faces) == 4 * len(triangles)
    np.testing.assert_array_equal(weights[: len(used)].toarray(), np.eye(len(used)))
    points = mesh.vertices[used]
    surface = TriangleMesh(weights @ points, faces)
    assert is_closed(surface)
    assert euler_number(surface) == 2
    assert signed_volume(surface) == pytest.approx(8.0)
    bend = lambda x: x + 0.2 * x**2 - 0.1 * x[:, [1, 2, 0]] * x  # noqa: E731
    np.testing.assert_allclose(
        weights @ bend(points), bend(surface.vertices), atol=1e-14
    )
