"""Distances between surfaces and thickness between them, rigid alignment, and integrals
over cells: on uneven triangles, away from the origin."""

import numpy as np
import pytest
from shapes import FAR, box, ellipsoid, rigid, sphere, uneven

from gyriflow.geometry.alignment import align, rigid_fit
from gyriflow.geometry.diffusion import (
    cell_sizes,
    integrals_at_vertices,
    smooth_integrals,
    vertex_sizes,
)
from gyriflow.geometry.matching import layer_thickness, surface_distance, surface_mask
from gyriflow.geometry.tetrahedra import grid
from gyriflow.geometry.triangles import (
    TriangleMesh,
    convex_hull,
    edge_lengths,
    edges,
    mean_edge_length,
    merged,
    signed_volume,
    transformed,
)

BALL = uneven(sphere(10.0, 4))


def test_a_distance_is_the_mean_of_both_ways_and_the_larger_of_both_quantiles():
    ways = [
        (np.array([4.0, 1.0, 9.0]), np.array([2.0, 6.0, 0.0])),
        (np.array([2.0, 3.0]), np.array([1.0, 3.0])),
    ]
    mean, quantile = surface_distance(ways)
    assert mean == pytest.approx((1.75 + 2.75) / 2)
    assert quantile == 4.0
    assert surface_distance(ways, 0.5)[1] == 3.0
    assert surface_distance(ways[::-1], 0.5)[1] == 3.0


def test_thickness_is_the_mean_of_the_way_in_and_the_way_back():
    # the inner ball lies off the middle, so that both ways differ
    centre = np.array([0.0, 0.0, 3.0])
    inner = sphere(4.0, 5, centre)
    found = layer_thickness(sphere(10.0, 5), inner)
    from_centre = sphere(10.0, 5).vertices - centre
    distance = np.linalg.norm(from_centre, axis=1)
    foot = centre + 4.0 * from_centre / distance[:, None]
    back = 10.0 - np.linalg.norm(foot, axis=1)
    assert found == pytest.approx(0.5 * (distance - 4.0 + back), abs=0.03)
    assert (distance - 4.0 - back).max() > 0.7


def test_a_surface_is_aligned_with_another_mesh_of_its_shape():
    axes = (10.0, 14.0, 7.0)
    onto = transformed(ellipsoid(axes, 4), FAR[0])
    motion = rigid(8.0, -5.0, 10.0, shift=(2.0, -3.0, 1.0))
    moved = ellipsoid(axes, 3)
    found = align(transformed(moved, FAR[0] @ motion), onto)
    expected = transformed(moved, FAR[0]).vertices
    assert found.vertices == pytest.approx(expected, abs=0.1)


def test_heavy_points_decide_on_a_rigid_fit():
    points = np.array([[0.0, 0, 0], [9, 0, 0], [0, 5, 0], [0, 0, 2], [50, 50, 50]])
    onto = transformed(TriangleMesh(points, [[0, 1, 2]]), FAR[1]).vertices.copy()
    onto[4] += 20.0
    weights = np.array([1.0, 2.0, 1.0, 3.0, 1e-9])
    assert rigid_fit(points, onto, weights) == pytest.approx(FAR[1], abs=1e-5)


@pytest.mark.parametrize("kind", ["triangles", "tetrahedra"])
def test_integrals_of_uneven_cells_add_up_and_are_smoothed_as_a_wave_is(kind):
    if kind == "triangles":
        points, cells, value = BALL.vertices, BALL.faces, 2.0 / 10.0**2
    else:
        axis = np.array([0.0, 1, 2, 3, 4, 5, 7, 9, 11, 13, 15, 18, 20])
        mesh = grid([axis, np.linspace(0, 2, 3), np.linspace(0, 3, 3)])
        points, cells, value = mesh.vertices, mesh.tets, (np.pi / 20) ** 2
    sizes = vertex_sizes(points, cells)
    assert sizes.sum() == pytest.approx(cell_sizes(points, cells).sum())
    # an eigenfunction of the Laplacian
    wave = (
        points[:, 2] / 10 if kind == "triangles" else np.cos(np.pi * points[:, 0] / 20)
    )
    of_cells = wave[cells].mean(axis=1)
    values = np.stack([of_cells, np.full(len(cells), 3.0)], axis=1)
    integrals = integrals_at_vertices(points, cells, values)
    assert integrals.sum(axis=0) == pytest.approx(cell_sizes(points, cells) @ values)
    assert integrals[:, 1] == pytest.approx(3.0 * sizes)
    smooth = smooth_integrals(points, cells, integrals, 4.0)
    assert smooth[:, 1] == pytest.approx(3.0, rel=1e-3)
    weighted = sizes * wave
    factor = weighted @ smooth[:, 0] / (weighted @ wave)
    assert factor == pytest.approx(1 / (1 + 4.0**2 / 2 * value), rel=0.04)


def test_a_hull_has_no_points_inside_and_looks_outwards():
    outer = transformed(box((4.0, 6.0, 9.0)), FAR[0])
    within = transformed(box((1.0, 1.0, 1.0)), FAR[0])
    hull = convex_hull(merged(within, outer))
    assert signed_volume(hull) == pytest.approx(4.0 * 6.0 * 9.0)
    assert len(hull.vertices) == 8


def test_lengths_of_edges_are_those_of_uneven_triangles():
    pairs, _ = edges(BALL)
    lengths = edge_lengths(BALL.vertices, pairs)
    low = BALL.vertices[pairs].mean(axis=1)[:, 2] < 0
    assert lengths[low].mean() > 1.5 * lengths[~low].mean()
    assert mean_edge_length(BALL) == pytest.approx(lengths.mean())


def test_a_mask_has_its_own_box_with_some_voxels_around_it():
    mesh = ellipsoid((8.0, 5.0, 3.0), 4, centre=(100.0, -70.0, 30.0))
    mask, affine = surface_mask(mesh, 0.5)
    assert mask.sum() * 0.5**3 == pytest.approx(signed_volume(mesh), rel=0.01)
    inside = np.argwhere(mask) * 0.5 + affine[:3, 3]
    assert inside.mean(axis=0) == pytest.approx([100.0, -70.0, 30.0], abs=0.01)
    filled = np.argwhere(mask)
    assert (filled.min(axis=0) >= 3).all()
    assert (filled.max(axis=0) < np.array(mask.shape) - 3).all()
