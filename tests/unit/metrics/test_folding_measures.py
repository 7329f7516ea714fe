"""Integrals of curvature on surfaces whose curvature is known."""

import numpy as np
import pytest

from gyriflow.geometry.triangles import Floats, TriangleMesh, vertex_areas
from gyriflow.metrics.curvature import Curvature, curvature
from gyriflow.metrics.folding_measures import (
    folding_index,
    gaussian_curvature_norm,
    intrinsic_curvature_index,
    join,
    mean_curvature_norm,
    mean_curvature_quantiles,
)

LARGE, SMALL = 18.0, 7.0
ANGLES = 2 * np.pi * (np.arange(400) + 0.5) / 400


def torus() -> tuple[Curvature, Floats]:
    """Returns the curvature of a torus at 400 angles round its tube, and the area of each ring."""
    from_axis = LARGE + SMALL * np.cos(ANGLES)
    around, along = np.full(400, 1 / SMALL), np.cos(ANGLES) / from_axis
    areas = 2 * np.pi * from_axis * SMALL * (2 * np.pi / 400)
    bend = Curvature(np.maximum(around, along), np.minimum(around, along), np.ones(400, bool), np.ones(400))
    return bend, areas


def torus_mesh(around: int = 60, along: int = 150) -> TriangleMesh:
    i, j = np.meshgrid(np.arange(along), np.arange(around), indexing="ij")
    a, b = 2 * np.pi * i.ravel() / along, 2 * np.pi * j.ravel() / around
    far = LARGE + SMALL * np.cos(b)
    corner = [((i + di) % along * around + (j + dj) % around).ravel() for di, dj in ((0, 0), (1, 0), (1, 1), (0, 1))]
    faces = np.concatenate(
        [np.column_stack([corner[0], corner[1], corner[2]]), np.column_stack([corner[0], corner[2], corner[3]])]
    )
    return TriangleMesh(np.column_stack([far * np.cos(a), far * np.sin(a), SMALL * np.sin(b)]), faces)


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


MEASURES = {
    function.__name__: function
    for function in (intrinsic_curvature_index, mean_curvature_norm, gaussian_curvature_norm, folding_index)
}


@pytest.mark.parametrize("name", MEASURES)
def test_measures_of_a_torus(name: str) -> None:
    assert MEASURES[name](*torus()) == pytest.approx(expected()[name], rel=1e-3)


@pytest.mark.parametrize("name", MEASURES)
def test_measures_of_a_meshed_torus(name: str) -> None:
    mesh = torus_mesh()
    assert MEASURES[name](curvature(mesh, radius_mm=2.5), vertex_areas(mesh)) == pytest.approx(
        expected()[name], rel=0.06
    )


@pytest.mark.parametrize(("name", "value"), list(zip(MEASURES, (1.0, 1.0, 1.0, 0.0), strict=True)))
@pytest.mark.parametrize("radius", [5.0, 40.0])
def test_measures_of_a_sphere_know_no_size(name: str, value: float, radius: float) -> None:
    areas = np.full(10, 4 * np.pi * radius**2 / 10)
    bend = Curvature(*np.full((2, 10), 1 / radius), np.ones(10, bool), np.ones(10))
    assert MEASURES[name](bend, areas) == pytest.approx(value, abs=1e-12)


def test_a_cylinder_folds_but_has_no_intrinsic_curvature() -> None:
    # κ = 1/r and 0, area 2πrh: FI = 1/4π · h 2π/r = h/2r, inwards as outwards
    for sign in (1.0, -1.0):
        pair = np.sort([np.full(8, sign / 4.0), np.zeros(8)], axis=0)
        bend, areas = Curvature(pair[1], pair[0], np.ones(8, bool), np.ones(8)), np.full(8, 2 * np.pi * 4.0 * 10.0 / 8)
        assert folding_index(bend, areas) == pytest.approx(10.0 / 8.0)
        assert intrinsic_curvature_index(bend, areas) == 0.0


def test_quantiles_go_by_area() -> None:
    values = np.array([-0.2, 0.0, 0.1, 0.3])
    bend = Curvature(values, values, np.ones(4, bool), np.ones(4))
    found = mean_curvature_quantiles(bend, np.array([10.0, 40.0, 40.0, 10.0]))
    assert list(found.values()) == [-0.2, 0.0, 0.0, 0.1, 0.3]
    assert list(found) == [f"mean_curvature_q{share}" for share in ("05", "25", "50", "75", "95")]


def test_two_surfaces_add_up() -> None:
    bend, areas = torus()
    both = join([bend, bend])
    assert folding_index(both, np.tile(areas, 2)) == pytest.approx(2 * folding_index(bend, areas))
