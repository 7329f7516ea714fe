"""Surfaces from voxels: shut sulci are opened where two banks of cortex touch; terraces
are taken out, folds stay."""

from unittest.mock import patch

import numpy as np
import odd_brains
import pytest
from facts import Facts
from open_sulci import try_branching
from scipy import ndimage
from scipy.spatial import cKDTree
from shapes import moved, phantom, rigid, scaling, sphere

from gyriflow.anatomy import repair
from gyriflow.anatomy.extraction import handles, smooth_mask
from gyriflow.anatomy.pial import from_labels
from gyriflow.anatomy.repair import faults, pieces, surface_of_mask
from gyriflow.anatomy.sulci import open_fused_sulci
from gyriflow.anatomy.terraces import without_terraces
from gyriflow.anatomy.thickness import (
    Cortex,
    cortical_thickness,
    thickness_from_labels,
)
from gyriflow.geometry.deformations import transform_points
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

VOXEL_MM, RADIUS_MM, THICKNESS_MM = 0.8, 12.0, 2.0


def ball():
    """Return a ball's mask, the (i, j, k, 3) places in mm, their depth below its
    surface, and the affine."""
    axis = np.arange(-22, 23) * VOXEL_MM + 0.13
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


@pytest.mark.parametrize("depth_mm", [4.0, 6.0])
def test_a_fused_sulcus_is_opened_to_its_depth(depth_mm):
    body, core, affine = with_sulcus(depth_mm)
    field, volume = smooth_mask(body), body.sum() * VOXEL_MM**3
    truth = 4 * np.pi * RADIUS_MM**2 + 2 * np.pi * (
        RADIUS_MM**2 - (RADIUS_MM - depth_mm) ** 2
    )
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
    everywhere = np.ones(len(even.mesh.vertices), dtype=bool)
    found = cortical_thickness(
        even.mesh, Cortex(body, body & ~core, affine), everywhere
    )
    assert found.is_measured.mean() > 0.95
    assert found.report["mean_mm"] == pytest.approx(THICKNESS_MM, abs=0.25)


def test_the_cortex_around_a_sulcus_decides_how_far_apart_its_banks_are():
    """A small ball with a thin cortex, far from a large one with a thick cortex."""
    bodies, cores = [], []
    for radius_mm, thickness_mm in ((9.0, 1.3), (RADIUS_MM, 2.6)):
        _, places, _, affine = ball()
        depth = radius_mm - np.linalg.norm(places, axis=-1)
        across = np.abs(places @ np.array([0.8, 0.36, 0.48]))
        to_end = np.hypot(across, np.maximum(depth - 6.0, 0.0))
        bodies.append(depth > 0)
        cores.append((depth > thickness_mm) & (to_end > thickness_mm))
    body, core = np.concatenate(bodies), np.concatenate(cores)
    opened, fine, report = open_fused_sulci(smooth_mask(body), affine, core)
    assert report["sheets"] == 2
    slits_mm = transform_points(np.argwhere(opened < 0.5), fine)
    for number, radius_mm in enumerate((9.0, RADIUS_MM)):
        places = ball()[1]
        depth = radius_mm - np.linalg.norm(places, axis=-1)
        across = np.abs(places @ np.array([0.8, 0.36, 0.48]))
        sheet = places[(depth > 1.0) & (depth < 5.5) & (across < 0.3)]
        sheet = sheet + [number * len(places) * VOXEL_MM, 0.0, 0.0]
        distance, _ = cKDTree(slits_mm).query(sheet)
        # what is outside the balls is further away
        assert (distance < VOXEL_MM).mean() > 0.95


def test_hemispheres_are_no_banks_of_a_sulcus():
    body, core, affine = with_sulcus(6.0)
    side_mm = (ball()[1] @ np.array([0.8, 0.36, 0.48])).astype(np.float32)
    assert (
        open_fused_sulci(smooth_mask(body), affine, core, side_mm)[2]["slit_voxels"]
        == 0
    )


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
    body, core, affine = with_sulcus(6.0)
    deep = ndimage.binary_erosion(core, iterations=2)
    holes = deep & (np.random.default_rng(0).random(core.shape) < 0.02)
    assert holes.sum() > 20
    fields = [
        open_fused_sulci(smooth_mask(body), affine, one)[0]
        for one in (core, core & ~holes)
    ]
    np.testing.assert_array_equal(*fields)


@pytest.mark.slow
def test_a_hemisphere_alone_has_its_sulcus_opened():
    labels, affine = phantom(voxel_mm=0.8)
    scheme = SCHEMES["dhcp-19"]
    labels = odd_brains.one_hemisphere(
        odd_brains.add_sides(labels, affine), affine, "left"
    )
    cerebrum = np.isin(labels, scheme.cerebrum)
    size = np.linalg.norm(affine[:3, :3], axis=0)
    depth = ndimage.distance_transform_edt(cerebrum, sampling=size)
    coordinates = np.argwhere(cerebrum) @ affine[:3, :3].T + affine[:3, 3]
    y = np.zeros(labels.shape)
    y[cerebrum] = np.abs(coordinates[:, 1] - coordinates[:, 1].mean() - 8.0)
    sheet = cerebrum & (y < 2.0) & (depth < 7.0) & np.isin(labels, scheme.white_matter)
    labels = np.where(sheet, scheme.cortex[0], labels)
    # a tunnel, which is filled before sulci are opened
    middle = np.argwhere(cerebrum).mean(axis=0)
    rows = np.indices(labels.shape) - np.reshape(middle, (3, 1, 1, 1))
    labels[(np.abs(rows[0]) < 2) & (np.abs(rows[2] + 4) < 2)] = 0
    areas, expected_ml = {}, {}
    for opened in (False, True):
        surface = from_labels(
            labels, affine, scheme, "left", week=24.0, open_sulci=opened
        )
        areas[opened] = surface.report["area_cm2"]["left"]
        expected_ml[opened] = surface.report["smoothing"]["volume_expected_mL"]
        assert surface.report["euler_number"] == 2
    # both walls of the slit, which is shorter than the sheet by its rounded ends
    walls = 2.0 * CM2_PER_MM2 * sheet.sum() * size.prod() / 4.0
    assert areas[True] - areas[False] == pytest.approx(walls, rel=0.25)
    filled_ml = expected_ml[False] - surface.report["label_volumes_mL"]["cerebrum"]
    assert filled_ml > 0.005
    opened_ml = surface.report["sulci"]["opened_mL"]
    assert expected_ml[True] == pytest.approx(
        expected_ml[False] - opened_ml, abs=0.1 * filled_ml
    )


def test_labels_that_lack_white_matter_are_reported_and_stay_as_they_are():
    body, places, depth, affine = ball()
    core = body & (depth > THICKNESS_MM) & (places[..., 0] > 3.0)
    field = smooth_mask(body)
    same, grid, report = open_fused_sulci(field, affine, core)
    assert "%" in report["stays_fused"]
    np.testing.assert_array_equal(same, field)
    np.testing.assert_array_equal(grid, affine)


def test_cortex_of_a_voxel_stays_fused_and_has_one_number_of_voxels():
    labels, affine = phantom(24.0, 2.0)
    scheme = SCHEMES["spina-bifida-atlas"]
    surface = from_labels(
        labels, affine, scheme, week=28.0, edge_length_mm=3.0, open_sulci=True
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
    to_end = np.hypot(across, np.maximum(depth - 6.0, 0.0))
    core = body & (depth > thickness) & (to_end > thickness)
    field = smooth_mask(body)
    opened, fine, _ = open_fused_sulci(field, affine, core)
    slits = transform_points(np.argwhere(opened < 0.5), fine)
    slits = slits[np.linalg.norm(slits, axis=1) < RADIUS_MM - 0.5]
    sheet = places[body & (across < 0.3) & (depth < 5.5)]
    is_open = np.linalg.norm(sheet[:, None] - slits, axis=-1).min(axis=1) < VOXEL_MM
    for half in (-1, 1):
        assert is_open[sheet @ np.array([0.0, 0.8, -0.6]) * half > 1.0].mean() > 0.95


def voxels(half, size=VOXEL_MM):
    """Return the centres (i, j, k, 3) of voxels around the origin and their affine;
    none lies at the origin."""
    count = int(np.ceil(half / size)) + 6
    affine = scaling(size, size * (np.array([0.1, 0.3, 0.2]) - count))
    return (
        np.moveaxis(np.indices((2 * count + 1,) * 3), 0, -1) * size + affine[:3, 3],
        affine,
    )


def surface(mask, affine):
    return surface_of_mask(
        smooth_mask(mask), affine, mask.sum() * np.linalg.det(affine), 1.0
    )


@pytest.mark.parametrize("size", [VOXEL_MM, 0.5])
def test_a_digitised_ball_has_the_curvature_of_a_ball_and_the_volume_of_its_voxels(
    size,
):
    radius_mm = 12.0
    centres, affine = voxels(radius_mm, size)
    mask = np.linalg.norm(centres, axis=-1) < radius_mm
    with patch.object(repair, "without_terraces", lambda mesh, *_: mesh):
        before = surface(mask, affine).mesh
    found = surface(mask, affine)
    errors = [
        np.sqrt(
            np.average(
                (curvature(mesh).mean - 1 / radius_mm) ** 2, weights=vertex_areas(mesh)
            )
        )
        for mesh in (before, found.mesh)
    ]
    assert errors[1] < 0.5 * errors[0]
    assert signed_volume(found.mesh) == pytest.approx(mask.sum() * size**3, rel=0.002)
    told = found.report["smoothing"]
    assert 0.0 < told["terraces_moved_mm"] < told["terraces_moved_most_mm"] < size


def test_folds_keep_their_height():
    centres, affine = voxels(15.0)
    mask = np.linalg.norm(centres, axis=-1) < 12.0 + np.cos(
        2 * np.pi * centres[..., 2] / 10.0
    )
    points = surface(mask, affine).mesh.vertices
    height = np.linalg.norm(points, axis=1) - 12.0
    wave = np.cos(2 * np.pi * points[:, 2] / 10.0)
    near = np.abs(points[:, 2]) < 8.0
    slope, _ = np.polyfit(wave[near], height[near], 1)
    assert slope == pytest.approx(1.0, abs=0.1)


def test_narrow_gaps_stay_open():
    centres, affine = voxels(14.0)
    mask = np.zeros(centres.shape[:3], dtype=bool)
    for side in (-1.0, 1.0):
        away = (centres - [side * 6.0, 0.0, 0.0]) / [5.0, 10.0, 8.0]
        mask |= (np.abs(away) ** 4).sum(axis=-1) < 1.0
    found = surface(mask, affine)
    assert faults(found.mesh) == ""
    assert len(pieces(found.mesh)) == 2


def test_faces_that_would_cut_others_stay_where_they_are():
    # walls nearer to each other than a tenth of a voxel: there is no centre between
    # them
    mesh = merged(moved(sphere(8.0), -8.02), moved(sphere(8.0), 8.02))
    assert faults(mesh) == ""
    assert faults(without_terraces(mesh, np.diag([3.0, 3.0, 3.0, 1.0]))) == ""


def test_it_does_not_depend_on_where_the_brain_lies():
    _, affine = voxels(9.0)
    mesh = sphere(8.0)
    steps = TriangleMesh(
        np.round(mesh.vertices / 0.4) * 0.1 + 0.75 * mesh.vertices, mesh.faces
    )
    plain = without_terraces(steps, affine)
    pose = rigid(20.0, -35.0, 50.0, shift=(7.0, 8.0, -9.0))
    turned = without_terraces(transformed(steps, pose), pose @ affine)
    assert turned.vertices == pytest.approx(transformed(plain, pose).vertices, abs=1e-6)
    farthest = np.linalg.norm(plain.vertices - steps.vertices, axis=1).max()
    assert 0.0 < farthest < VOXEL_MM + 1e-6


@pytest.mark.parametrize(("n_arcs", "noise"), [(0, 0.2), (20, 0.1)])
def test_branching_sulci_have_their_area_and_crowns_stay_whole(n_arcs, noise):
    shape = {"radius_mm": 11.0, "depth_mm": 4.0, "thickness_mm": 1.8, "n_arcs": n_arcs}
    found = try_branching(0.8, (20, 30, 10), noise, **shape)
    assert found["opened"] == pytest.approx(0.0, abs=0.05)
    # without opening, what the sulci hide is missing
    assert (found["fused"] < -0.3) == (n_arcs > 0)
    # of noise alone nothing opens; with sulci, less than a percent of their slits is in
    # crowns
    assert found["cracks_mm3"] <= 0.01 * 1e3 * found["opened_mL"]
