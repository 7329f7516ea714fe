"""Distances, cortical weight and normals; integration points of elements, and values at
nodes brought there."""

import itertools
import math
from types import SimpleNamespace

import numpy as np
import pytest
from ellipsoid import GAP_MM, RUN, brain_mesh
from shapes import box_mesh, ellipsoid_mesh

from gyriflow.folding.growth import GrowthByRates, StepStart
from gyriflow.folding.layers import PialSearch, cortical_weight
from gyriflow.folding.output import layer_fields
from gyriflow.folding.points import IntegrationPoints
from gyriflow.folding.tissue import interpolated_normals
from gyriflow.folding.zones import zones_of_run
from gyriflow.geometry.jacobians import NODES
from gyriflow.geometry.tetrahedra import boundary_faces
from gyriflow.settings.folding import parameters_from


def search_of(mesh):
    return PialSearch(mesh.vertices, boundary_faces(mesh)[0])


def test_weight_is_half_at_the_cortical_thickness_and_falls_from_one_to_zero():
    weight = cortical_weight(np.array([0.0, 1.5, 3.0, 1e6]), 1.5)
    np.testing.assert_allclose(
        weight,
        [1 / (1 + np.exp(-10)), 0.5, 1 / (1 + np.exp(10)), 0.0],
        rtol=1e-12,
        atol=1e-300,
    )


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
    for week, part in ((21.0, 0.0), (22.5, 0.75), (23.0, 1.0)):
        fields = layer_fields(mesh.vertices, zones, growth, {}, week, names)
        weight = cortical_weight(fields["distance_to_pial_mm"], 2.0 + part)
        np.testing.assert_allclose(fields["cortex_weight"], weight, rtol=1e-12)
        core_pa, cortex_pa = 200.0 + 200.0 * part, 300.0 + 600.0 * part
        np.testing.assert_allclose(
            fields["shear_modulus_pa"], core_pa + (cortex_pa - core_pa) * weight
        )
        rate = (1 + 2 * part) * 1e-7
        np.testing.assert_allclose(
            fields["tangential_growth_per_step"],
            rate * p.step_s * weight * zones.growing,
            atol=1e-15,
        )


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
    inverse = GrowthByRates(p, StepStart(np.empty((0, 3)), 2 * day, day)).inverse(
        tissue
    )
    # two days and a half after the start
    np.testing.assert_allclose(
        inverse[0, 0], np.diag([1 / (1 + 2.5 / 7 * 1e-6 * day)] * 2 + [1.0]), rtol=1e-12
    )


def test_distance_is_to_the_triangles_not_to_the_vertices_within_reach():
    # one coarse cell: the middle of a wall is far from every vertex
    search = search_of(box_mesh((1, 1, 1), (10.0, 10.0, 10.0)))
    points = np.array([[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, -3.0, 0.0]])
    np.testing.assert_allclose(search.distance(points), [5.0, 1.0, 2.0], atol=1e-12)
    assert search.distance(points[1:2], reach=1.5)[0] == pytest.approx(1.0)
    assert search.distance(points[:1], reach=1.0)[0] == pytest.approx(5 * np.sqrt(3))


def test_normals_on_a_ball_point_outwards_and_have_length_one():
    mesh = ellipsoid_mesh(8, (10.0, 10.0, 10.0))
    search = search_of(mesh)
    points = 9.0 * search.surface.vertices / 10.0
    normals = search.nearest_normals(points)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, rtol=1e-12)
    assert np.einsum("ij,ij->i", normals, points / 9.0).min() > 0.97


@pytest.mark.parametrize(("order", "degree"), [(1, 1), (2, 3)])
def test_polynomials_up_to_the_degree_are_integrated_exactly_by_positive_weights(
    order, degree
):
    points = IntegrationPoints.for_order(order)
    assert (points.weights > 0).all()
    for powers in itertools.product(range(degree + 1), repeat=4):
        if sum(powers) <= degree:
            # the mean of a product of barycentric coordinates
            exact = (
                6
                * math.prod(map(math.factorial, powers))
                / math.factorial(sum(powers) + 3)
            )
            assert points.weights @ (points.barycentric**powers).prod(
                axis=1
            ) == pytest.approx(exact, rel=1e-12)


def test_the_rules_of_both_orders_prefer_no_corner():
    for order in (1, 2):
        points = IntegrationPoints.for_order(order)
        known = {
            tuple(row)
            for row in np.column_stack([points.barycentric, points.weights]).round(9)
        }
        for change in itertools.permutations(range(4)):
            assert {(*[key[i] for i in change], key[4]) for key in known} == known


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


def test_normals_of_opposed_walls_do_not_cancel():
    points = IntegrationPoints.for_order(2)
    normals = np.tile([0.0, 0.6, 0.8], (1, 10, 1))
    normals[0, ::3] *= -1
    found = interpolated_normals(normals, points)
    np.testing.assert_allclose(np.abs(found @ [0.0, 0.6, 0.8]), 1.0)
    # and turn with the surface between the nodes
    angle = 0.3 * NODES[:, 1]
    turning = np.stack([np.sin(angle), np.zeros(10), np.cos(angle)], axis=1)
    found = interpolated_normals(turning[None], points)[0]
    np.testing.assert_allclose(
        np.arctan2(found[:, 0], found[:, 2]), 0.3 * points.barycentric[:, 1], atol=2e-3
    )
