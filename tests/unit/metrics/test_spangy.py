"""Spectra that are known: modes of a rectangle and a sphere; bands, their powers, and
distances of spectra."""

import numpy as np
import pandas as pd
import pytest
from facts import Facts
from scipy import linalg, sparse
from shapes import ellipsoid, moved, rigid, sphere

from gyriflow.errors import MeshError, SolverError
from gyriflow.geometry.remeshing import remesh
from gyriflow.geometry.triangles import TriangleMesh, area, merged, vertex_areas
from gyriflow.metrics import laplace_beltrami, spangy
from gyriflow.metrics.laplace_beltrami import first_eigenvalue, laplacian, lowest_modes
from gyriflow.metrics.spangy import (
    OPEN_AND_CLOSED,
    PART_POWERS,
    Basis,
    spectral_basis,
    spectral_distances,
    spectrum,
)

AXES = (35.0, 25.0, 20.0)


def test_bands_are_half_open() -> None:
    # the second is λ1, as solved a second time
    lowest = [0.0, 2.0 - 4e-9, 7.999, 8.0, 31.0, 32.0]
    values = np.array([*lowest, 2.0 * 4**5, 2.0 * 4**6 - 1e-9, 2.0 * 4**6])
    empty = sparse.csc_matrix((1, 1))
    basis = Basis(values, np.empty((1, 9)), empty, empty, 2.0, 2.0 * 4**6, False)
    np.testing.assert_array_equal(basis.band, [0, 1, 1, 2, 2, 3, 6, 6, -1])


def test_parseval_with_all_modes() -> None:
    mesh = ellipsoid(AXES, 2)
    basis = spectral_basis(mesh, len(mesh.vertices), "consistent")
    proxy = np.random.default_rng(1).standard_normal(len(mesh.vertices))
    found = spectrum(proxy, basis, radius_mm=1.0)
    assert found.captured == pytest.approx(1.0, rel=1e-10)
    beyond = np.sum(found.coefficients[found.band == -1] ** 2)
    total = proxy @ (laplacian(mesh, "consistent")[1] @ proxy)
    assert np.nansum(found.bands["power"]) + beyond == pytest.approx(total, rel=1e-10)


def test_a_sphere_has_its_degrees_in_the_bands() -> None:
    # λ = l(l + 1)/R² and λ1 = 2/R²: B1 holds l = 1 and 2, B2 l = 3 to 5, B3 l = 6 to
    # 10, of 2l + 1 modes each
    mesh = sphere(20.0)
    x, y, z = (mesh.vertices / 20.0).T
    basis = spectral_basis(mesh, 130)
    harmonics = {
        1: (z, x * y),
        2: (5 * z**3 - 3 * z, x**4 - 6 * x**2 * y**2 + y**4),
        3: (z**6 * 231 - z**4 * 315 + z**2 * 105 - 5,),
    }
    for band, proxies in harmonics.items():
        for proxy in proxies:
            bands = spectrum(proxy, basis, radius_mm=1.0).bands
            assert bands["relative_power"][band] > 0.99
    assert bands["modes"][:4].tolist() == [1, 8, 27, 85]
    wavelengths = 2 * np.pi * 20.0 / np.sqrt(2.0) / 2.0 ** np.arange(7)
    np.testing.assert_allclose(
        bands["wavelength_min_mm"][1:], wavelengths[1:], rtol=5e-3
    )
    assert bands["complete"].tolist() == [True] * 4 + [False] * 3
    # 3.05 radii to the middle wave of a band
    is_resolved = wavelengths[:-1] / 2**0.5 >= 3.05
    assert bands["resolved"][1:].tolist() == is_resolved.tolist()


# 642 vertices are fewer than twice the modes up to B5
@pytest.mark.parametrize(("choice", "number"), [("B5", 642 // 2), (300, 300)])
def test_how_many_modes_of_a_sphere_are_taken(choice, number: int) -> None:
    assert len(spectral_basis(sphere(20.0, 3), choice).eigenvalues) == number


def written(
    subject: str, run: str, waves: dict[float, float], longest: float = 64.0, **columns
) -> pd.DataFrame:
    """Return the table of a hemisphere with the powers of waves of these lengths in mm,
    and L in mm.

    `cut_off` and `coarse` are the first bands that are incomplete or unresolved.
    """
    bands = np.arange(7)
    powers = np.zeros(6 * 16)
    for wavelength, power in waves.items():
        powers[int(16 * np.log2(longest / wavelength))] += power
    table = pd.DataFrame({"subject": subject, "run": run, "week": 22.0, "band": bands})
    table[PART_POWERS] = np.vstack([np.full(16, np.nan), powers.reshape(6, 16)])
    return table.assign(
        hemisphere="left",
        proxy="mean_curvature",
        wavelength_max_mm=longest / 2.0 ** np.maximum(bands - 1, 0),
        complete=bands < columns.get("cut_off", 7),
        resolved=bands < columns.get("coarse", 7),
        is_open=columns.get("is_open", False),
    )


def distances(simulated: pd.DataFrame, observed: pd.DataFrame) -> pd.DataFrame:
    return spectral_distances(pd.concat([simulated, observed])).query("run == 'sim'")


EVEN = {50.0: 1.0, 20.0: 1.0, 6.0: 2.0}


@pytest.mark.parametrize(
    ("own", "other", "flags"),
    [
        ({}, {}, ["ok"] * 3),
        ({"cut_off": 5}, {"cut_off": 6}, ["ok", "B5 cut off", "B5 B6 cut off"]),
        ({"coarse": 6}, {"coarse": 5}, ["ok", "B5 not resolved", "B5 B6 not resolved"]),
        ({"is_open": True}, {}, [OPEN_AND_CLOSED] * 3),
        ({"is_open": True}, {"cut_off": 6}, [OPEN_AND_CLOSED] * 2 + ["B6 cut off"]),
    ],
)
def test_distances_say_which_bands_they_miss_and_whether_a_hemisphere_is_open(
    own, other, flags
) -> None:
    rows = distances(
        written("a", "sim", EVEN, **own),
        written("b", "observed", {40.0: 1.0, 6.0: 1.0}, **other),
    )
    ends = ("B4", "B4_to_B5", "B4_to_B6")
    assert rows["metric"].tolist() == [f"spectral_distance_{end}" for end in ends]
    assert rows["flag"].tolist() == flags
    is_known = [flag in ("ok", OPEN_AND_CLOSED) for flag in flags]
    assert rows["value"].notna().tolist() == is_known


@pytest.mark.parametrize(
    ("own", "other", "longest", "expected"),
    [
        # a quarter by an octave and a half, and as a share: not the amount of power
        (
            {40.0: 3.0, 30.0: 1.0},
            {40.0: 6.0, 30.0 / 2**1.5: 2.0},
            64.0,
            [0.375, 0.375, 0.375],
        ),
        # beyond the end of B4, 4 mm, only the longer distances see it
        (
            {40.0: 3.0, 3.0: 1.0},
            {40.0: 3.0},
            64.0,
            [0.0, 0.25 * np.log2(40 / 3), 0.25 * np.log2(40 / 3)],
        ),
        # 8 mm is the border of B3 and B4 of 64 mm; in another L, bands lie elsewhere
        ({8.1: 1.0, 20.0: 1.0}, {7.9: 1.0, 20.0: 1.0}, 60.0, [0.0, 0.0, 0.0]),
    ],
)
def test_a_distance_is_how_many_octaves_power_has_to_be_moved(
    own, other, longest, expected
) -> None:
    rows = distances(written("a", "sim", own), written("b", "observed", other, longest))
    np.testing.assert_allclose(rows["value"], expected, atol=0.05)


def test_hemispheres_are_compared_with_the_same_side_of_other_observed_brains() -> None:
    right = written("b", "observed", EVEN).assign(hemisphere="right")
    known = [written("a", "observed", EVEN), written("b", "observed", EVEN), right]
    table = spectral_distances(pd.concat([written("a", "sim", EVEN), *known]))
    names = table[["subject", "run", "hemisphere", "observed"]]
    pairs = names.drop_duplicates().agg(" ".join, axis=1)
    assert sorted(pairs) == [
        "a observed left b",
        "a sim left a",
        "a sim left b",
        "b observed left a",
    ]
    assert set(table["observed_week"]) == {22.0}


@pytest.mark.parametrize(("mass", "error"), [("mean", 0.002), ("consistent", 0.06)])
def test_the_mean_of_both_mass_matrices_makes_eigenvalues_exact(mass, error) -> None:
    # degree 12 on a sphere with seven edges per wave
    stiffness, matrix = laplacian(sphere(20.0), mass)
    values = lowest_modes(stiffness, matrix, 13**2).eigenvalues
    ratio = values[12**2 :].mean() / (12 * 13 / 20.0**2)
    assert ratio == pytest.approx(1.0, abs=error)
    assert mass == "mean" or ratio > 1.02


def waves(mesh: TriangleMesh, degree: int) -> np.ndarray:
    """Return a harmonic of a degree, in no direction of the mesh, at the vertices of a
    sphere round 0."""
    x, y, z = (rigid(20, -50, 35)[:3, :3] @ mesh.vertices.T) / np.linalg.norm(
        mesh.vertices, axis=1
    )
    return np.real((x + 1j * y) ** degree) + z * np.imag((x + 1j * y) ** (degree - 1))


def uneven_sphere(subdivisions: int) -> TriangleMesh:
    """Return a sphere of 20 mm whose vertices are twice as dense on one side, and moved
    at random."""
    ball = sphere(1.0, subdivisions)
    noise = np.random.default_rng(2).standard_normal(ball.vertices.shape)
    points = ball.vertices + [0.4, 0.1, 0.0] + 0.1 * 2.0**-subdivisions * noise
    radius = np.linalg.norm(points, axis=1)[:, None]
    return TriangleMesh(20.0 * points / radius, ball.faces)


@pytest.mark.parametrize(("subdivisions", "has_copy"), [(4, False), (5, True)])
def test_power_of_waves_is_their_squared_integral_on_uneven_vertices_and_on_a_copy(
    subdivisions, has_copy, monkeypatch
) -> None:
    if not has_copy:
        monkeypatch.setattr(spangy, "WORTHWHILE", 0.0)
    mesh = uneven_sphere(subdivisions)
    basis = spectral_basis(mesh, "B3")
    assert (basis.places.shape[1] < 0.8 * len(mesh.vertices)) == has_copy
    # degree 8 is in the middle of B3, degree 3 in B2; ∫ of squares by a fine sphere
    slow, fast = 0.7 * waves(mesh, 3), waves(mesh, 8)
    fine = sphere(20.0, 5)
    areas = vertex_areas(fine)
    exact = np.array([areas @ (0.7 * waves(fine, 3)) ** 2, areas @ waves(fine, 8) ** 2])
    found = spectrum(slow + fast, basis, radius_mm=1.0)
    assert found.bands["power"][2:4].to_numpy() == pytest.approx(exact, rel=0.015)
    shares = found.bands["relative_power"][2:4].to_numpy()
    assert shares == pytest.approx(exact / exact.sum(), rel=0.01)
    assert found.bands["modes"].tolist() == [1, 8, 27, 85, 0, 0, 0]
    assert found.captured == pytest.approx(1.0, abs=0.01)
    # all of it where the wave is, by parts of an octave: λ8/λ1 = 36, half of log2 of
    # that is 2.58
    parts = found.bands.loc[1:, PART_POWERS].to_numpy(dtype=float).ravel()
    near = int(16 * 0.5 * np.log2(36)) + np.arange(-1, 2)
    assert parts[near].sum() == pytest.approx(exact[1], rel=0.02)
    # the band that adds most, with the sign of the waves; B1 adds nothing
    added = np.stack([0.0 * slow, slow, fast])
    expected = np.where(
        slow + fast > 0, 1 + added.argmax(axis=0), -1 - added.argmin(axis=0)
    )
    is_same = found.dominant_band == expected
    assert np.average(is_same, weights=vertex_areas(mesh)) > 0.97


def test_the_copy_for_long_waves_has_edges_short_enough_for_sulci() -> None:
    mesh = sphere(20.0, 5)
    copy_vertices = spectral_basis(mesh, 20).places.shape[1]
    assert copy_vertices < 0.8 * len(mesh.vertices)
    # of the even triangles that so many vertices have; the waves are 28 mm long
    edge_mm = np.sqrt(area(mesh) / copy_vertices / np.sqrt(0.75))
    assert edge_mm == pytest.approx(1.5, abs=0.05)


def test_rounding_never_cuts_a_band_off() -> None:
    mesh = remesh(ellipsoid(AXES), 3.0)
    for number in range(3):
        noise = np.random.default_rng(number).standard_normal(mesh.vertices.shape)
        shaken = TriangleMesh(mesh.vertices + 1e-3 * noise, mesh.faces)
        basis = spectral_basis(shaken, "B3")
        bands = spectrum(mesh.vertices[:, 0] ** 2, basis, radius_mm=1.0).bands
        assert bands["complete"].tolist() == [True] * 4 + [False] * 3
        assert bands["denominator_complete"].all()


def test_a_band_that_is_cut_off_dominates_nowhere() -> None:
    shape = ellipsoid(AXES, 3)
    basis = spectral_basis(shape, 200)
    slow, cut = (
        basis.functions[:, np.flatnonzero(basis.band == band)[1]] for band in (2, 4)
    )
    found = spectrum(slow + 10.0 * cut, basis, radius_mm=1.0)
    assert not found.bands["complete"][4]
    assert set(np.abs(found.dominant_band)) <= {1, 2, 3}
    few = spectral_basis(shape, 3)
    np.testing.assert_array_equal(spectrum(slow, few, radius_mm=1.0).dominant_band, 0)


def test_slices_equal_the_solution_as_a_whole(monkeypatch) -> None:
    monkeypatch.setattr(laplace_beltrami, "DENSE_VERTICES", 0)
    stiffness, mass = laplacian(ellipsoid(AXES, 3))
    modes = lowest_modes(stiffness, mass, 250)
    whole = linalg.eigh(stiffness.toarray(), mass.toarray(), eigvals_only=True)
    np.testing.assert_allclose(modes.eigenvalues[1:], whole[1:250], rtol=1e-8)
    # modes of two slices are orthogonal to the tolerance of the solver over the
    # distance of their eigenvalues
    identity = modes.functions.T @ (mass @ modes.functions)
    np.testing.assert_allclose(identity, np.eye(250), atol=1e-3)


@pytest.mark.parametrize("wrong", [-1, 1])
def test_modes_other_than_the_inertia_counts_are_an_error(monkeypatch, wrong) -> None:
    stiffness, mass = laplacian(ellipsoid(AXES))
    counted = laplace_beltrami.count_below
    monkeypatch.setattr(
        laplace_beltrami, "count_below", lambda *arguments: counted(*arguments) + wrong
    )
    with pytest.raises(SolverError, check=Facts(27, 27 + wrong)):
        lowest_modes(stiffness, mass, 20)


def test_surfaces_without_a_spectrum_are_refused() -> None:
    ball = ellipsoid(AXES, 2)
    two_pieces = laplacian(merged(ball, moved(ball, 100.0)))
    with pytest.raises(MeshError, match="one piece"):
        first_eigenvalue(*two_pieces)
    with pytest.raises(SolverError, check=Facts(163, 1, 162)):
        lowest_modes(*laplacian(ball), 163)
    loose_vertex = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [5, 5, 5]]
    with pytest.raises(MeshError, check=Facts(1)):
        laplacian(TriangleMesh(loose_vertex, [[0, 1, 2]]))
