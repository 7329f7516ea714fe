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
)
from gyriflow.geometry.tetrahedra import (
    TetrahedralMesh,
    boundary_faces,
    boundary_surface,
    finer_surface,
    quadratic,
    signed_volumes,
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


@pytest.mark.parametrize(("part", "is_sound"), [(0.24, True), (0.26, False)])
def test_an_element_that_folds_over_at_a_corner_only_is_seen(part, is_sound):
    corners = np.vstack([np.zeros(3), np.eye(3)])
    curved = quadratic(TetrahedralMesh(corners, [[0, 1, 2, 3]]))
    vertices = curved.vertices.copy()
    # along its edge: det = 1 + 4 part (λ0 − λ1)
    vertices[curved.tets[0, 4]] += [part, 0.0, 0.0]
    assert (lower_bounds(vertices, curved.tets)[0] > 0) == is_sound
    middle = shape_slopes(np.full((1, 4), 0.25))
    assert jacobians(vertices, curved.tets, middle)[0, 0] > 0.5


def test_the_volume_of_curved_elements_is_exact():
    # x → (x, y, z + a x y): volumes stay, and quadratic elements follow the map exactly
    mesh = quadratic(box_mesh((2, 2, 2), (2.0, 2.0, 2.0)))
    x, y, z = mesh.vertices.T
    bent = TetrahedralMesh(
        np.column_stack([x, y, z + 0.3 * x * y + 0.2 * x**2]), mesh.tets
    )
    np.testing.assert_allclose(signed_volumes(bent), signed_volumes(mesh), rtol=1e-12)


def test_a_finer_surface_is_closed_and_follows_the_nodes():
    mesh = quadratic(box_mesh((2, 2, 2), (2.0, 2.0, 2.0)))
    used, triangles = np.unique(boundary_faces(mesh)[0], return_inverse=True)
    weights, faces = finer_surface(triangles.reshape(-1, 3))
    nodes = mesh.vertices[used]
    surface = TriangleMesh(weights @ nodes, faces)
    assert is_closed(surface)
    assert euler_number(surface) == 2
    np.testing.assert_array_equal(surface.vertices[: len(used)], nodes)

    def bent(points):
        return points + 0.2 * points**2 - 0.1 * points[:, [1, 2, 0]] * points

    np.testing.assert_allclose(
        weights @ bent(nodes), bent(surface.vertices), atol=1e-14
    )
