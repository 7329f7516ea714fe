"""Surfaces prepared for comparison, how strongly they are folded, and how their
cortices overlap."""

import numpy as np
import pytest
from facts import Facts
from shapes import rigid, sphere, uneven

from gyriflow.compare.shapes import (
    PreparedSurface,
    cortex_dice,
    curvature_differences,
    prepare_for_comparison,
)
from gyriflow.errors import InputError
from gyriflow.geometry.matching import nearest_on
from gyriflow.geometry.triangles import (
    TriangleMesh,
    flipped,
    mean_edge_length,
    signed_volume,
    transformed,
)

from .bumpy import RADIUS, REAL, SMOOTH


def test_a_prepared_surface_has_the_observed_volume_and_pose_and_even_triangles():
    moved = transformed(
        REAL, rigid(0, 0, 12, shift=(5, -3, 2)) @ np.diag([0.7, 0.7, 0.7, 1.0])
    )
    prepared = prepare_for_comparison(moved, REAL)
    assert signed_volume(prepared.mesh) == pytest.approx(signed_volume(REAL), rel=0.01)
    assert mean_edge_length(prepared.mesh) == pytest.approx(1.0, abs=0.1)
    assert nearest_on(prepared.mesh.vertices, REAL)[0].max() < 0.2
    # the observed brain stays where it is
    own = prepare_for_comparison(REAL, REAL)
    assert nearest_on(own.mesh.vertices, REAL)[0].max() < 0.1


def test_a_prepared_surface_has_its_curvature():
    prepared = prepare_for_comparison(SMOOTH, SMOOTH)
    assert prepared.mean_curvature == pytest.approx(
        np.full(len(prepared.mesh.vertices), 1 / RADIUS), rel=0.1
    )
    assert prepared.shape_index == pytest.approx(
        np.ones(len(prepared.mesh.vertices)), abs=0.15
    )
    assert prepared.curvature_rms == pytest.approx(1 / RADIUS, rel=0.02)


def test_surfaces_without_a_volume_are_refused():
    with pytest.raises(InputError, check=Facts("-3.402e+04", "3.402e+04", "mm³")):
        prepare_for_comparison(flipped(REAL), REAL)


def test_size_and_distance_of_curvature():
    half = np.where(SMOOTH.vertices[:, 2] > 0, 0.1, -0.1)
    against = curvature_differences(
        PreparedSurface(SMOOTH, 2 * half, half), PreparedSurface(SMOOTH, half, half)
    )
    assert against["curvature_rms_ratio"] == pytest.approx(2.0)
    assert against["curvature_distance_per_mm"] == pytest.approx(0.1, rel=0.02)
    # three times as curved on the lower half, which has few vertices
    ball = uneven(sphere(RADIUS))
    same = np.full(len(ball.vertices), 0.1)
    more = np.where(ball.vertices[:, 2] < 0, 0.3, 0.1)
    against = curvature_differences(
        PreparedSurface(ball, more, more), PreparedSurface(ball, same, same)
    )
    assert against["curvature_rms_ratio"] == pytest.approx(np.sqrt(5), rel=0.02)
    assert against["curvature_distance_per_mm"] == pytest.approx(0.1, rel=0.04)


def test_cortices_of_two_balls_overlap_by_their_common_shell():
    # the outer 2 mm of balls of 20 and 21 mm share those from 19 to 20 mm
    shared, *whole = (
        (far**3 - near**3) for near, far in ((19, 20), (18, 20), (19, 21))
    )
    larger = TriangleMesh(SMOOTH.vertices * 21 / 20, SMOOTH.faces)
    assert cortex_dice(SMOOTH, larger) == pytest.approx(
        2 * shared / sum(whole), abs=0.04
    )
    assert cortex_dice(SMOOTH, SMOOTH) == 1.0


def test_curvature_of_single_edges_is_clipped():
    prepared = PreparedSurface(
        SMOOTH, np.full(len(SMOOTH.vertices), -7.0), np.zeros(len(SMOOTH.vertices))
    )
    assert prepared.curvature_rms == pytest.approx(1.0)
