"""Integration points of elements, and values at nodes brought there."""

import itertools
import math

import numpy as np
import pytest

from gyriflow.folding.layers import normals_between
from gyriflow.folding.points import IntegrationPoints
from gyriflow.geometry.jacobians import NODES


@pytest.mark.parametrize(("order", "degree"), [(1, 1), (2, 2), (2, 3), (2, 4), (2, 5)])
def test_polynomials_up_to_the_degree_are_integrated_exactly_by_positive_weights(order, degree):
    points = IntegrationPoints.of_degree(order, degree)
    assert (points.weights > 0).all()
    for powers in itertools.product(range(degree + 1), repeat=4):
        if sum(powers) <= degree:
            # the mean of a product of barycentric coordinates
            exact = 6 * math.prod(map(math.factorial, powers)) / math.factorial(sum(powers) + 3)
            assert points.weights @ (points.places**powers).prod(axis=1) == pytest.approx(exact, rel=1e-12)


def test_the_rules_of_both_orders_prefer_no_corner():
    for order in (1, 2):
        points = IntegrationPoints.of_degree(order)
        known = {tuple(row) for row in np.column_stack([points.places, points.weights]).round(9)}
        for change in itertools.permutations(range(4)):
            assert {(*[key[i] for i in change], key[4]) for key in known} == known


def test_smooth_values_are_quadratic_and_bounded_ones_stay_between_the_nodes():
    points = IntegrationPoints.of_degree(2)
    square = lambda places: places[:, 0] ** 2 - places[:, 1] * places[:, 2]  # noqa: E731
    np.testing.assert_allclose(points.smooth @ square(NODES), square(points.places))
    assert (points.bounded >= 0).all()
    np.testing.assert_allclose(points.bounded.sum(axis=1), 1.0)
    np.testing.assert_allclose(points.bounded @ NODES, points.places, atol=1e-12)


def test_normals_of_opposed_walls_do_not_cancel():
    points = IntegrationPoints.of_degree(2)
    normals = np.tile([0.0, 0.6, 0.8], (1, 10, 1))
    normals[0, ::3] *= -1
    found = normals_between(normals, points.smooth, points.bounded)
    np.testing.assert_allclose(np.abs(found @ [0.0, 0.6, 0.8]), 1.0)
    # and turn with the surface between the nodes
    angle = 0.3 * NODES[:, 1]
    turning = np.stack([np.sin(angle), np.zeros(10), np.cos(angle)], axis=1)
    found = normals_between(turning[None], points.smooth, points.bounded)[0]
    np.testing.assert_allclose(np.arctan2(found[:, 0], found[:, 2]), 0.3 * points.places[:, 1], atol=2e-3)
