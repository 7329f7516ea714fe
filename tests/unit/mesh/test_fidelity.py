"""Distances between surfaces, faces that cross, and widths of gaps, where they are known."""

from functools import partial

import numpy as np
import pytest
import shapes
from shapes import moved, sphere

from gyriflow.geometry.matching import crossing_faces
from gyriflow.geometry.triangles import TriangleMesh, flipped, merged
from gyriflow.mesh.quality import fidelity, gap_kept, gap_summary, gap_walls

box = partial(shapes.box, subdivisions=3)


def pair(gap):
    return merged(box((4.0, 6.0, 6.0), (-2 - gap / 2, 0, 0)), box((4.0, 6.0, 6.0), (2 + gap / 2, 0, 0)))


def test_concentric_spheres_are_as_far_apart_as_their_radii():
    distance = fidelity(sphere(10.0), sphere(10.5))
    assert distance["hausdorff99"] == pytest.approx(0.5, abs=0.01)
    assert distance["hausdorff"] == pytest.approx(0.5, abs=0.01)


def test_both_directions_count():
    small = box((4.0, 4.0, 4.0))
    both = merged(small, box((4.0, 4.0, 4.0), (7.0, 0.0, 0.0)))
    # all of the small one lies on the other surface, whose second box is up to 7 mm from it
    forth, back = fidelity(small, both), fidelity(both, small)
    assert forth == back
    assert forth["hausdorff"] == pytest.approx(7.0)


def test_a_small_bump_counts_in_the_largest_distance_only():
    flat = box((10.0, 10.0, 10.0), subdivisions=4)
    vertices = np.array(flat.vertices)
    top = np.argmin(np.linalg.norm(vertices - [0, 0, 5], axis=1))
    vertices[top, 2] += 1.0
    distance = fidelity(TriangleMesh(vertices, flat.faces), flat)
    assert distance["hausdorff99"] < 1e-3
    assert distance["hausdorff"] == pytest.approx(1.0)


def test_faces_that_cross_are_counted_once_each():
    tetrahedron = TriangleMesh(
        [[0.0, 0, 0], [4, 0, 0], [0, 4, 0], [0, 0, 4]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
    )
    assert crossing_faces(tetrahedron) == 0
    assert crossing_faces(merged(tetrahedron, moved(tetrahedron, 10.0))) == 0
    # the tip of the second one, at (1, 1, 1.9), goes in through the slanted face of the first: that face and three more
    pointed = TriangleMesh(
        [[1.0, 1, 1.9], [5, 5, 6], [6, 5, 5], [5, 6, 5]], [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]]
    )
    assert crossing_faces(merged(tetrahedron, pointed)) == 4


def test_the_gap_between_two_boxes_has_its_width_and_area():
    found = gap_summary(gap_walls(pair(0.5)))
    assert found["percentile1"] == pytest.approx(0.5, abs=1e-3)
    assert found["median"] == pytest.approx(0.5, abs=1e-3)
    assert found["area_mm2"] == pytest.approx(2 * 36.0)


def test_walls_far_apart_or_thin_tissue_are_no_gap():
    assert gap_summary(gap_walls(pair(4.0))) == {"percentile1": None, "median": None, "area_mm2": 0.0}
    assert gap_kept(gap_walls(pair(4.0)), pair(0.1)) is None
    plate = box((0.5, 6.0, 6.0))
    assert gap_summary(gap_walls(plate))["area_mm2"] == 0.0
    # inside out, the same plate is a gap
    assert gap_summary(gap_walls(flipped(plate)))["median"] == pytest.approx(0.5, abs=1e-3)


# half of the width is the limit: 0.3 of 0.5 mm is open, 0.2 is not, nor are walls that overlap
@pytest.mark.parametrize(("left_open", "kept"), [(0.5, 1.0), (0.7, 1.0), (0.3, 1.0), (0.2, 0.0), (-0.1, 0.0)])
def test_a_gap_is_kept_where_half_of_its_width_is(left_open, kept):
    assert gap_kept(gap_walls(pair(0.5)), pair(left_open)) == kept


def test_the_share_of_a_gap_that_is_bridged_is_not_kept():
    # tissue fills the upper third of the gap
    bridged = merged(pair(0.5), box((0.5, 6.0, 2.0), (0, 0, 2.0)))
    assert gap_kept(gap_walls(pair(0.5)), bridged) == pytest.approx(2 / 3, abs=0.05)
