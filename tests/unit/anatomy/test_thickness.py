"""Cortical thickness from labels, on layers of known thickness."""

import igl
import numpy as np
import pytest
from facts import Facts
from shapes import LONG_MM, ellipsoid, rigid, scaling, sphere
from skimage.measure import marching_cubes

from gyriflow.anatomy.extraction import smooth_mask
from gyriflow.anatomy.repair import surface_of_mask
from gyriflow.anatomy.thickness import (
    FISSURE_REACH_MM,
    Cortex,
    cortical_thickness,
    mean_curvature,
    read_cortex,
    summary,
    thickness_from_labels,
    thickness_from_white,
)
from gyriflow.errors import InputError
from gyriflow.geometry.matching import nearest_on
from gyriflow.geometry.poses import Pose
from gyriflow.geometry.triangles import (
    area,
    flipped,
    merged,
    transformed,
    vertex_areas,
)
from gyriflow.settings.schemes import LabelScheme

FOLDS_MM = 2.0


def depth_below(points, folds_mm):
    """Return the distance in mm of (..., 3) points from a folded ball's surface, and
    where they are inside it."""

    def level(x, y, z):
        r = np.sqrt(x**2 + y**2 + z**2) + 1e-9
        return (
            r
            - 20
            - folds_mm * np.cos(9 * x / r) * np.cos(9 * y / r) * np.cos(9 * z / r + 1)
        )

    inside = level(*np.moveaxis(points, -1, 0)) < 0
    if not folds_mm:
        return 20.0 - np.linalg.norm(points, axis=-1), inside
    axis = np.arange(-26, 26, 0.4)
    vertices, faces, _, _ = marching_cubes(
        level(*np.meshgrid(axis, axis, axis, indexing="ij")), 0.0
    )
    depth = np.zeros(inside.shape)
    vertices = vertices * 0.4 + axis[0]
    depth[inside] = np.sqrt(
        igl.point_mesh_squared_distance(
            points[inside], vertices, faces.astype(np.int64)
        )[0]
    )
    return depth, inside


def layered(folds_mm, voxel_mm):
    axis = np.arange(-25, 25, voxel_mm) + 0.13
    points = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1)
    depth, inside = depth_below(points, folds_mm)
    affine = scaling(voxel_mm, axis[0])
    pial = surface_of_mask(
        smooth_mask(inside), affine, inside.sum() * voxel_mm**3, 1.0
    ).mesh
    return pial, depth, inside, affine


@pytest.fixture(scope="module")
def ball():
    return layered(0.0, 0.8)


@pytest.fixture(scope="module")
def folded():
    return layered(FOLDS_MM, 0.8)


def errors(brain, thickness_mm):
    pial, depth, inside, affine = brain
    found = cortical_thickness(
        pial, Cortex(inside, inside & (depth < thickness_mm), affine)
    )
    assert found.is_measured.mean() > 0.99
    return found, found.values_mm[found.is_measured] - thickness_mm


@pytest.mark.parametrize("thickness_mm", [1.0, 3.0])
def test_a_layer_between_concentric_spheres_is_measured_to_a_hundredth_on_average(
    ball, thickness_mm
):
    found, error = errors(ball, thickness_mm)
    assert abs(error.mean()) < 0.02
    assert error.std() < 0.12
    assert found.report["mean_mm"] == pytest.approx(thickness_mm, abs=0.02)
    assert found.report["voxels_through_cortex"] == pytest.approx(
        thickness_mm / 0.8, rel=0.02
    )


@pytest.mark.parametrize("thickness_mm", [1.5, 2.0])
def test_a_folded_layer_is_measured_to_one_and_a_half_per_cent_on_average(
    folded, thickness_mm
):
    found, error = errors(folded, thickness_mm)
    assert found.report["mean_mm"] == pytest.approx(thickness_mm, rel=0.015)
    assert np.abs(np.quantile(error, [0.05, 0.95])).max() < 0.3


def test_a_turned_volume_gives_the_same(ball):
    pial, depth, inside, affine = ball
    cortex = inside & (depth < 2.4)
    turn = rigid(20, -30, 10, shift=(5, -7, 2))
    straight = cortical_thickness(pial, Cortex(inside, cortex, affine))
    turned = cortical_thickness(
        transformed(pial, turn), Cortex(inside, cortex, turn @ affine)
    )
    np.testing.assert_allclose(turned.values_mm, straight.values_mm, atol=1e-4)


def test_what_has_no_cortex_takes_the_value_of_its_neighbours_and_is_reported(ball):
    pial, depth, inside, affine = ball
    x = affine[0, 3] + 0.8 * np.arange(inside.shape[0])
    cortex = inside & (depth < 2.4) & (x < 10)[:, None, None]
    found = cortical_thickness(pial, Cortex(inside, cortex, affine))
    # a cap of a quarter of the sphere's area is bare
    assert found.report["measured_area_share"] == pytest.approx(0.75, abs=0.03)
    bare = pial.vertices[:, 0] > 12
    assert not found.is_measured[bare].any()
    assert (found.values_mm > 0.8 / 3).all()
    edge = found.is_measured & (pial.vertices[:, 0] > 7)
    assert set(np.round(found.values_mm[bare], 6)) <= set(
        np.round(found.values_mm[edge], 6)
    )


@pytest.mark.parametrize(
    ("thickness_mm", "messages"),
    [
        (1.7, []),
        (8.0, [Facts("cortex", "8.0 mm")]),
        (0.9, [Facts("cortex", "1.1 voxels")]),
    ],
)
def test_a_cortex_of_no_usual_thickness_or_of_about_a_voxel_is_reported(
    ball, caplog, thickness_mm, messages
):
    pial, depth, inside, affine = ball
    labels = np.where(inside, np.where(depth < thickness_mm, 5, 1), 0)
    scheme = LabelScheme(name="a", cerebrum=(1, 5), cortex=(5,))
    thickness_from_labels(read_cortex(labels, affine, scheme), pial, Pose())
    assert caplog.messages == messages


@pytest.mark.parametrize("hidden", [0.05, 0.1])
def test_area_that_fused_sulci_hide_is_reported_by_the_cortex_volume(
    ball, caplog, hidden
):
    """A fused sulcus through a ball of 20 mm: two banks of 2 mm that touch, as deep as
    hides a share of the area."""
    pial, depth, inside, affine = ball
    walls_mm2 = hidden / (1.0 - hidden) * area(pial)
    # the area of a circle's segment, by its depth
    deep = np.linspace(0.0, 40.0, 2001)
    segment = 400.0 * np.arccos(1.0 - deep / 20.0) - (20.0 - deep) * np.sqrt(
        np.maximum(deep * (40.0 - deep), 0.0)
    )
    shut_mm = np.interp(0.5 * walls_mm2, segment, deep)
    x, _, z = (affine[0, 3] + 0.8 * index for index in np.indices(inside.shape))
    # at its end, the sulcus has cortex around it
    from_end = np.hypot(x, np.maximum(20.0 - shut_mm - z, 0.0))
    banks = inside & (from_end < 2.0) & (hidden > 0)
    labels = np.where(inside, np.where((depth < 2.0) | banks, 5, 1), 0)
    scheme = LabelScheme(name="a", cerebrum=(1, 5), cortex=(5,))
    found = thickness_from_labels(read_cortex(labels, affine, scheme), pial, Pose())
    assert found.report["area_ratio"] == pytest.approx(1.0 - hidden, abs=0.03)
    assert caplog.messages == [Facts("cortex", f"{found.report['area_ratio']:.2f}")] * (
        found.report["area_ratio"] < 0.95
    )
    assert bool(caplog.messages) == (hidden > 0.05)


@pytest.mark.parametrize(
    ("size", "tolerance"),
    [(LONG_MM, 0.01), ((1.2,) * 3, 0.01), ((1.0, 1.0, 3.0), 0.02)],
)
def test_both_borders_are_where_the_voxels_have_them(size, tolerance):
    semi_axes, turn = np.array([16.0, 20.0, 13.0]), rigid(20, 30, 10)
    shape = np.ceil(2 * (semi_axes.max() + 6) / np.array(size)).astype(int)
    affine = turn @ scaling(size, np.array([0.13, 0.2, -0.1]) - semi_axes.max() - 6)
    points = np.moveaxis(np.indices(shape), 0, -1) @ affine[:3, :3].T + affine[:3, 3]
    inside = ((points / semi_axes) ** 2).sum(axis=-1) < 1.0
    whole, depth = ellipsoid(semi_axes, 5), np.zeros(shape)
    depth[inside] = nearest_on(points[inside], whole)[0]
    pial = surface_of_mask(
        smooth_mask(inside), affine, inside.sum() * np.prod(size), 1.2
    ).mesh
    found = cortical_thickness(pial, Cortex(inside, inside & (depth < 2.0), affine))
    assert found.report["mean_mm"] == pytest.approx(2.0, rel=tolerance)
    assert found.report["voxel_mm"] == pytest.approx(max(size))
    if max(size) < 2.0:
        assert found.report["voxels_through_cortex"] == pytest.approx(
            2.0 / max(size), rel=0.02
        )


def test_mean_curvature_is_that_of_the_vertices_asked_for():
    mesh = merged(sphere(8.0), sphere(20.0, centre=(40.0, 0.0, 0.0)))
    is_small = mesh.vertices[:, 0] < 15.0
    assert mean_curvature(mesh, is_small) == pytest.approx(1 / 8, rel=0.005)
    assert mean_curvature(flipped(mesh), ~is_small) == pytest.approx(-1 / 20, rel=0.005)


def test_a_surface_that_lies_deep_in_the_labels_is_not_measured(ball):
    pial, depth, inside, affine = ball
    # the voxels go on beyond the surface, as where a fissure was opened
    larger = np.ones_like(inside)
    larger[:3] = False
    cortex = larger & (depth < 3.0)
    with pytest.raises(InputError, check=Facts(cortex.sum())):
        cortical_thickness(pial, Cortex(larger, cortex, affine))
    # but for opened sulci, on both sides of the fissure
    x = pial.vertices[:, 0] - 1.5
    found = cortical_thickness(
        pial,
        Cortex(larger, cortex, affine),
        np.abs(x) > FISSURE_REACH_MM,
    )
    assert found.is_measured[np.abs(x) > 3.5].all()
    assert not found.is_measured[np.abs(x) < 2.5].any()


@pytest.mark.parametrize("order", [(2, 0, 1), (1, 2, 0)])
def test_long_voxels_have_their_length_along_their_own_axis(ball, order):
    pial, depth, inside, affine = ball
    inside = inside[:, :, ::3].transpose(order)
    depth = depth[:, :, ::3].transpose(order)
    turn = rigid(20, -30, 10, shift=(5, -7, 2))
    affine = turn @ affine @ np.diag([1.0, 1.0, 3.0, 1.0])[:, [*order, 3]]
    # bare below, where the next cortex is a long voxel away
    z = pial.vertices[:, 2]
    height = np.indices(inside.shape)[order.index(2)]
    cortex = inside & (depth < 3.2) & (height > 10)
    found = cortical_thickness(transformed(pial, turn), Cortex(inside, cortex, affine))
    bare = -25 + 0.13 + 2.4 * 10.5
    share = found.is_measured[z > bare + 2.4].mean()
    assert share == pytest.approx(0.968, abs=0.003)
    assert not found.is_measured[z < bare - 4.0].any()


PIAL = sphere(10.0, 4, (40.0, 5.0, 0.0))


@pytest.mark.parametrize(("shift_mm", "is_refused"), [(2.49, False), (2.6, True)])
def test_a_white_surface_may_cross_the_pial_one_by_a_hundredth_of_its_area(
    shift_mm, is_refused
):
    # off the middle, so that one side comes out
    white = sphere(8.0, 4, (40.0, 5.0 + shift_mm, 0.0))
    if not is_refused:
        found = thickness_from_white(PIAL, Pose(), 0.0, {"right": white})
        assert found.report["measured_area_share"] < 1.0
        return
    is_outside = np.linalg.norm(white.vertices - [40.0, 5.0, 0.0], axis=1) > 10.0
    is_outside &= nearest_on(white.vertices, PIAL)[0] > 0.5
    areas = vertex_areas(white)
    share = areas[is_outside].sum() / areas.sum()
    facts = Facts("right", f"{100 * share:.0f} %", "0.6 mm", "1 %", "0.5 mm")
    with pytest.raises(InputError, check=facts):
        thickness_from_white(PIAL, Pose(), 0.0, {"right": white})


def test_a_white_surface_is_of_its_side_and_inside_the_pial_one():
    white = sphere(8.0, 4, (40.0, 5.0, 0.0))
    found = thickness_from_white(PIAL, Pose(), 39.0, {"right": white})
    assert found.values_mm == pytest.approx(2.0, abs=0.05)
    for side, fissure_x_mm in (("right", 41.5), ("left", 38.5)):
        facts = Facts(side, "x = 40.0 mm", f"{fissure_x_mm} mm")
        with pytest.raises(InputError, check=facts):
            thickness_from_white(PIAL, Pose(), fissure_x_mm, {side: white})
    same = sphere(9.75, 4, (40.0, 5.0, 0.0))
    with pytest.raises(InputError, check=Facts("0.25 mm", "0.3 mm")):
        thickness_from_white(PIAL, Pose(), 0.0, {"right": same})


def test_a_summary_is_weighted_by_area_and_leaves_out_what_was_not_measured():
    values, areas = np.array([1.0, 2.0, 4.0, 9.0]), np.array([1.0, 2.0, 1.0, 6.0])
    found = summary(values, np.array([True, True, True, False]), areas)
    expected = {
        "mean_mm": 2.25,
        "median_mm": 2.0,
        "quantile05_mm": 1.0,
        "quantile95_mm": 4.0,
    }
    assert found == pytest.approx(
        expected | {"sd_mm": np.sqrt(4.75 / 4), "measured_area_share": 0.4}
    )
