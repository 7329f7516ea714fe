"""Surfaces from voxels: shut sulci are opened where two banks of cortex touch; terraces
are taken out, folds stay."""

from unittest.mock import patch

import numpy as np
import odd_brains
import pytest
from facts import Facts
from open_sulci import try_branching
from scipy import ndimage
from shapes import moved, phantom, rigid, scaling, sphere

from gyriflow.anatomy import repair
from gyriflow.anatomy.extraction import handles, smooth_mask
from gyriflow.anatomy.pial import from_labels
from gyriflow.anatomy.repair import faults, surface_of_mask
from gyriflow.anatomy.sulci import open_fused_sulci
from gyriflow.anatomy.terraces import without_terraces
from gyriflow.anatomy.thickness import (
    Cortex,
    thickness_from_labels,
)
from gyriflow.geometry.deformations import transform_points
from gyriflow.geometry.poses import Pose
from gyriflow.geometry.triangles import (
    TriangleMesh,
    area,
    euler_number,
    merged,
    signed_volume,
    transformed,
    vertex_areas,
)
from gyriflow.io.yaml_files import SCHEMES
from gyriflow.metrics.curvature import curvature
from gyriflow.units import CM2_PER_MM2

ATLAS = SCHEMES["spina-bifida-atlas"]
VOXEL_MM, RADIUS_MM, THICKNESS_MM = 0.8, 10.0, 2.0


def ball():
    """Return a ball's mask, the (i, j, k, 3) places in mm, their depth below its
    surface, and the affine."""
    axis = np.arange(-18, 19) * VOXEL_MM + 0.13
    places = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1)
    depth = RADIUS_MM - np.linalg.norm(places, axis=-1)
    return depth > 0, places, depth, scaling(VOXEL_MM, axis[0])


def with_sulcus(depth_mm):
    """Return a ball with a shut sulcus all round it, in a plane that is oblique to the
    voxels."""
    body, places, depth, affine = ball()
    across = np.abs(places @ np.array([0.8, 0.36, 0.48]))
    to_end = np.hypot(across, np.maximum(depth - depth_mm, 0.0))
    return body, body & (depth > THICKNESS_MM) & (to_end > THICKNESS_MM), affine


def test_a_fused_sulcus_is_opened_to_its_depth():
    depth_mm = 5.0
    body, core, affine = with_sulcus(depth_mm)
    field, volume = smooth_mask(body), body.sum() * VOXEL_MM**3
    walls_mm2 = 2 * np.pi * (RADIUS_MM**2 - (RADIUS_MM - depth_mm) ** 2)
    truth = 4 * np.pi * RADIUS_MM**2 + walls_mm2
    shut = surface_of_mask(field, affine, volume, 1.0).mesh
    assert area(shut) < 0.83 * truth
    opened, fine, report = open_fused_sulci(field, affine, core)
    assert handles(opened > 0.5) == 0
    taken = 1e3 * report["opened_mL"]
    even = surface_of_mask(opened, fine, volume, 1.0, taken_mm3=taken)
    assert "remade" not in even.report
    assert euler_number(even.mesh) == 2
    assert area(even.mesh) == pytest.approx(truth, rel=0.06)
    # half a millimetre wide
    assert taken < 0.6 * (truth - area(shut)) / 2
    cortex = Cortex(body, body & ~core, affine)
    # far from any fissure
    found = thickness_from_labels(cortex, even.mesh, Pose(), fissure_x_mm=np.inf)
    assert found.is_measured.mean() > 0.95
    assert found.report["mean_mm"] == pytest.approx(THICKNESS_MM, abs=0.25)


def test_hemispheres_are_no_banks_of_a_sulcus():
    body, core, affine = with_sulcus(5.0)
    side_mm = (ball()[1] @ np.array([0.8, 0.36, 0.48])).astype(np.float32)
    *_, report = open_fused_sulci(smooth_mask(body), affine, core, side_mm)
    assert report["slit_voxels"] == 0


@pytest.mark.parametrize("kind", ["thick crest", "groove"])
def test_cortex_without_a_second_bank_stays_whole(kind):
    body, places, depth, affine = ball()
    if kind == "groove":
        # an open valley of 90°
        body &= places[..., 2] < 4.0 + np.abs(places[..., 0])
        depth = VOXEL_MM * (ndimage.distance_transform_edt(body) - 0.5)
        core = body & (depth > THICKNESS_MM)
    else:
        # 1.2 mm thick below, 4.4 mm above
        core = np.linalg.norm(places + [0.0, 0.0, 1.6], axis=-1) < RADIUS_MM - 2.8
    field = smooth_mask(body)
    same, grid, report = open_fused_sulci(field, affine, core)
    assert report["slit_voxels"] == 0
    # as it is without opening: no finer voxels either
    assert same is field
    assert grid is affine


def test_holes_in_the_white_matter_open_nothing_more():
    body, core, affine = with_sulcus(5.0)
    deep = ndimage.binary_erosion(core, iterations=2)
    holes = deep & (np.random.default_rng(0).random(core.shape) < 0.02)
    assert holes.sum() > 20
    field = smooth_mask(body)
    expected, *_ = open_fused_sulci(field, affine, core)
    found, *_ = open_fused_sulci(field, affine, core & ~holes)
    np.testing.assert_array_equal(found, expected)


@pytest.mark.slow
def test_a_hemisphere_alone_has_its_sulcus_opened():
    labels, affine = phantom(voxel_mm=0.8)
    scheme = SCHEMES["dhcp-19"]
    sided = odd_brains.add_sides(labels, affine)
    labels = odd_brains.one_hemisphere(sided, affine, "left")
    cerebrum = np.isin(labels, scheme.cerebrum)
    depth = 0.8 * ndimage.distance_transform_edt(cerebrum)
    _, y, _ = odd_brains.positions(labels, affine)
    near = np.abs(y - y[cerebrum].mean() - 8.0) < 2.0
    sheet = near & cerebrum & (depth < 7.0) & np.isin(labels, scheme.white_matter)
    labels = np.where(sheet, scheme.cortex[0], labels)
    # a tunnel, which is filled before sulci are opened
    middle = np.argwhere(cerebrum).mean(axis=0)
    i, _, k = np.indices(labels.shape) - np.reshape(middle, (3, 1, 1, 1))
    labels[(np.abs(i) < 2) & (np.abs(k + 4) < 2)] = 0
    shut, opened = (
        from_labels(labels, affine, scheme, "left", week=24.0, open_sulci=opens).report
        for opens in (False, True)
    )
    assert shut["euler_number"] == opened["euler_number"] == 2
    # both walls of the slit, which is shorter than the sheet by its rounded ends
    walls = 2.0 * CM2_PER_MM2 * sheet.sum() * 0.8**3 / 4.0
    added = opened["area_cm2"]["left"] - shut["area_cm2"]["left"]
    assert added == pytest.approx(walls, rel=0.25)
    expected_ml = shut["smoothing"]["volume_expected_mL"]
    filled_ml = expected_ml - shut["label_volumes_mL"]["cerebrum"]
    assert filled_ml > 0.005
    found_ml = opened["smoothing"]["volume_expected_mL"] + opened["sulci"]["opened_mL"]
    assert found_ml == pytest.approx(expected_ml, abs=0.1 * filled_ml)


def test_labels_that_lack_white_matter_are_reported_and_stay_as_they_are():
    body, places, depth, affine = ball()
    core = body & (depth > THICKNESS_MM) & (places[..., 0] > 3.0)
    field = smooth_mask(body)
    same, grid, report = open_fused_sulci(field, affine, core)
    assert "%" in report["stays_fused"]
    np.testing.assert_array_equal(same, field)
    np.testing.assert_array_equal(grid, affine)


@pytest.mark.usefixtures("few_starts")
def test_cortex_of_a_voxel_stays_fused_and_has_one_number_of_voxels():
    labels, affine = phantom(24.0, 2.0)
    surface = from_labels(
        labels, affine, ATLAS, week=28.0, edge_length_mm=4.0, open_sulci=True
    )
    thickness = thickness_from_labels(
        surface.cortex, surface.whole, surface.pose, surface.fissure_x_mm
    )
    voxels = thickness.report["voxels_through_cortex"]
    assert voxels == pytest.approx(1.0, abs=0.2)
    reason = surface.report["sulci"]["stays_fused"]
    assert reason == Facts(f"{voxels:.1f} voxels")
    assert Facts(reason) in surface.report["warnings"]


def test_uneven_cortex_is_opened_on_both_sides():
    body, places, depth, affine = ball()
    across = np.abs(places @ np.array([0.8, 0.36, 0.48]))
    along = places @ np.array([0.0, 0.8, -0.6])
    thickness = np.where(along < 0, 1.3, 2.6)
    to_end = np.hypot(across, np.maximum(depth - 4.5, 0.0))
    core = body & (depth > thickness) & (to_end > thickness)
    field = smooth_mask(body)
    opened, fine, _ = open_fused_sulci(field, affine, core)
    slits = transform_points(np.argwhere(opened < 0.5), fine)
    slits = slits[np.linalg.norm(slits, axis=1) < RADIUS_MM - 0.5]
    sheet = places[body & (across < 0.3) & (depth < 4.0)]
    is_open = np.linalg.norm(sheet[:, None] - slits, axis=-1).min(axis=1) < VOXEL_MM
    for half in (-1, 1):
        assert is_open[sheet @ np.array([0.0, 0.8, -0.6]) * half > 1.0].mean() > 0.95


def voxels(half):
    """Return the centres (i, j, k, 3) of voxels around the origin and their affine;
    none lies at the origin."""
    count = int(np.ceil(half / VOXEL_MM)) + 6
    affine = scaling(VOXEL_MM, VOXEL_MM * (np.array([0.1, 0.3, 0.2]) - count))
    index = np.moveaxis(np.indices((2 * count + 1,) * 3), 0, -1)
    return index * VOXEL_MM + affine[:3, 3], affine


def surface(mask, affine):
    return surface_of_mask(smooth_mask(mask), affine, mask.sum() * VOXEL_MM**3, 1.0)


def test_a_digitised_ball_has_the_curvature_of_a_ball_and_the_volume_of_its_voxels():
    centres, affine = voxels(RADIUS_MM)
    mask = np.linalg.norm(centres, axis=-1) < RADIUS_MM
    with patch.object(repair, "without_terraces", lambda mesh, *_: mesh):
        before = surface(mask, affine)
    after = surface(mask, affine)
    errors = []
    for mesh in (before.mesh, after.mesh):
        squares = (curvature(mesh).mean - 1 / RADIUS_MM) ** 2
        errors.append(np.sqrt(np.average(squares, weights=vertex_areas(mesh))))
    assert errors[1] < 0.5 * errors[0]
    volume = mask.sum() * VOXEL_MM**3
    assert signed_volume(after.mesh) == pytest.approx(volume, rel=0.002)
    found = after.report["smoothing"]
    assert 0.0 < found["terraces_moved_mm"] < found["terraces_moved_most_mm"] < VOXEL_MM


def test_faces_that_would_cut_others_stay_where_they_are():
    # walls nearer to each other than a tenth of a voxel: there is no centre between
    # them
    mesh = merged(moved(sphere(8.0), -8.02), moved(sphere(8.0), 8.02))
    assert faults(mesh) == ""
    assert faults(without_terraces(mesh, np.diag([3.0, 3.0, 3.0, 1.0]))) == ""


def test_it_does_not_depend_on_where_the_brain_lies():
    _, affine = voxels(9.0)
    ball = sphere(8.0, 3)
    rough = 0.1 * np.round(ball.vertices / 0.4) + 0.75 * ball.vertices
    steps = TriangleMesh(rough, ball.faces)
    plain = without_terraces(steps, affine)
    pose = rigid(20.0, -35.0, 50.0, shift=(7.0, 8.0, -9.0))
    turned = without_terraces(transformed(steps, pose), pose @ affine)
    assert turned.vertices == pytest.approx(transformed(plain, pose).vertices, abs=1e-6)
    farthest = np.linalg.norm(plain.vertices - steps.vertices, axis=1).max()
    assert 0.0 < farthest < VOXEL_MM + 1e-6


@pytest.mark.parametrize(
    ("n_arcs", "noise"), [(0, 0.2), pytest.param(20, 0.1, marks=pytest.mark.slow)]
)
def test_branching_sulci_have_their_area_and_crowns_stay_whole(n_arcs, noise):
    shape = {"radius_mm": 11.0, "depth_mm": 4.0, "thickness_mm": 1.8, "n_arcs": n_arcs}
    found = try_branching(0.8, (20, 30, 10), noise, **shape)
    assert found["opened"] == pytest.approx(0.0, abs=0.05)
    # without opening, what the sulci hide is missing
    assert (found["fused"] < -0.3) == (n_arcs > 0)
    # of noise alone nothing opens; with sulci, less than a percent of their slits is in
    # crowns
    assert found["cracks_mm3"] <= 0.01 * 1e3 * found["opened_mL"]
