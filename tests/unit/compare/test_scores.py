"""Scores of a calibration: 0 for the same brain, and growing with what differs."""

import sys
from pathlib import Path

import numpy as np
import pytest

from gyriflow.compare.scores import shape_scores, size_score
from gyriflow.geometry.triangles import TriangleMesh

sys.path.insert(0, str(Path(__file__).parent))
from bumpy import bumpy, shaped

NAMES = ("shape_index", "mean_curvature", "curvature_distribution")


def test_the_same_brain_has_the_score_0():
    shape = shaped(bumpy(1))
    assert shape_scores(shape, shape, NAMES) == pytest.approx(dict.fromkeys(NAMES, 0.0), abs=1e-9)
    assert size_score(shape.mesh, shape.mesh) == 0


def test_other_folds_of_the_same_height_differ_in_place_and_not_in_distribution():
    one, same, other = shaped(bumpy(1)), shaped(bumpy(1, height=1.05)), shaped(bumpy(2))
    near, far = shape_scores(same, one, NAMES), shape_scores(other, one, NAMES)
    assert near["shape_index"] < 0.1 < far["shape_index"]
    assert near["mean_curvature"] < 0.1 < far["mean_curvature"]
    flat = shape_scores(shaped(bumpy(1, height=0.05)), one, NAMES)
    assert flat["curvature_distribution"] > 3 * far["curvature_distribution"]


def test_a_brain_scaled_by_a_tenth_differs_in_area_and_volume():
    mesh = bumpy(1)
    larger = TriangleMesh(1.1 * mesh.vertices, mesh.faces)
    assert size_score(larger, mesh) == pytest.approx(np.hypot(1.1**2 - 1, 1.1**3 - 1))
