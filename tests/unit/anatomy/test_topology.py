"""Handles: counted, cut or filled with the least change, the rest left alone."""

import numpy as np
import pytest
from scipy import ndimage
from skimage.measure import euler_number as euler_number_of_mask

from gyriflow.anatomy.extraction import dilated, handles, isosurface, unambiguous, without_handles
from gyriflow.geometry.triangles import euler_number


def two_blocks():
    mask = np.zeros((24, 20, 20), dtype=bool)
    mask[4:20, 4:16, 4:8] = True
    mask[4:20, 4:16, 12:16] = True
    mask[4:6, 4:16, 4:16] = True
    return mask


def field(mask):
    # what a smoothed mask has at its edge: 0.3 and 0.7
    return np.where(mask, 0.7, 0.3).astype(np.float32)


def test_ball_torus_and_hollow_ball_have_known_handles():
    x, y, z = np.indices((24, 24, 24)) - 11.5
    ball = x**2 + y**2 + z**2 < 81
    torus = (np.hypot(x, y) - 6) ** 2 + z**2 < 9
    assert handles(ball) == 0
    assert handles(torus) == 1
    assert handles(ball & ~(x**2 + y**2 + z**2 < 9)) == 0
    assert handles(np.concatenate([torus, torus])) == 2


def bridge(mask):
    mask[16, 9, 8:12] = True
    return mask


def tunnel():
    mask = np.zeros((20, 20, 20), dtype=bool)
    mask[4:16, 4:16, 8:12] = True
    mask[9:11, 9:11, 8:12] = False
    return mask


# one layer of the tunnel's four voxels closes it
@pytest.mark.parametrize(("mask", "cut", "filled"), [(bridge(two_blocks()), 1, 0), (tunnel(), 0, 4)])
def test_a_thin_bridge_is_cut_and_a_narrow_tunnel_filled_with_the_least_change(mask, cut, filled):
    assert handles(mask) == 1
    repaired, counts = without_handles(field(mask))
    assert (counts["handles_left"], counts["bridges_cut"], counts["tunnels_filled"]) == (0, cut > 0, filled > 0)
    assert (counts["voxels_cut_from_bridges"], counts["voxels_filled_in_tunnels"]) == (cut, filled)
    assert ((repaired > 0.5) != mask).sum() == cut + filled


def test_several_handles_are_all_removed():
    mask = two_blocks()
    mask[12, 6, 8:12] = mask[16, 9:11, 8:12] = mask[18, 13, 8:12] = True
    assert handles(mask) == 3
    repaired, counts = without_handles(field(mask))
    assert counts["handles_left"] == 0
    assert euler_number(isosurface(unambiguous(repaired), np.eye(4))) == 2


@pytest.mark.parametrize("seed", range(2))
def test_isosurface_has_the_topology_of_voxels_joined_by_faces(seed):
    noise = np.random.default_rng(seed).normal(size=(14, 14, 14))
    mask = np.pad(ndimage.gaussian_filter(noise, 0.8) > 0.15, 2)
    surface = isosurface(unambiguous(field(mask)), np.eye(4))
    # the boundary of a body has twice the body's Euler number
    assert euler_number(surface) == 2 * euler_number_of_mask(mask, connectivity=1)


@pytest.mark.parametrize("radius", [1.0, 1.5, 3.0, 4.5, 6.0])
def test_dilation_reaches_as_far_as_the_radius(radius):
    mask = np.pad(ndimage.gaussian_filter(np.random.default_rng(0).normal(size=(12, 16, 20)), 1.0) > 0.15, 5)
    np.testing.assert_array_equal(dilated(mask, radius), ndimage.distance_transform_edt(~mask) <= radius)


def test_a_bridge_is_cut_though_what_it_joins_meets_far_away_only():
    mask = np.zeros((16, 150, 20), dtype=bool)
    mask[4:12, 4:146, 4:8] = mask[4:12, 4:146, 12:16] = mask[4:12, 4:8, 4:16] = True
    # a loop that is longer than the boxes in which its ends are looked for
    mask[8, 140, 8:12] = True
    _, counts = without_handles(field(mask))
    assert (counts["handles_left"], counts["bridges_cut"], counts["voxels_cut_from_bridges"]) == (0, 1, 1)
