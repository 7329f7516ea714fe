"""Edges inside a mesh between two vertices of its surface are split."""

from itertools import combinations

import numpy as np
import pytest
from shapes import ellipsoid_mesh, inner_edges_of_the_surface

from gyriflow.geometry.tetrahedra import (
    TetrahedralMesh,
    boundary_faces,
    boundary_surface,
    grid,
    radius_ratios,
    signed_volumes,
)
from gyriflow.mesh.splitting import split_inner_edges


@pytest.mark.parametrize(
    "mesh",
    [
        # two layers: elements of four vertices of the surface, and of three or two
        grid([np.linspace(0, 4, 5), np.linspace(0, 4, 5), np.linspace(0, 2, 3)]),
        grid([np.linspace(0, 3, 4), np.linspace(0, 3, 4), np.linspace(0, 1, 2)]),
        ellipsoid_mesh(5, (9.0, 8.0, 7.0)),
    ],
    ids=["slab", "one layer", "ellipsoid"],
)
def test_no_inner_edge_joins_two_vertices_of_the_surface(mesh):
    # elements in an order without symmetry
    order = np.random.default_rng(1).permutation(len(mesh.tets))
    mesh = TetrahedralMesh(mesh.vertices, mesh.tets[order])
    between = inner_edges_of_the_surface(mesh)
    assert between
    split = split_inner_edges(mesh)
    assert not inner_edges_of_the_surface(split)
    # each edge has a vertex, the rest stays in its place
    count = len(mesh.vertices)
    np.testing.assert_array_equal(split.vertices[:count], mesh.vertices)
    assert len(split.vertices) == count + len(between)
    # the body and its surface are the same
    assert radius_ratios(split).min() > 0.25 * radius_ratios(mesh).min()
    assert (signed_volumes(split) > 0).all()
    assert signed_volumes(split).sum() == pytest.approx(signed_volumes(mesh).sum())
    before, after = boundary_surface(mesh)[0], boundary_surface(split)[0]
    assert len(before.faces) == len(after.faces)
    np.testing.assert_allclose(before.vertices, after.vertices)
    # elements without such an edge stay where they are
    before, after = np.sort(mesh.tets), np.sort(split.tets[: len(mesh.tets)])
    is_same = (before == after).all(axis=1)
    for corners, same in zip(before.tolist(), is_same, strict=True):
        assert same == between.isdisjoint(combinations(corners, 2))


def test_a_mesh_without_such_edges_stays_as_it_is():
    # a cube of 12 faces around a vertex in its middle
    cube = grid([np.array([-1.0, 1.0])] * 3)
    faces, _ = boundary_faces(cube)
    tets = np.column_stack([faces, np.full(len(faces), 8)])
    star = TetrahedralMesh(
        np.vstack([cube.vertices, np.zeros(3)]), tets[:, [0, 2, 1, 3]]
    )
    assert (signed_volumes(star) > 0).all()
    assert split_inner_edges(star) is star
