"""Integrals of curvature on surfaces whose curvature is known."""

import numpy as np
import pytest
import shapes

from gyriflow.geometry.triangles import Floats, vertex_areas
from gyriflow.metrics.curvature import Curvature, curvature, curvature_integrals, mean_curvature_quantiles

LARGE, SMALL = 18.0, 7.0
ANGLES = 2 * np.pi * (np.arange(400) + 0.5) / 400


def torus() -> tuple[Curvature, Floats]:
    """Returns the curvature of a torus at 400 angles round its tube, and the area of each ring."""
    from_axis = LARGE + SMALL * np.cos(ANGLES)
    around, along = np.full(400, 1 / SMALL), np.cos(ANGLES) / from_axis
    areas = 2 * np.pi * from_axis * SMALL * (2 * np.pi / 400)
    bend = Curvature(np.maximum(around, along), np.minimum(around, along), np.ones(400, bool), np.ones(400))
    return bend, areas


def expected() -> dict[str, float]:
    """Returns the measures of the torus: c = R/r; the outer half of a torus has ∫K dA = 4π, as a sphere."""
    c = LARGE / SMALL
    ring = np.cos(ANGLES) / (c + np.cos(ANGLES))  # r times the smaller principal curvature
    weight = c + np.cos(ANGLES)
    return {
        "intrinsic_curvature_index": 1.0,
        "mean_curvature_norm": np.pi * c**2 / (4 * np.sqrt(c**2 - 1)),  # Willmore: ∫H² dA = π² c²/√(c² − 1)
        "gaussian_curvature_norm": np.sqrt(4 * np.pi**2 * c * 2 * np.pi * np.mean(ring**2 * weight) * 2 * np.pi)
        / (4 * np.pi),
        "folding_index": 2 * np.pi * 2 * np.pi * np.mean((1 - np.abs(ring)) * weight) / (4 * np.pi),
    }


def test_measures_of_a_torus() -> None:
    assert curvature_integrals(*torus()) == pytest.approx(expected(), rel=1e-3)
    mesh = shapes.torus(LARGE, SMALL, 150, 60)
    found = curvature_integrals(curvature(mesh, radius_mm=2.5), vertex_areas(mesh))
    assert found == pytest.approx(expected(), rel=0.06)


def test_a_cylinder_folds_but_has_no_intrinsic_curvature() -> None:
    # κ = 1/r and 0, area 2πrh: FI = 1/4π · h 2π/r = h/2r, inwards as outwards
    for sign in (1.0, -1.0):
        pair = np.sort([np.full(8, sign / 4.0), np.zeros(8)], axis=0)
        bend, areas = Curvature(pair[1], pair[0], np.ones(8, bool), np.ones(8)), np.full(8, 2 * np.pi * 4.0 * 10.0 / 8)
        found = curvature_integrals(bend, areas)
        assert found["folding_index"] == pytest.approx(10.0 / 8.0)
        assert found["intrinsic_curvature_index"] == 0.0


def test_quantiles_go_by_area() -> None:
    values = np.array([-0.2, 0.0, 0.1, 0.3])
    bend = Curvature(values, values, np.ones(4, bool), np.ones(4))
    found = mean_curvature_quantiles(bend, np.array([10.0, 40.0, 40.0, 10.0]))
    assert list(found.values()) == [-0.2, 0.0, 0.0, 0.1, 0.3]
    assert list(found) == [f"mean_curvature_q{share}" for share in ("05", "25", "50", "75", "95")]
