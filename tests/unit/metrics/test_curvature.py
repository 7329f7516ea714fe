"""Curvature of spheres, tori and waves, whose curvature is known, and its integrals."""

import logging

import numpy as np
import pytest
from facts import Facts
from shapes import sheet, sphere, torus

from gyriflow.errors import MeshError
from gyriflow.geometry.remeshing import remesh
from gyriflow.geometry.triangles import (
    TriangleMesh,
    flipped,
    mean_edge_length,
    merged,
    submesh,
    unit,
)
from gyriflow.metrics.curvature import (
    Curvature,
    curvature,
    curvature_metrics,
    kept_curvature,
)


@pytest.mark.parametrize(
    ("edge_mm", "noise_mm", "bound"), [(1.2, 0.0, 0.06), (0.8, 0.05, 0.1)]
)
def test_irregular_triangles_of_any_density_give_equal_curvature_and_average_noise_out(
    edge_mm, noise_mm, bound
):
    large, small = 14.0, 5.0
    mesh = remesh(torus(large, small, 120, 60), edge_mm)
    around = large * unit(mesh.vertices * [1, 1, 0])
    outward = unit(mesh.vertices - around)
    noise = noise_mm * np.random.default_rng(1).standard_normal((len(outward), 1))
    bend = curvature(
        TriangleMesh(around + (small + noise) * outward, mesh.faces), radius_mm=3.0
    )
    cosine = np.einsum("ij,ij->i", outward, around) / large
    along = cosine / (large + small * cosine)
    errors = np.stack([bend.maximum - 1 / small, bend.minimum - along])
    size = np.sqrt((1 / small**2 + np.mean(along**2)) / 2)
    assert np.sqrt(np.mean(errors**2)) < bound * size


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
    triangle = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]])
    scattered = triangle + np.arange(30.0).reshape(-1, 1, 1) * [50.0, 0.0, 0.0]
    with pytest.raises(MeshError, check=Facts("90 of 90")):
        curvature(TriangleMesh(scattered.reshape(-1, 3), np.arange(90).reshape(-1, 3)))


def test_cut_changes_curvature_only_where_it_is_marked_unreliable() -> None:
    mesh = torus(20.0, 8.0, 120, 60)
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
    ("wavelength", "edge"), [(2.0, 0.25), (3.05, 0.25), (3.05, 0.4), (6.0, 0.4)]
)
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


def test_a_cylinder_folds_but_has_no_intrinsic_curvature() -> None:
    # κ = 1/r and 0, area 2πrh: FI = 1/4π · h 2π/r = h/2r, inwards as outwards
    for sign in (1.0, -1.0):
        pair = np.sort([np.full(8, sign / 4.0), np.zeros(8)], axis=0)
        bend = Curvature(pair[1], pair[0], np.ones(8, bool), np.ones(8))
        areas = np.full(8, 2 * np.pi * 4.0 * 10.0 / 8)
        found = curvature_metrics(bend, areas)
        assert found["folding_index"] == pytest.approx(10.0 / 8.0)
        assert found["intrinsic_curvature_index"] == 0.0
