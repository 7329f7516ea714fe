"""Isosurfaces of masks: right size, outward, in world coordinates, whatever the affine."""

import numpy as np
import pytest
from shapes import rigid

from gyriflow.anatomy.extraction import isosurface, main_parts, make_simple, refine, remove_bridges, smooth_mask
from gyriflow.errors import MeshError
from gyriflow.geometry.triangles import area, euler_number, is_closed, signed_volume

RADIUS = 12.0


@pytest.fixture(scope="module")
def ball():
    x, y, z = np.indices((36, 36, 36)) - 17.5
    return x**2 + y**2 + z**2 < RADIUS**2


@pytest.mark.parametrize("signs", [(1, 1, 1), (-1, 1, 1)])
def test_ball_has_its_area_volume_and_place(ball, signs):
    affine = rigid(10, 35, -20, shift=(5, -7, 11)) @ np.diag([*np.multiply(signs, 0.8), 1.0])
    surface = isosurface(smooth_mask(ball, 1.0), affine)
    radius = 0.8 * RADIUS
    assert is_closed(surface)
    assert signed_volume(surface) == pytest.approx(4 / 3 * np.pi * radius**3, rel=0.03)
    assert area(surface) == pytest.approx(4 * np.pi * radius**2, rel=0.02)
    assert surface.vertices.mean(axis=0) == pytest.approx(affine[:3, :3] @ np.full(3, 17.5) + affine[:3, 3], abs=0.05)


@pytest.mark.parametrize("factor", [2, 3])
def test_refined_field_stays_in_its_place(ball, factor):
    affine = np.diag([1.6, 1.6, 2.0, 1.0])
    field, fine = refine(smooth_mask(ball, 1.0), affine, factor)
    assert field.shape == tuple(factor * n for n in ball.shape)
    surface = isosurface(field, fine)
    assert surface.vertices.mean(axis=0) == pytest.approx(affine[:3, :3] @ np.full(3, 17.5), abs=0.01)
    assert signed_volume(surface) == pytest.approx(signed_volume(isosurface(smooth_mask(ball, 1.0), affine)), rel=0.01)


def test_crumbs_are_dropped_but_never_a_hemisphere():
    mask = np.zeros((40, 20, 20), dtype=bool)
    mask[2:15, 2:18, 2:18], mask[25:36, 2:18, 2:18] = True, True
    mask[20, 10, 10:12] = True
    kept, parts, voxels = main_parts(mask)
    assert (parts, voxels) == (1, 2)
    assert kept[10, 10, 10]
    assert kept[30, 10, 10]
    assert not kept[20].any()


def test_cavities_are_filled_and_the_surface_is_a_sphere(ball):
    hollow = ball.copy()
    hollow[14:20, 14:20, 14:20] = False
    field, report = make_simple(smooth_mask(hollow, 1.0))
    assert report["voxels_filled"] > 100
    assert euler_number(isosurface(field, np.eye(4))) == 2


def test_structure_thinner_than_the_smoothing_is_refused():
    thin = np.zeros((20, 20, 20), dtype=bool)
    thin[10, 5:15, 5:15] = True
    with pytest.raises(MeshError, match="nothing is left"):
        make_simple(smooth_mask(thin, 2.0))


def test_slit_one_voxel_wide_stays_open_at_its_width():
    solid = np.zeros((44, 44, 44), dtype=bool)
    solid[10:34, 10:34, 10:34] = True
    split = solid.copy()
    # from above, 16 voxels deep: a narrow fissure
    split[21, :, 18:] = False
    whole = smooth_mask(solid, 1.0)
    field, reopened = remove_bridges(split, smooth_mask(split), np.zeros_like(split))
    affine = np.diag([0.5, 0.5, 0.5, 1.0])
    block, opened = isosurface(whole, affine), isosurface(field, affine)
    removed = signed_volume(block) - signed_volume(opened)
    assert reopened == pytest.approx(24 * 16, rel=0.2)
    assert removed == pytest.approx(24 * 16 * 0.5**3, rel=0.2)
    # two walls more, less the slit's own opening
    assert area(opened) - area(block) == pytest.approx(2 * 24 * 16 * 0.5**2, rel=0.2)


@pytest.mark.parametrize("case", ["rough labels", "a slit that pierces the mask"])
def test_what_is_no_slit_stays_as_smoothing_leaves_it(case):
    mask = np.zeros((40, 40, 40), dtype=bool)
    mask[8:32, 8:32, 8:32] = True
    if case == "rough labels":
        mask[8, 8:32, 8:32] = np.random.default_rng(0).random((24, 24)) > 0.2
    else:
        mask[20, 14:26, :] = False
    field = smooth_mask(mask, 1.0)
    same, reopened = remove_bridges(mask, field, np.zeros_like(mask))
    assert reopened == 0
    np.testing.assert_array_equal(same, field)
