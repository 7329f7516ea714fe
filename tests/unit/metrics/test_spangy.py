"""Spectra that are known: modes of a rectangle, a torus and a sphere; bands, their
powers, and distances of spectra."""

import numpy as np
import pandas as pd
import pytest
from facts import Facts
from scipy import sparse
from scipy.sparse.linalg import eigsh
from shapes import ellipsoid, octasphere, rigid, sheet, sphere

from gyriflow.errors import MeshError, SolverError
from gyriflow.geometry.remeshing import remesh
from gyriflow.geometry.triangles import (
    TriangleMesh,
    area,
    merged,
    submesh,
    transformed,
    vertex_areas,
)
from gyriflow.metrics import laplace_beltrami, spangy
from gyriflow.metrics.curvature import kept_curvature
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


@pytest.fixture(scope="module")
def shape() -> TriangleMesh:
    return ellipsoid(AXES)


@pytest.fixture(scope="module")
def solved(shape: TriangleMesh) -> Basis:
    return spectral_basis(shape, 200)


def test_bands_are_half_open() -> None:
    # the second is λ1, as solved a second time
    values = np.array(
        [
            0.0,
            2.0 - 4e-9,
            7.999,
            8.0,
            31.0,
            32.0,
            2.0 * 4**5,
            2.0 * 4**6 - 1e-9,
            2.0 * 4**6,
        ]
    )
    nothing = sparse.csc_matrix((1, 1))
    band = Basis(
        values,
        np.empty((1, 9)),
        nothing,
        nothing,
        first=2.0,
        reach=2.0 * 4**6,
        is_open=False,
    ).band
    np.testing.assert_array_equal(band, [0, 1, 1, 2, 2, 3, 6, 6, -1])


def test_parseval_with_all_modes() -> None:
    mesh = ellipsoid(AXES, 2)
    basis = spectral_basis(mesh, len(mesh.vertices), "consistent")
    proxy = np.random.default_rng(1).standard_normal(len(mesh.vertices))
    found = spectrum(proxy, basis, radius_mm=1.0)
    assert found.captured == pytest.approx(1.0, rel=1e-10)
    beyond = np.sum(found.coefficients[found.band == -1] ** 2)
    total = proxy @ (laplacian(mesh, "consistent")[1] @ proxy)
    assert np.nansum(found.bands["power"]) + beyond == pytest.approx(total, rel=1e-10)


def test_relative_power_leaves_the_mean_out_and_sums_to_one(shape, solved) -> None:
    proxy = np.sin(shape.vertices[:, 0] / 4.0) + shape.vertices[:, 2] / 20.0
    tables = [
        spectrum(proxy + offset, solved, radius_mm=1.0).bands for offset in (0.0, 100.0)
    ]
    assert np.isnan(tables[0]["relative_power"][0])
    assert tables[0]["relative_power"].sum() == pytest.approx(1.0)
    # modes mix with the constant by less than 1e-7
    np.testing.assert_allclose(
        tables[0]["relative_power"], tables[1]["relative_power"], rtol=1e-3, atol=1e-5
    )
    assert tables[1]["power"][0] == pytest.approx(
        tables[0]["power"][0] + 100.0**2 * area(shape), rel=0.05
    )


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
            found = spectrum(proxy, basis, radius_mm=1.0)
            assert found.bands["relative_power"][band] > 0.99
    assert found.bands["modes"][:4].tolist() == [
        1,
        3 + 5,
        7 + 9 + 11,
        13 + 15 + 17 + 19 + 21,
    ]
    wavelengths = 2 * np.pi * 20.0 / np.sqrt(2.0) / 2.0 ** np.arange(7)
    np.testing.assert_allclose(
        found.bands["wavelength_min_mm"][1:], wavelengths[1:], rtol=5e-3
    )
    assert found.bands["complete"].tolist() == [
        True,
        True,
        True,
        True,
        False,
        False,
        False,
    ]
    # 3.05 radii to the middle wave of a band
    assert (
        found.bands["resolved"][1:].tolist()
        == (wavelengths[:-1] / 2**0.5 >= 3.05).tolist()
    )


def test_two_pieces_are_refused(shape) -> None:
    apart = transformed(
        shape, [[1, 0, 0, 100], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
    )
    pair = laplacian(merged(shape, apart))
    with pytest.raises(MeshError):
        first_eigenvalue(*pair)


@pytest.mark.parametrize(
    ("choice", "subdivisions", "number"),
    [
        # of 642 vertices, fewer than twice the modes up to B5
        ("B5", 3, 642 // 2),
        (300, 3, 300),
        # λ = l(l + 1)/R², λ1 = 2/R²: below 2·4⁴/R² lie l = 0 to 22, each 2l + 1 times,
        # the last by 1 %
        pytest.param("B4", 5, 23**2, marks=pytest.mark.slow),
    ],
)
def test_how_many_modes_of_a_sphere_are_taken(
    choice, subdivisions: int, number: int
) -> None:
    assert len(spectral_basis(sphere(20.0, subdivisions), choice).eigenvalues) == number


@pytest.mark.parametrize("last", [4, 6])
def test_bands_are_held_entirely_with_no_more_modes_than_needed(last: int) -> None:
    # elongated, so that few modes lie below 4⁶ λ1
    mesh = ellipsoid((4.0, 36.0, 4.0))
    basis = spectral_basis(mesh, f"B{last}")
    bands = spectrum(mesh.vertices[:, 1], basis, radius_mm=1.0).bands
    assert bands["complete"].tolist() == [band <= last for band in range(7)]
    assert bands["denominator_complete"].all()
    # no band holds a mode that only shows that the one before is complete
    assert bands.loc[last + 1 :, "modes"].tolist() == [0] * (6 - last)
    assert (basis.band >= 0).all()


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
    table = pd.DataFrame(
        {
            "subject": subject,
            "run": run,
            "week": 22.0,
            "hemisphere": "left",
            "band": bands,
        }
    )
    table = table.assign(
        proxy="mean_curvature",
        wavelength_max_mm=longest / 2.0 ** np.maximum(bands - 1, 0),
    )
    table[PART_POWERS] = np.vstack([np.full(16, np.nan), powers.reshape(6, 16)])
    table = table.assign(
        complete=bands < columns.get("cut_off", 7),
        resolved=bands < columns.get("coarse", 7),
    )
    return table.assign(is_open=columns.get("is_open", False))


def distances(own: pd.DataFrame, real: pd.DataFrame) -> pd.DataFrame:
    return spectral_distances(pd.concat([own, real], ignore_index=True)).query(
        "run == 'sim'"
    )


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
    assert rows["metric"].tolist() == [
        f"spectral_distance_{bands}" for bands in ("B4", "B4_to_B5", "B4_to_B6")
    ]
    assert rows["flag"].tolist() == flags
    assert rows["value"].isna().tolist() == [
        flag not in ("ok", OPEN_AND_CLOSED) for flag in flags
    ]
    assert set(
        zip(rows["observed"], rows["observed_week"], rows["unit"], strict=True)
    ) == {("b", 22.0, "octaves")}


def test_a_distance_is_how_many_octaves_power_has_to_be_moved() -> None:
    # a quarter of it by an octave and a half, and as a share: not the amount of power
    rows = distances(
        written("a", "sim", {40.0: 3.0, 30.0: 1.0}),
        written("b", "observed", {40.0: 6.0, 30.0 / 2**1.5: 2.0}),
    )
    np.testing.assert_allclose(rows["value"], 0.25 * 1.5, atol=0.02)
    # beyond the end of B4, 4 mm, only the longer distances see it
    rows = distances(
        written("a", "sim", {40.0: 3.0, 3.0: 1.0}),
        written("b", "observed", {40.0: 3.0}),
    )
    np.testing.assert_allclose(
        rows["value"], [0.0, 0.25 * np.log2(40 / 3), 0.25 * np.log2(40 / 3)], atol=0.03
    )


def test_a_distance_has_no_edges_between_bands() -> None:
    # 8 mm is the border of B3 and B4 where L is 64 mm; of another L, the same waves are
    # elsewhere in their bands
    for longest in (60.0, 64.0, 70.0):
        own = written("a", "sim", {8.1: 1.0, 20.0: 1.0})
        real = written("b", "observed", {7.9: 1.0, 20.0: 1.0}, longest)
        assert distances(own, real)["value"].iloc[0] < 0.1


def test_who_is_compared_with_whom() -> None:
    right = written("b", "observed", EVEN).assign(hemisphere="right")
    known = [written("a", "observed", EVEN), written("b", "observed", EVEN), right]
    table = spectral_distances(pd.concat([written("a", "sim", EVEN), *known]))
    pairs = (
        table["subject"]
        + " "
        + table["run"]
        + " "
        + table["hemisphere"]
        + ", "
        + table["observed"]
    )
    assert sorted(set(pairs)) == [
        "a observed left, b",
        "a sim left, a",
        "a sim left, b",
        "b observed left, a",
    ]
    assert len(table) == 3 * 4


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


def uneven(subdivisions: int) -> TriangleMesh:
    """Return a sphere of 20 mm whose vertices are twice as dense on one side, and moved
    at random."""
    points = sphere(1.0, subdivisions).vertices
    points = (
        points
        + [0.4, 0.1, 0.0]
        + 0.1
        * 2.0**-subdivisions
        * np.random.default_rng(2).standard_normal(points.shape)
    )
    points *= 20.0 / np.linalg.norm(points, axis=1)[:, None]
    return TriangleMesh(points, sphere(1.0, subdivisions).faces)


@pytest.mark.parametrize("subdivisions", [4, 5])
def test_power_of_a_wave_is_its_squared_integral_on_uneven_vertices_and_on_a_copy(
    subdivisions,
) -> None:
    mesh = uneven(subdivisions)
    # degree 8 is in the middle of B3; ∫ of the square of both parts by a fine sphere
    fine = sphere(20.0, 6)
    exact = (
        np.average(waves(fine, 8) ** 2, weights=vertex_areas(fine))
        * 4
        * np.pi
        * 20.0**2
    )
    basis = spectral_basis(mesh, "B3")
    assert (basis.places.shape[1] < 0.8 * len(mesh.vertices)) == (subdivisions == 5)
    found = spectrum(waves(mesh, 8), basis, radius_mm=1.0)
    assert found.bands["power"][3] == pytest.approx(exact, rel=0.01)
    assert found.bands["relative_power"][3] > 0.995
    assert found.bands["modes"].tolist() == [1, 8, 27, 85, 0, 0, 0]
    assert found.captured == pytest.approx(1.0, abs=0.01)
    # all of it where the wave is, by parts of an octave: λ8/λ1 = 36, half of log2 of
    # that is 2.58
    parts = found.bands.loc[1:, PART_POWERS].to_numpy(dtype=float).ravel()
    assert parts[int(16 * 0.5 * np.log2(36)) + np.arange(-1, 2)].sum() == pytest.approx(
        exact, rel=0.015
    )


def test_the_copy_for_long_waves_has_edges_short_enough_for_sulci() -> None:
    mesh = sphere(30.0, 5)
    copy_vertices = spectral_basis(mesh, 20).places.shape[1]
    assert copy_vertices < 0.8 * len(mesh.vertices)
    # of the even triangles that so many vertices have; the waves are 40 mm long
    edge_mm = np.sqrt(area(mesh) / copy_vertices / np.sqrt(0.75))
    assert edge_mm == pytest.approx(1.8, abs=0.05)


def test_a_copy_gives_the_same_dominant_bands(monkeypatch) -> None:
    mesh = uneven(5)
    proxy = waves(mesh, 8) + 0.7 * waves(mesh, 3) + 0.3
    copied = spectrum(proxy, spectral_basis(mesh, "B3"), radius_mm=1.0)
    monkeypatch.setattr(spangy, "WORTHWHILE", 0.0)
    full = spectrum(proxy, spectral_basis(mesh, "B3"), radius_mm=1.0)
    same = np.average(
        copied.dominant_band == full.dominant_band, weights=vertex_areas(mesh)
    )
    assert same > 0.97
    assert set(np.abs(full.dominant_band)) >= {2, 3}
    np.testing.assert_allclose(
        copied.bands["power"], full.bands["power"], rtol=0.01, atol=1e-3 * proxy @ proxy
    )


@pytest.mark.parametrize(
    ("edge_mm", "times"), [(2.0, 3), pytest.param(0.86, 8, marks=pytest.mark.slow)]
)
def test_rounding_never_cuts_a_band_off(edge_mm: float, times: int) -> None:
    mesh = remesh(ellipsoid(AXES, 5), edge_mm)
    for number in range(times):
        moved = mesh.vertices + 1e-3 * np.random.default_rng(number).standard_normal(
            mesh.vertices.shape
        )
        basis = spectral_basis(TriangleMesh(moved, mesh.faces), "B3")
        bands = spectrum(mesh.vertices[:, 0] ** 2, basis, radius_mm=1.0).bands
        assert bands["complete"].tolist() == [True] * 4 + [False] * 3
        assert bands["denominator_complete"].all()
        assert np.isfinite(bands.loc[1:3, "relative_power"]).all()


def test_a_surface_says_whether_it_is_open_and_how_much_curvature_it_keeps() -> None:
    closed, cut = ellipsoid((30.0, 20.0, 16.0), 3), octasphere(20.0)
    cut = submesh(cut, cut.vertices[cut.faces].mean(axis=1)[:, 0] > 0)[0]
    for mesh, is_open in ((closed, False), (cut, True)):
        bands = spectrum(
            mesh.vertices[:, 1], spectral_basis(mesh, 40), radius_mm=2.5
        ).bands
        assert bands["is_open"].tolist() == [is_open] * 7
        middle = np.sqrt(bands["wavelength_min_mm"] * bands["wavelength_max_mm"])[1:]
        np.testing.assert_allclose(
            bands["kept_curvature"][1:], kept_curvature(middle.to_numpy(), 2.5)
        )


def test_dominant_band_is_the_one_that_adds_most(solved) -> None:
    slow, fast = (
        solved.functions[:, np.flatnonzero(solved.band == k)[1]] for k in (1, 3)
    )
    proxy = 10.0 * slow + fast
    found = spectrum(proxy, solved, radius_mm=1.0).dominant_band
    expected = np.where(
        proxy > 0, np.where(10 * slow > fast, 1, 3), np.where(10 * slow < fast, -1, -3)
    )
    clear = np.abs(proxy) > 1e-3
    np.testing.assert_array_equal(found[clear], expected[clear])


def test_a_band_that_is_cut_off_dominates_nowhere(shape, solved) -> None:
    slow, cut = (
        solved.functions[:, np.flatnonzero(solved.band == k)[1]] for k in (2, 4)
    )
    found = spectrum(slow + 10.0 * cut, solved, radius_mm=1.0)
    assert not found.bands["complete"][4]
    assert set(np.abs(found.dominant_band)) <= {1, 2, 3}
    few = spectral_basis(shape, 3)
    np.testing.assert_array_equal(spectrum(slow, few, radius_mm=1.0).dominant_band, 0)


def rectangle(nx: int, ny: int, width: float, height: float) -> TriangleMesh:
    x, y = np.meshgrid(
        np.linspace(0, width, nx), np.linspace(0, height, ny), indexing="ij"
    )
    return sheet(x, y, 0 * x)


def flat_torus(
    nx: int, ny: int, width: float, height: float
) -> list[sparse.csc_matrix]:
    # no flat torus fits into space; its edge lengths are those of a rectangle whose
    # opposite sides are glued
    i, j = (
        index.ravel()
        for index in np.meshgrid(np.arange(nx), np.arange(ny), indexing="ij")
    )
    glue = sparse.csc_matrix(
        (np.ones(nx * ny), (np.arange(nx * ny), i % (nx - 1) * (ny - 1) + j % (ny - 1)))
    )
    return [
        sparse.csc_matrix(glue.T @ part @ glue)
        for part in laplacian(rectangle(nx, ny, width, height))
    ]


def test_flat_torus_has_the_sums_of_two_circles() -> None:
    coarse, fine = (
        lowest_modes(*flat_torus(8 * n + 1, 6 * n + 1, 40.0, 30.0), 60).eigenvalues
        for n in (6, 12)
    )
    k, m = np.meshgrid(np.arange(-20, 21), np.arange(-20, 21))
    exact = np.sort((4 * np.pi**2 * (k**2 / 40.0**2 + m**2 / 30.0**2)).ravel())[:60]
    # linear elements: half the edge length, a quarter of the error
    np.testing.assert_allclose(
        fine + (fine - coarse) / 3.0, exact, rtol=0.01, atol=1e-9
    )


def test_open_rectangle_has_a_free_boundary() -> None:
    found = lowest_modes(*laplacian(rectangle(61, 46, 40.0, 30.0)), 40).eigenvalues
    i, j = np.meshgrid(np.arange(30), np.arange(30))
    exact = np.sort((np.pi**2 * (i**2 / 40.0**2 + j**2 / 30.0**2)).ravel())[:40]
    np.testing.assert_allclose(found, exact, rtol=0.03, atol=1e-12)


def test_slices_equal_a_single_call() -> None:
    stiffness, mass = laplacian(ellipsoid(AXES, 3))
    modes = lowest_modes(stiffness, mass, 250)
    single = eigsh(
        stiffness, k=250, M=mass, sigma=-1e-3, tol=1e-12, return_eigenvectors=False
    )
    np.testing.assert_allclose(modes.eigenvalues[1:], np.sort(single)[1:], rtol=1e-8)
    assert abs(modes.eigenvalues[0]) < 1e-10
    identity = modes.functions.T @ (mass @ modes.functions)
    # modes of two slices are orthogonal to the tolerance of the solver over the
    # distance of their eigenvalues
    np.testing.assert_allclose(identity, np.eye(250), atol=1e-6)
    residual = (
        stiffness @ modes.functions - (mass @ modes.functions) * modes.eigenvalues
    )
    assert np.abs(residual).max() < 1e-8


@pytest.mark.parametrize("wrong", [-1, 1])
def test_modes_other_than_the_inertia_counts_are_an_error(
    monkeypatch: pytest.MonkeyPatch, wrong: int
) -> None:
    stiffness, mass = laplacian(ellipsoid(AXES))
    counted = laplace_beltrami.count_below
    monkeypatch.setattr(
        laplace_beltrami, "count_below", lambda *arguments: counted(*arguments) + wrong
    )
    with pytest.raises(SolverError, check=Facts(27, 27 + wrong)):
        lowest_modes(stiffness, mass, 20)


def test_vertex_without_a_face_is_refused() -> None:
    with pytest.raises(MeshError, check=Facts(1)):
        laplacian(
            TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [5, 5, 5]], [[0, 1, 2]])
        )


def test_more_modes_than_a_surface_has_are_refused() -> None:
    stiffness, mass = laplacian(ellipsoid(AXES, 2))
    with pytest.raises(SolverError, check=Facts(163, 1, 162)):
        lowest_modes(stiffness, mass, 163)
