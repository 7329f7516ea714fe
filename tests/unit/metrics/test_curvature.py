"""Curvature of spheres, tori and waves, whose curvature is known, and its integrals."""

import logging

import numpy as np
import pytest
from facts import Facts
from shapes import sheet, sphere, torus

from gyriflow.errors import MeshError
from gyriflow.geometry.remeshing import remesh
from gyriflow.geometry.triangles import (
    Floats,
    TriangleMesh,
    flipped,
    mean_edge_length,
    merged,
    signed_volume,
    submesh,
    vertex_areas,
)
from gyriflow.metrics.curvature import (
    RESOLVED_RADII,
    Curvature,
    curvature,
    curvature_integrals,
    kept_curvature,
    mean_curvature_quantiles,
)


def torus_and_angle() -> tuple[TriangleMesh, np.ndarray]:
    """Return a torus of 20 and 8 mm and the (n,) angle across its tube, 0 at the outer
    rim."""
    mesh = torus(20.0, 8.0, 120, 60)
    return mesh, np.arctan2(
        mesh.vertices[:, 2], np.hypot(*mesh.vertices[:, :2].T) - 20.0
    )


@pytest.mark.parametrize(
    ("edge_mm", "noise_mm", "bound"),
    [(0.8, 0.0, 0.06), (1.2, 0.0, 0.06), (0.8, 0.05, 0.1)],
)
def test_irregular_triangles_of_any_density_give_equal_curvature_and_average_noise_out(
    edge_mm, noise_mm, bound
):
    large, small = 14.0, 5.0
    mesh = remesh(torus(large, small, 120, 60), edge_mm)
    around = (
        mesh.vertices * [1, 1, 0] * (large / np.hypot(*mesh.vertices[:, :2].T))[:, None]
    )
    outward = (mesh.vertices - around) / np.linalg.norm(mesh.vertices - around, axis=1)[
        :, None
    ]
    noise = noise_mm * np.random.default_rng(1).standard_normal((len(outward), 1))
    bend = curvature(
        TriangleMesh(around + (small + noise) * outward, mesh.faces), radius_mm=3.0
    )
    cosine = np.einsum("ij,ij->i", outward, around) / large
    exact = np.stack(
        [np.full(len(outward), 1 / small), cosine / (large + small * cosine)]
    )
    error = np.sqrt(
        np.mean((np.stack([bend.maximum, bend.minimum]) - exact) ** 2)
        / np.mean(exact**2)
    )
    assert error < bound


def test_torus() -> None:
    mesh, angle = torus_and_angle()
    assert signed_volume(mesh) > 0
    bend = curvature(mesh, radius_mm=2.2)
    along = np.cos(angle) / (20.0 + 8.0 * np.cos(angle))
    np.testing.assert_allclose(bend.maximum, 1 / 8, rtol=0.03)
    np.testing.assert_allclose(bend.minimum, along, atol=0.002)
    np.testing.assert_allclose(bend.gaussian, along / 8, atol=4e-4)
    np.testing.assert_allclose(bend.mean, 0.5 * (along + 1 / 8), rtol=0.05)
    # top and bottom of a torus are ridges: κ2 = 0, so the shape index is one half;
    # inside are saddles, outside caps
    np.testing.assert_allclose(
        bend.shape_index[np.isclose(angle, np.pi / 2)], 0.5, atol=0.01
    )
    assert (
        bend.shape_index[np.isclose(np.abs(angle), np.pi)].max()
        < 0.5
        < bend.shape_index[np.isclose(angle, 0)].min()
    )


def test_walls_of_a_narrow_sulcus_do_not_see_each_other() -> None:
    x, y = np.meshgrid(np.arange(30.0), np.arange(30.0), indexing="ij")
    lower = sheet(x, y, 0 * x)
    upper = flipped(sheet(x, y, 0 * x + 0.5))
    third = sheet(x, y, 1.0 + 0.01 * x**2)
    alone = curvature(lower, radius_mm=3.0)
    between = curvature(merged(lower, upper, third), radius_mm=3.0)
    np.testing.assert_allclose(
        between.maximum[: len(lower.vertices)], alone.maximum, atol=1e-12
    )
    np.testing.assert_allclose(alone.maximum, 0.0, atol=1e-12)


def test_a_ball_grows_to_two_edges_where_the_mesh_is_coarse(caplog) -> None:
    mesh = sphere(25.0, 3)
    length = mean_edge_length(mesh)
    with caplog.at_level(logging.WARNING):
        bend = curvature(mesh, radius_mm=1.5)
    assert caplog.messages == [Facts("1.5 mm", f"{2 * length:.3g} mm")]
    assert bend.radius_mm.mean() == pytest.approx(2 * length, rel=0.02)
    np.testing.assert_allclose(bend.mean, 1 / 25, rtol=0.03)
    caplog.clear()
    curvature(mesh, radius_mm=1.9 * length)
    assert not caplog.text
    assert (curvature(mesh, radius_mm=10.0).radius_mm == 10.0).all()
    assert not caplog.text


def test_loose_faces_have_no_curvature() -> None:
    scattered = np.arange(30.0).reshape(-1, 1, 1) * [50.0, 0.0, 0.0] + [
        [0, 0, 0],
        [1, 0, 0],
        [0, 1, 0],
    ]
    with pytest.raises(MeshError, check=Facts("90 of 90")):
        curvature(TriangleMesh(scattered.reshape(-1, 3), np.arange(90).reshape(-1, 3)))


def test_cut_changes_curvature_only_where_it_is_marked_unreliable() -> None:
    mesh, _ = torus_and_angle()
    whole = curvature(mesh, radius_mm=3.0)
    half, kept = submesh(mesh, mesh.vertices[mesh.faces].mean(axis=1)[:, 0] > 0)
    bend = curvature(half, radius_mm=3.0)
    assert np.isfinite(bend.minimum).all()
    np.testing.assert_allclose(
        bend.minimum[bend.reliable], whole.minimum[kept][bend.reliable], atol=1e-12
    )
    assert np.abs(bend.minimum - whole.minimum[kept])[~bend.reliable].max() > 1e-3
    # all within the radius of the two cuts, and nothing beyond
    from_cut = half.vertices[:, 0]
    assert not bend.reliable[from_cut < 1.5].any()
    assert bend.reliable[from_cut > 3.1].all()


@pytest.mark.parametrize(
    ("wavelength", "least", "most"),
    [(12.0, 0.95, 1.0), (7.9, 0.78, 0.88), (5.2, 0.3, 0.5)],
)
def test_folds_shorter_than_four_radii_are_flattened(wavelength, least, most):
    # folds a quarter as deep as long
    x, y = np.meshgrid(np.arange(70) * 0.5, np.arange(30) * 0.5, indexing="ij")
    k, height = 2 * np.pi / wavelength, wavelength / 8
    bend = curvature(sheet(x, y, height * np.cos(k * x)), radius_mm=3.0)
    stretch = np.sqrt(1 + (height * k * np.sin(k * x.ravel())) ** 2)
    exact = 0.5 * height * k**2 * np.cos(k * x.ravel()) / stretch**3
    inner = bend.reliable & (np.abs(x.ravel() - 17.25) < 12.0)
    found, expected = (
        np.sum((values**2 * stretch)[inner]) for values in (bend.mean, exact)
    )
    assert least < found / expected < most
    assert RESOLVED_RADII * 3.0 == 12.0


@pytest.mark.parametrize("edge", [0.25, 0.4])
@pytest.mark.parametrize("wavelength", [2.0, 3.05, 4.0, 6.0])
def test_shallow_waves_keep_the_share_of_the_closed_form(wavelength, edge):
    x, y = np.meshgrid(
        np.arange(0, 3 * wavelength + 2, edge), np.arange(0, 3, edge), indexing="ij"
    )
    wave = np.cos(2 * np.pi / wavelength * x)
    bend = curvature(sheet(x, y, 0.01 * wave), radius_mm=1.0)
    exact = 0.5 * 0.01 * (2 * np.pi / wavelength) ** 2 * wave.ravel()[bend.reliable]
    share = bend.mean[bend.reliable] @ exact / (exact @ exact)
    assert share == pytest.approx(
        kept_curvature(np.array(wavelength), bend.radius_mm.mean()), abs=0.04
    )


LARGE, SMALL = 18.0, 7.0
ANGLES = 2 * np.pi * (np.arange(400) + 0.5) / 400


def rings_of_a_torus() -> tuple[Curvature, Floats]:
    """Return the curvature of a torus at 400 angles round its tube, and the area of
    each ring."""
    from_axis = LARGE + SMALL * np.cos(ANGLES)
    around, along = np.full(400, 1 / SMALL), np.cos(ANGLES) / from_axis
    areas = 2 * np.pi * from_axis * SMALL * (2 * np.pi / 400)
    bend = Curvature(
        np.maximum(around, along),
        np.minimum(around, along),
        np.ones(400, bool),
        np.ones(400),
    )
    return bend, areas


def expected() -> dict[str, float]:
    """Return the measures of the torus: c = R/r; the outer half of a torus has ∫K dA =
    4π, as a sphere."""
    c = LARGE / SMALL
    # r times the smaller principal curvature
    ring = np.cos(ANGLES) / (c + np.cos(ANGLES))
    weight = c + np.cos(ANGLES)
    return {
        "intrinsic_curvature_index": 1.0,
        "mean_curvature_norm": (
            np.pi * c**2 / (4 * np.sqrt(c**2 - 1))
        ),  # Willmore: ∫H² dA = π² c²/√(c² − 1)
        "gaussian_curvature_norm": (
            np.sqrt(
                4 * np.pi**2 * c * 2 * np.pi * np.mean(ring**2 * weight) * 2 * np.pi
            )
            / (4 * np.pi)
        ),
        "folding_index": (
            2 * np.pi * 2 * np.pi * np.mean((1 - np.abs(ring)) * weight) / (4 * np.pi)
        ),
    }


def test_measures_of_a_torus() -> None:
    assert curvature_integrals(*rings_of_a_torus()) == pytest.approx(
        expected(), rel=1e-3
    )
    mesh = torus(LARGE, SMALL, 150, 60)
    found = curvature_integrals(curvature(mesh, radius_mm=2.5), vertex_areas(mesh))
    assert found == pytest.approx(expected(), rel=0.06)


def test_a_cylinder_folds_but_has_no_intrinsic_curvature() -> None:
    # κ = 1/r and 0, area 2πrh: FI = 1/4π · h 2π/r = h/2r, inwards as outwards
    for sign in (1.0, -1.0):
        pair = np.sort([np.full(8, sign / 4.0), np.zeros(8)], axis=0)
        bend = Curvature(pair[1], pair[0], np.ones(8, bool), np.ones(8))
        areas = np.full(8, 2 * np.pi * 4.0 * 10.0 / 8)
        found = curvature_integrals(bend, areas)
        assert found["folding_index"] == pytest.approx(10.0 / 8.0)
        assert found["intrinsic_curvature_index"] == 0.0


def test_quantiles_go_by_area() -> None:
    values = np.array([-0.2, 0.0, 0.1, 0.3])
    bend = Curvature(values, values, np.ones(4, bool), np.ones(4))
    found = mean_curvature_quantiles(bend, np.array([10.0, 40.0, 40.0, 10.0]))
    assert list(found.values()) == [-0.2, 0.0, 0.0, 0.1, 0.3]
    assert list(found) == [
        f"mean_curvature_q{share}" for share in ("05", "25", "50", "75", "95")
    ]
