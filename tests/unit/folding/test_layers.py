"""Distances, cortical weight and normals; integration points of elements, and values at
nodes brought there."""

import itertools
import math
from types import SimpleNamespace

import numpy as np
import pytest
from ellipsoid import GAP_MM, RUN, brain_mesh
from scipy.spatial import cKDTree
from shapes import box_mesh, uneven_surface

from gyriflow.folding.growth import GrowthByRates, StepStart
from gyriflow.folding.layers import PialSearch, cortical_weight
from gyriflow.folding.nearest_faces import FaceTree
from gyriflow.folding.output import layer_fields
from gyriflow.folding.points import IntegrationPoints
from gyriflow.folding.tissue import Elements, Layers, Tissue
from gyriflow.folding.zones import zones_of_run
from gyriflow.geometry.jacobians import NODES
from gyriflow.geometry.matching import nearest_on
from gyriflow.geometry.tetrahedra import boundary_faces
from gyriflow.geometry.triangles import TriangleMesh
from gyriflow.settings.folding import parameters_from


def search_of(mesh):
    return PialSearch(mesh.vertices, boundary_faces(mesh)[0])


@pytest.mark.parametrize("n_faces", [1, 8, 9, None])
def test_the_tree_of_faces_finds_the_distances_of_an_exhaustive_search(n_faces):
    whole = uneven_surface()
    faces = whole.faces[:n_faces]
    # a face without area, and points on, in and far from the surface
    flat = [faces[0, 0], faces[0, 1], faces[0, 1]]
    surface = TriangleMesh(whole.vertices, np.vstack([flat, faces]))
    rng = np.random.default_rng(3)
    around = rng.uniform(-80, 80, (500, 3))
    centres = whole.vertices[faces].mean(axis=1)
    points = np.concatenate([around, whole.vertices, centres, 0.9 * centres])
    expected, _, _ = nearest_on(points, TriangleMesh(whole.vertices, faces))
    tree = FaceTree(surface)
    distance, nearest = tree.nearest(points)
    np.testing.assert_allclose(distance, expected, atol=1e-12)
    used = np.unique(surface.faces)
    _, found = cKDTree(whole.vertices[used]).query(points)
    np.testing.assert_array_equal(nearest, used[found])


def test_the_layers_of_a_week_have_its_thickness_stiffness_and_growth():
    mesh = brain_mesh(8)
    by_week = {
        "thickness_mm": {"weeks": {21: 2.0, 23: 3.0}},
        "shear_modulus_cortex_pa": {"weeks": {21: 300.0, 23: 900.0}},
        "shear_modulus_core_pa": {"weeks": {21: 200.0, 23: 400.0}},
        "growth_rate_per_s": {"weeks": {21: 1e-7, 23: 3e-7}},
    }
    p = parameters_from(RUN | by_week)
    zones = zones_of_run(mesh, p, GAP_MM)
    growth = GrowthByRates(p, StepStart(mesh.vertices, 0.0, p.step_s))
    names = ["distance", "cortex_weight", "shear_modulus", "growth"]
    fields = layer_fields(mesh.vertices, zones, growth, {}, 22.5, names)
    weight = cortical_weight(fields["distance_to_pial_mm"], 2.75)
    np.testing.assert_allclose(fields["cortex_weight"], weight, rtol=1e-12)
    np.testing.assert_allclose(fields["shear_modulus_pa"], 350.0 + 400.0 * weight)
    expected = 2.5e-7 * p.step_s * weight * zones.growing
    found = fields["tangential_growth_per_step"]
    np.testing.assert_allclose(found, expected, atol=1e-15)


def test_rates_that_change_with_the_weeks_are_those_of_the_middle_of_a_step():
    day = 86_400.0
    p = parameters_from(RUN | {"growth_rate_per_s": {"weeks": {21.0: 0.0, 22.0: 1e-6}}})
    one = np.ones(1)
    tissue = SimpleNamespace(
        weight=one,
        growing=one,
        maps={},
        at_points=lambda values: values[None],
        normals=lambda wanted: (wanted, np.array([[[0.0, 0.0, 1.0]]])),
    )
    start = StepStart(np.empty((0, 3)), 2 * day, day)
    inverse = GrowthByRates(p, start).inverse(tissue)
    # two days and a half after the start
    tangential = 1 / (1 + 2.5 / 7 * 1e-6 * day)
    expected = np.diag([tangential, tangential, 1.0])
    np.testing.assert_allclose(inverse[0, 0], expected, rtol=1e-12)


def test_distance_is_to_the_triangles_not_to_the_vertices():
    # one coarse cell: the middle of a wall is far from every vertex
    search = search_of(box_mesh((1, 1, 1), (10.0, 10.0, 10.0)))
    points = np.array([[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, -3.0, 0.0]])
    distance, nearest = search.nearest(points)
    np.testing.assert_allclose(distance, [5.0, 1.0, 2.0], atol=1e-12)
    # of equally near vertices the first, whatever the order of the points
    _, reversed_nearest = search.nearest(points[::-1])
    np.testing.assert_array_equal(reversed_nearest[::-1], nearest)
    gaps = np.linalg.norm(points[:, None] - search.surface.vertices, axis=2)
    np.testing.assert_array_equal(nearest, gaps.argmin(axis=1))


@pytest.mark.parametrize(("order", "degree"), [(1, 1), (2, 3)])
def test_polynomials_up_to_the_degree_are_integrated_exactly_by_positive_weights(
    order, degree
):
    points = IntegrationPoints.for_order(order)
    assert (points.weights > 0).all()
    for powers in itertools.product(range(degree + 1), repeat=4):
        if sum(powers) <= degree:
            # the mean of a product of barycentric coordinates
            product = math.prod(map(math.factorial, powers))
            exact = 6 * product / math.factorial(sum(powers) + 3)
            found = points.weights @ (points.barycentric**powers).prod(axis=1)
            assert found == pytest.approx(exact, rel=1e-12)


def test_smooth_values_are_quadratic_and_bounded_ones_stay_between_the_nodes():
    points = IntegrationPoints.for_order(2)
    square = lambda places: places[:, 0] ** 2 - places[:, 1] * places[:, 2]  # noqa: E731
    np.testing.assert_allclose(
        points.interpolation @ square(NODES), square(points.barycentric)
    )
    assert (points.piecewise_linear >= 0).all()
    np.testing.assert_allclose(points.piecewise_linear.sum(axis=1), 1.0)
    np.testing.assert_allclose(
        points.piecewise_linear @ NODES, points.barycentric, atol=1e-12
    )


def normals_at_points(normals, points):
    """Return the normals (q, 3) at the points of an element from those (10, 3) at its
    nodes."""
    nodes = np.arange(10)
    elements = Elements(nodes[None], nodes, points)
    layers = Layers(pial=None, depth=None, nearest=normals, weight=None)
    tissue = Tissue(elements, NODES, np.ones(10), {}, lambda: layers)
    _, found = tissue.normals(np.ones((1, len(points.weights)), dtype=bool))
    return found[0]


def test_normals_of_opposed_walls_do_not_cancel():
    points = IntegrationPoints.for_order(2)
    normals = np.tile([0.0, 0.6, 0.8], (10, 1))
    normals[::3] *= -1
    found = normals_at_points(normals, points)
    np.testing.assert_allclose(np.abs(found @ [0.0, 0.6, 0.8]), 1.0)
    # and turn with the surface between the nodes
    angle = 0.3 * NODES[:, 1]
    turning = np.stack([np.sin(angle), np.zeros(10), np.cos(angle)], axis=1)
    x, _, z = normals_at_points(turning, points).T
    expected = 0.3 * points.barycentric[:, 1]
    np.testing.assert_allclose(np.arctan2(x, z), expected, atol=2e-3)
