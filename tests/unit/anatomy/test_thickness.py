"""Cortical thickness from labels, on layers of known thickness."""

import igl
import numpy as np
import pytest
from facts import Facts
from shapes import rigid, scaling
from skimage.measure import marching_cubes

from gyriflow.anatomy.extraction import isosurface, make_simple, smooth_mask
from gyriflow.anatomy.repair import make_even
from gyriflow.anatomy.thickness import cortical_thickness, thickness_from_labels
from gyriflow.errors import InputError
from gyriflow.geometry.poses import Pose
from gyriflow.geometry.triangles import transformed
from gyriflow.settings.schemes import LabelScheme

FOLDS_MM = 2.0


def depth_below(points, folds_mm):
    """Return the distance in mm of (..., 3) points from a folded ball's surface, and where they are inside it."""

    def level(x, y, z):
        r = np.sqrt(x**2 + y**2 + z**2) + 1e-9
        return r - 20 - folds_mm * np.cos(9 * x / r) * np.cos(9 * y / r) * np.cos(9 * z / r + 1)

    axis = np.arange(-26, 26, 0.4)
    vertices, faces, _, _ = marching_cubes(level(*np.meshgrid(axis, axis, axis, indexing="ij")), 0.0)
    inside = level(*np.moveaxis(points, -1, 0)) < 0
    depth = np.zeros(inside.shape)
    vertices = vertices * 0.4 + axis[0]
    depth[inside] = np.sqrt(igl.point_mesh_squared_distance(points[inside], vertices, faces.astype(np.int64))[0])
    return depth, inside


def layered(folds_mm, voxel_mm):
    axis = np.arange(-25, 25, voxel_mm) + 0.13
    points = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1)
    depth, inside = depth_below(points, folds_mm)
    affine = scaling(voxel_mm, axis[0])
    pial, _ = make_even(isosurface(make_simple(smooth_mask(inside, 1.0))[0], affine), 1.0)
    return pial, depth, inside, affine


@pytest.fixture(scope="module")
def ball():
    return layered(0.0, 0.8)


@pytest.fixture(scope="module")
def folded():
    return layered(FOLDS_MM, 0.8)


def errors(brain, thickness_mm):
    pial, depth, inside, affine = brain
    found = cortical_thickness(pial, inside, inside & (depth < thickness_mm), affine)
    assert found.is_measured.mean() > 0.99
    return found, found.values_mm[found.is_measured] - thickness_mm


@pytest.mark.parametrize("thickness_mm", [1.0, 1.7, 3.0])
def test_a_layer_between_concentric_spheres_is_measured_to_a_hundredth_on_average(ball, thickness_mm):
    found, error = errors(ball, thickness_mm)
    assert abs(error.mean()) < 0.02
    assert error.std() < 0.12
    assert found.report["mean_mm"] == pytest.approx(thickness_mm, abs=0.02)
    assert found.report["voxels_through_cortex"] == pytest.approx(thickness_mm / 0.8, rel=0.02)


@pytest.mark.parametrize(("thickness_mm", "mean_mm"), [(1.0, 0.04), (2.0, 0.08)])
def test_a_folded_layer_is_measured_to_a_tenth_of_a_voxel_on_average(folded, thickness_mm, mean_mm):
    _, error = errors(folded, thickness_mm)
    assert abs(error.mean()) < mean_mm
    assert np.abs(np.quantile(error, [0.05, 0.95])).max() < 0.3


def test_a_turned_volume_gives_the_same(ball):
    pial, depth, inside, affine = ball
    cortex = inside & (depth < 2.4)
    turn = rigid(20, -30, 10, shift=(5, -7, 2))
    straight = cortical_thickness(pial, inside, cortex, affine)
    turned = cortical_thickness(transformed(pial, turn), inside, cortex, turn @ affine)
    np.testing.assert_allclose(turned.values_mm, straight.values_mm, atol=1e-4)


def test_what_has_no_cortex_takes_the_value_of_its_neighbours_and_is_told(ball):
    pial, depth, inside, affine = ball
    x = affine[0, 3] + 0.8 * np.arange(inside.shape[0])
    cortex = inside & (depth < 2.4) & (x < 10)[:, None, None]
    found = cortical_thickness(pial, inside, cortex, affine)
    # a cap of a quarter of the sphere's area is bare
    assert found.report["measured_area_share"] == pytest.approx(0.75, abs=0.03)
    bare = pial.vertices[:, 0] > 12
    assert not found.is_measured[bare].any()
    assert (found.values_mm > 0.8 / 3).all()
    edge = found.is_measured & (pial.vertices[:, 0] > 7)
    assert set(np.round(found.values_mm[bare], 6)) <= set(np.round(found.values_mm[edge], 6))


@pytest.mark.parametrize(
    ("thickness_mm", "messages"),
    [(1.7, []), (8.0, [Facts("cortex", "8.0 mm")]), (0.9, [Facts("cortex", "1.1 voxels")])],
)
def test_a_cortex_of_no_usual_thickness_or_of_about_a_voxel_is_told(ball, caplog, thickness_mm, messages):
    pial, depth, inside, affine = ball
    labels = np.where(inside, np.where(depth < thickness_mm, 5, 1), 0)
    thickness_from_labels(labels, affine, LabelScheme(name="a", cerebrum=(1, 5), cortex=(5,)), pial, Pose())
    assert caplog.messages == messages


@pytest.mark.parametrize(("shut_mm", "ratio"), [(0.0, 1.11), (26.0, 0.86), (40.0, 0.78)])
def test_area_that_shut_sulci_hide_is_told_by_the_cortex_volume(ball, caplog, shut_mm, ratio):
    """A shut sulcus through a ball of 20 mm: two banks of 2 mm that touch, as deep as `shut_mm`."""
    pial, depth, inside, affine = ball
    x, _, z = (affine[0, 3] + 0.8 * index for index in np.indices(inside.shape))
    banks = inside & (np.abs(x) < 2.0) & (z > 20.0 - shut_mm)
    labels = np.where(inside, np.where((depth < 2.0) | banks, 5, 1), 0)
    scheme = LabelScheme(name="a", cerebrum=(1, 5), cortex=(5,))
    found = thickness_from_labels(labels, affine, scheme, pial, Pose())
    assert found.report["area_ratio"] == pytest.approx(ratio, abs=0.04)
    assert caplog.messages == [Facts("cortex", f"{found.report['area_ratio']:.2f}")] * (ratio < 0.95)


def test_a_surface_that_lies_deep_in_the_labels_is_not_measured(ball):
    pial, depth, inside, affine = ball
    # the voxels go on beyond the surface, as where a fissure was opened
    larger = np.ones_like(inside)
    larger[:3] = False
    with pytest.raises(InputError, check=Facts((larger & (depth < 3.0)).sum())):
        cortical_thickness(pial, larger, larger & (depth < 3.0), affine)
