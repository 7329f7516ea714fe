"""Surfaces prepared for comparison, how strongly they are folded, and how their
cortices overlap."""

import numpy as np
import pytest
from facts import Facts
from shapes import sphere, uneven

from gyriflow.compare.shapes import (
    EDGE_MM,
    PreparedSurface,
    cortex_dice,
    curvature_differences,
    prepare_for_comparison,
)
from gyriflow.errors import InputError
from gyriflow.geometry.remeshing import remesh
from gyriflow.geometry.triangles import (
    TriangleMesh,
    flipped,
    mean_edge_length,
)

from .bumpy import RADIUS, REAL, SMOOTH


def test_surfaces_without_a_volume_are_refused():
    with pytest.raises(InputError, check=Facts("-7437", "7437", "mm³")):
        prepare_for_comparison(flipped(REAL), REAL)


def test_even_triangles_stay_and_others_are_remeshed():
    even = remesh(sphere(RADIUS), EDGE_MM)
    assert prepare_for_comparison(even, even).mesh is even
    # the edges of one that grows to four times the volume are too long
    grown = TriangleMesh(1.6 * even.vertices, even.faces)
    prepared = prepare_for_comparison(even, grown).mesh
    assert len(prepared.vertices) > 2 * len(even.vertices)
    assert mean_edge_length(prepared) == pytest.approx(EDGE_MM, rel=0.05)


def test_differences_of_curvature_are_weighted_by_area():
    # three times as curved on the lower half, which has few vertices
    ball = uneven(sphere(RADIUS))
    same = np.full(len(ball.vertices), 0.1)
    more = np.where(ball.vertices[:, 2] < 0, 0.3, 0.1)
    found = curvature_differences(
        PreparedSurface(ball, more, more), PreparedSurface(ball, same, same)
    )
    assert found["curvature_rms_ratio"] == pytest.approx(np.sqrt(5), rel=0.02)
    assert found["curvature_distance_per_mm"] == pytest.approx(0.1, rel=0.04)


def test_curvature_of_single_edges_is_clipped():
    values = np.array([-7.0, 0.5, 3.0])
    prepared = PreparedSurface(SMOOTH, values, values)
    assert prepared.mean_curvature.tolist() == [-1.0, 0.5, 1.0]


def test_cortices_of_two_balls_overlap_by_their_common_shell():
    # the outer 2 mm of balls of 12 and 13 mm share those from 11 to 12 mm
    shared, first, second = (
        far**3 - near**3 for near, far in ((11, 12), (10, 12), (11, 13))
    )
    larger = TriangleMesh(SMOOTH.vertices * 13 / 12, SMOOTH.faces)
    dice = 2 * shared / (first + second)
    assert cortex_dice(SMOOTH, larger) == pytest.approx(dice, abs=0.04)
