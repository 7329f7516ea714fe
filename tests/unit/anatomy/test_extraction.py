"""Isosurfaces of masks: right size, outward, in world coordinates; handles are cut or
filled with the least change."""

from itertools import permutations

import numpy as np
import pytest
from scipy import ndimage
from shapes import rigid, scaling
from skimage.measure import euler_number as euler_number_of_mask

from gyriflow.anatomy.extraction import (
    handles,
    isosurface,
    make_simple,
    remove_bridges,
    smooth_mask,
    unambiguous,
)
from gyriflow.errors import MeshError
from gyriflow.geometry.triangles import area, euler_number, is_closed, signed_volume

RADIUS = 12.0


@pytest.fixture(scope="module")
def ball():
    x, y, z = np.indices((36, 36, 36)) - 17.5
    return x**2 + y**2 + z**2 < RADIUS**2


@pytest.mark.parametrize("signs", [(1, 1, 1), (-1, 1, 1)])
def test_ball_has_its_area_volume_and_place(ball, signs):
    affine = rigid(10, 35, -20, shift=(5, -7, 11)) @ scaling(np.multiply(signs, 0.8))
    surface = isosurface(smooth_mask(ball, 1.0), affine)
    radius = 0.8 * RADIUS
    assert is_closed(surface)
    assert signed_volume(surface) == pytest.approx(4 / 3 * np.pi * radius**3, rel=0.03)
    assert area(surface) == pytest.approx(4 * np.pi * radius**2, rel=0.02)
    centre = affine[:3, :3] @ np.full(3, 17.5) + affine[:3, 3]
    assert surface.vertices.mean(axis=0) == pytest.approx(centre, abs=0.05)


def test_structure_thinner_than_the_smoothing_is_refused():
    thin = np.zeros((20, 20, 20), dtype=bool)
    thin[10, 5:15, 5:15] = True
    field = smooth_mask(thin, 2.0)
    with pytest.raises(MeshError):
        make_simple(field)


def test_slit_one_voxel_wide_stays_open_at_its_width():
    solid = np.zeros((44, 44, 44), dtype=bool)
    solid[10:34, 10:34, 10:34] = True
    split = solid.copy()
    # from above, 16 voxels deep: a narrow fissure
    split[21, :, 18:] = False
    field, reopened = remove_bridges(split, smooth_mask(split))
    affine = scaling(0.5)
    block = isosurface(smooth_mask(solid), affine)
    opened = isosurface(field, affine)
    removed = signed_volume(block) - signed_volume(opened)
    assert reopened == pytest.approx(24 * 16, rel=0.2)
    assert removed == pytest.approx(24 * 16 * 0.5**3, rel=0.2)
    # two walls more, less the slit's own opening
    assert area(opened) - area(block) == pytest.approx(2 * 24 * 16 * 0.5**2, rel=0.2)


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


def test_voxels_are_joined_by_faces_and_what_is_outside_by_corners():
    blocks = np.zeros((8, 8, 8), dtype=bool)
    blocks[1:4, 1:4, 1:4] = blocks[4:7, 4:7, 1:4] = True
    # two parts that share an edge, and no ring
    assert handles(blocks) == 0
    block = np.ones((5, 5, 5), dtype=bool)
    block[2, 2, 2] = block[1, 1, 2] = block[0, 0, 2] = False
    # a way out over edges is a pit; a second one makes a tunnel
    assert handles(block) == 0
    block[3, 3, 2] = block[4, 4, 2] = False
    assert handles(block) == 1


# one layer of the tunnel's four voxels closes it
@pytest.mark.parametrize(
    ("shape", "cut", "filled"), [("bridge", 1, 0), ("tunnel", 0, 4)]
)
def test_a_thin_bridge_is_cut_and_a_narrow_tunnel_filled_with_the_least_change(
    shape, cut, filled
):
    mask = np.zeros((24, 20, 20), dtype=bool)
    if shape == "bridge":
        # of two blocks that are joined at one end
        mask[4:20, 4:16, 4:8] = mask[4:20, 4:16, 12:16] = mask[4:6, 4:16, 4:16] = True
        mask[16, 9, 8:12] = True
    else:
        mask[4:16, 4:16, 8:12] = True
        mask[9:11, 9:11, 8:12] = False
    assert handles(mask) == 1
    repaired, counts = make_simple(field(mask))
    assert counts == {
        "parts_dropped": 0,
        "voxels_dropped": 0,
        "voxels_filled": 0,
        "bridges_cut": cut > 0,
        "voxels_cut_from_bridges": cut,
        "tunnels_filled": filled > 0,
        "voxels_filled_in_tunnels": filled,
        "handles_left": 0,
    }
    assert ((repaired > 0.5) != mask).sum() == cut + filled


def test_storage_order_does_not_decide_which_of_two_bridges_is_cut():
    # two plates joined by two equal posts are one handle; the post with values nearer
    # to one half gives way
    values = np.full((18, 36, 20), 0.3, dtype=np.float32)
    values[4:14, 4:32, 4:7] = values[4:14, 4:32, 13:16] = 0.7
    values[7, 8, 7:13], values[10, 26, 7:13] = 0.7, 0.6
    for axes in permutations(range(3)):
        for ends in ((), (0, 1, 2)):
            repaired, counts = make_simple(np.flip(values.transpose(axes), ends))
            found = np.flip(repaired, ends).transpose(np.argsort(axes))
            assert (counts["bridges_cut"], counts["handles_left"]) == (1, 0)
            assert (found[7, 8, 7:13] > 0.5).all()
            assert (found[10, 26, 7:13] > 0.5).sum() == 5


def test_isosurface_has_the_topology_of_voxels_joined_by_faces():
    noise = np.random.default_rng(0).normal(size=(14, 14, 14))
    mask = np.pad(ndimage.gaussian_filter(noise, 0.8) > 0.15, 2)
    surface = isosurface(unambiguous(field(mask)), np.eye(4))
    # the boundary of a body has twice the body's Euler number
    assert euler_number(surface) == 2 * euler_number_of_mask(mask, connectivity=1)


def test_a_bridge_is_cut_though_what_it_joins_meets_far_away_only():
    mask = np.zeros((16, 150, 20), dtype=bool)
    mask[4:12, 4:146, 4:8] = mask[4:12, 4:146, 12:16] = mask[4:12, 4:8, 4:16] = True
    # a loop that is longer than the boxes in which its ends are looked for
    mask[8, 140, 8:12] = True
    _, counts = make_simple(field(mask))
    assert (counts["handles_left"], counts["voxels_cut_from_bridges"]) == (0, 1)


@pytest.mark.parametrize("case", ["rough labels", "a slit that pierces the mask"])
def test_what_is_no_slit_stays_as_smoothing_leaves_it(case):
    mask = np.zeros((40, 40, 40), dtype=bool)
    mask[8:32, 8:32, 8:32] = True
    if case == "rough labels":
        mask[8, 8:32, 8:32] = np.random.default_rng(0).random((24, 24)) > 0.2
    else:
        mask[20, 14:26, :] = False
    field = smooth_mask(mask, 1.0)
    same, reopened = remove_bridges(mask, field)
    assert reopened == 0
    np.testing.assert_array_equal(same, field)


def test_cavities_are_filled_and_the_surface_is_a_sphere(ball):
    hollow = ball.copy()
    hollow[14:20, 14:20, 14:20] = False
    field, report = make_simple(smooth_mask(hollow, 1.0))
    assert report["voxels_filled"] > 100
    assert euler_number(isosurface(field, np.eye(4))) == 2
