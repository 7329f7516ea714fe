"""Terraces taken out of surfaces that were made from voxels: folds stay, and so does what is apart."""

from unittest.mock import patch

import numpy as np
import pytest
from shapes import moved, rigid, scaling, sphere

from gyriflow.anatomy import repair
from gyriflow.anatomy.extraction import smooth_mask
from gyriflow.anatomy.repair import faults, pieces, surface_of_mask
from gyriflow.anatomy.terraces import without_terraces
from gyriflow.geometry.triangles import TriangleMesh, merged, signed_volume, transformed, vertex_areas
from gyriflow.metrics.curvature import curvature

VOXEL_MM = 0.8


def voxels(half):
    """Return the centres (i, j, k, 3) of voxels around the origin and their affine; none lies at the origin."""
    count = int(np.ceil(half / VOXEL_MM)) + 6
    affine = scaling(VOXEL_MM, VOXEL_MM * (np.array([0.1, 0.3, 0.2]) - count))
    return np.moveaxis(np.indices((2 * count + 1,) * 3), 0, -1) * VOXEL_MM + affine[:3, 3], affine


def surface(mask, affine):
    return surface_of_mask(smooth_mask(mask), affine, mask.sum() * VOXEL_MM**3, 1.0)


def test_a_digitised_ball_has_the_curvature_of_a_ball_and_the_volume_of_its_voxels():
    centres, affine = voxels(18.0)
    mask = np.linalg.norm(centres, axis=-1) < 18.0
    with patch.object(repair, "without_terraces", lambda mesh, *_: mesh):
        before = surface(mask, affine).mesh
    found = surface(mask, affine)
    errors = [
        np.sqrt(np.average((curvature(mesh).mean - 1 / 18) ** 2, weights=vertex_areas(mesh)))
        for mesh in (before, found.mesh)
    ]
    assert errors[1] < 0.5 * errors[0]
    assert signed_volume(found.mesh) == pytest.approx(mask.sum() * VOXEL_MM**3, rel=0.002)
    told = found.report["smoothing"]
    assert 0.0 < told["terraces_moved_mm"] < told["terraces_moved_most_mm"] < VOXEL_MM


def test_folds_keep_their_height():
    centres, affine = voxels(20.0)
    mask = np.linalg.norm(centres, axis=-1) < 16.0 + np.cos(2 * np.pi * centres[..., 2] / 10.0)
    points = surface(mask, affine).mesh.vertices
    height = np.linalg.norm(points, axis=1) - 16.0
    wave = np.cos(2 * np.pi * points[:, 2] / 10.0)
    near = np.abs(points[:, 2]) < 8.0
    slope, _ = np.polyfit(wave[near], height[near], 1)
    assert slope == pytest.approx(1.0, abs=0.1)


def test_narrow_gaps_stay_open():
    centres, affine = voxels(24.0)
    mask = np.zeros(centres.shape[:3], dtype=bool)
    for side in (-1.0, 1.0):
        away = (centres - [side * 11.0, 0.0, 0.0]) / [10.0, 20.0, 16.0]
        mask |= (np.abs(away) ** 4).sum(axis=-1) < 1.0
    found = surface(mask, affine)
    assert faults(found.mesh) == ""
    assert len(pieces(found.mesh)) == 2


def test_faces_that_would_cut_others_stay_where_they_are():
    # walls nearer to each other than a tenth of a voxel: there is no centre between them
    mesh = merged(moved(sphere(8.0), -8.02), moved(sphere(8.0), 8.02))
    assert faults(mesh) == ""
    assert faults(without_terraces(mesh, np.diag([3.0, 3.0, 3.0, 1.0]))) == ""


def test_it_does_not_depend_on_where_the_brain_lies():
    _, affine = voxels(9.0)
    mesh = sphere(8.0)
    steps = TriangleMesh(np.round(mesh.vertices / 0.4) * 0.1 + 0.75 * mesh.vertices, mesh.faces)
    plain = without_terraces(steps, affine)
    pose = rigid(20.0, -35.0, 50.0, shift=(7.0, 8.0, -9.0))
    turned = without_terraces(transformed(steps, pose), pose @ affine)
    assert turned.vertices == pytest.approx(transformed(plain, pose).vertices, abs=1e-6)
    farthest = np.linalg.norm(plain.vertices - steps.vertices, axis=1).max()
    assert 0.0 < farthest < VOXEL_MM + 1e-6
