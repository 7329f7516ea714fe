"""Deviation of an observed brain from the expected one: distances, areas and thickness that are known."""

import numpy as np
import pytest
from shapes import sphere

from gyriflow.compare.prediction import deviation_maps
from gyriflow.geometry.triangles import TriangleMesh

BALL = sphere(20.0)


def scaled(factors):
    return TriangleMesh(BALL.vertices * factors, BALL.faces)


def test_a_larger_ball_lies_outside_and_has_more_area():
    maps = deviation_maps(BALL, scaled(1.1))
    np.testing.assert_allclose(maps["distance_mm"], 2.0, atol=0.01)
    np.testing.assert_allclose(maps["log_area"], 2 * np.log(1.1), atol=1e-6)
    smaller = deviation_maps(BALL, scaled(0.9))
    assert (smaller["distance_mm"] < 0).all()
    assert (smaller["log_area"] < 0).all()


def test_what_deviates_in_one_place_does_so_there_alone():
    top = np.linalg.norm(BALL.vertices - [0, 0, 20], axis=1) < 12
    maps = deviation_maps(BALL, scaled(np.where(top, 1.1, 1.0)[:, None]))
    assert maps["distance_mm"][top] == pytest.approx(2.0, abs=0.05)
    assert not maps["distance_mm"][~top].any()
    pole, opposite = BALL.vertices[:, 2].argmax(), BALL.vertices[:, 2].argmin()
    assert maps["log_area"][pole] == pytest.approx(2 * np.log(1.1), abs=0.01)
    assert maps["log_area"][opposite] == pytest.approx(0.0, abs=0.01)


def test_areas_are_compared_after_a_gaussian_of_3_mm():
    degree, height = 8, 0.005
    wave = np.polynomial.Legendre.basis(degree)(BALL.vertices[:, 2] / 20)
    found = deviation_maps(BALL, scaled(1 + height * wave[:, None]))["log_area"]
    # heat over the time σ²/2 in eight implicit steps, along the sphere's own wave
    decay = (1 + degree * (degree + 1) / 20**2 * 3**2 / 2 / 8) ** -8
    assert found @ wave / (wave @ wave) == pytest.approx(2 * height * decay, rel=0.1)
