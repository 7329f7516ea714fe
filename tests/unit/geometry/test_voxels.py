"""Distances and connected parts of masks against their definitions."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from scipy import ndimage

from gyriflow.geometry.voxels import INSIDE, OUTSIDE, distance_to, number_parts

SIZES = [0.8, (0.7, 0.9, 1.3)]


def random_mask(share: float) -> np.ndarray:
    return np.random.default_rng(3).random((9, 12, 7)) < share


@pytest.mark.parametrize("size_mm", SIZES)
def test_distances_are_those_to_the_nearest_voxel_of_the_mask(size_mm):
    mask = random_mask(0.03)
    places = np.indices(mask.shape).reshape(3, -1).T * size_mm
    to_each = np.linalg.norm(places[:, None] - places[mask.ravel()], axis=2)
    expected = to_each.min(axis=1).reshape(mask.shape)
    # a view with another order in memory
    for view, distances in ((mask, expected), (mask[::-1], expected[::-1])):
        assert distance_to(view, size_mm) == pytest.approx(distances, rel=1e-5)


def test_nothing_is_infinitely_far():
    assert np.isinf(distance_to(np.zeros((3, 4, 5), dtype=bool), 1.0)).all()
    assert (distance_to(np.ones((3, 4, 5), dtype=bool), 1.0) == 0.0).all()


@pytest.mark.parametrize("structure", [INSIDE, OUTSIDE], ids=["faces", "corners"])
@pytest.mark.parametrize("share", [0.0, 0.1, 0.4, 0.7, 1.0])
def test_parts_are_numbered_in_the_order_of_their_first_voxels(structure, share):
    for mask in (random_mask(share), random_mask(share).transpose(2, 0, 1)):
        number, count = number_parts(mask, structure)
        expected, expected_count = ndimage.label(mask, structure)
        assert count == expected_count
        assert number.dtype == expected.dtype
        assert_array_equal(number, expected)
