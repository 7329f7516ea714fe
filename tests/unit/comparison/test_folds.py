import numpy as np
import pytest
import trimesh

from gyriflow.comparison.shapes import Shape, against_real, cortex_dice, fold_measures, length_over_width, sulci
from gyriflow.geometry.triangles import TriangleMesh

BALL = trimesh.creation.icosphere(subdivisions=5, radius=30.0)
SPHERE = TriangleMesh(BALL.vertices, BALL.faces)
X, Y, Z = SPHERE.vertices.T


def shape(shape_index: np.ndarray, mean: np.ndarray | float = 1 / 30) -> Shape:
    return Shape(SPHERE, np.broadcast_to(np.asarray(mean, dtype=float), shape_index.shape), shape_index)


def strip(half_width: float, half_length: float) -> np.ndarray:
    """Returns a shape index of −0.5 in a strip on the equator, 1 elsewhere."""
    inside = (np.abs(Z) < half_width) & (np.abs(np.arctan2(Y, X)) * 30 < half_length)
    return np.where(inside, -0.5, 1.0)


def test_a_ball_has_the_least_area_and_one_curvature():
    found = fold_measures(shape(np.ones(len(X))))
    assert found["relative_area"] == pytest.approx((36 * np.pi) ** (1 / 3), rel=1e-3)
    assert found["curvature_rms_per_mm"] == pytest.approx(1 / 30)
    assert found["curvature_q05_per_mm"] == found["curvature_q95_per_mm"] == pytest.approx(1 / 30)
    assert found["sulci"] == 0
    assert np.isnan(found["sulcal_length_over_width"])
    assert np.isnan(found["pits_per_trough"])


def test_pits_and_troughs_are_counted_by_area():
    # caps of a sphere: shares of the area are shares of the height
    index = np.select([Z > 18, Z > 6], [-0.8, -0.5], 1.0)
    found = fold_measures(shape(index))
    assert found["pit_share"] == pytest.approx(12 / 60, abs=0.01)
    assert found["trough_share"] == pytest.approx(12 / 60, abs=0.01)
    assert found["pits_per_trough"] == pytest.approx(1.0, abs=0.05)


def test_quantiles_and_distance_of_curvature():
    half = np.where(Z > 0, 0.1, -0.1)
    found = fold_measures(shape(np.ones(len(X)), half))
    assert found["curvature_q05_per_mm"] == pytest.approx(-0.1)
    assert found["curvature_q95_per_mm"] == pytest.approx(0.1)
    ones = np.ones(len(X))
    against = against_real(shape(ones, 2 * half), shape(ones, half))
    assert against["curvature_rms_ratio"] == pytest.approx(2.0)
    assert against["curvature_distance_per_mm"] == pytest.approx(0.1, rel=0.02)


def test_long_troughs_are_told_from_round_dimples():
    lengths, areas = sulci(SPHERE, strip(3.0, 40.0))
    assert len(areas) == 1
    assert lengths[0] == pytest.approx(80, rel=0.1)
    assert areas[0] == pytest.approx(480, rel=0.2)
    assert length_over_width(lengths, areas) == pytest.approx(80 / 6, rel=0.3)
    dimple = sulci(SPHERE, np.where(X > 29, -0.9, 1.0))
    assert 1.2 < length_over_width(*dimple) < 1.9


def test_two_sulci_are_two_and_specks_are_none():
    index = np.minimum(strip(2.0, 20.0), np.where(X < -29, -0.9, 1.0))
    lengths, areas = sulci(SPHERE, index)
    assert len(areas) == 2
    assert lengths.max() == pytest.approx(40, rel=0.15)
    one_face = np.ones(len(X))
    one_face[SPHERE.faces[0]] = -0.5
    assert len(sulci(SPHERE, one_face)[0]) == 0


def test_cortices_overlap_as_far_as_their_surfaces_are_the_same():
    # the outer 2 mm of balls of 30 and 31 mm share those from 29 to 30 mm
    shared, *whole = ((far**3 - near**3) for near, far in ((29, 30), (28, 30), (29, 31)))
    larger = TriangleMesh(SPHERE.vertices * 31 / 30, SPHERE.faces)
    assert cortex_dice(SPHERE, larger) == pytest.approx(2 * shared / sum(whole), abs=0.04)
    assert cortex_dice(SPHERE, SPHERE) == 1.0
