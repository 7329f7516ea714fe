"""Spectral analysis of gyrification (SpAnGy): the power of a folding proxy in bands of
spatial frequency.

Germanaud et al. 2012, "Larger is twistier", NeuroImage 63, 1257-1272. Which modes a
spectrum is made of, its bands, and how far two spectra are from each other.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import sparse

from ..errors import SolverError
from ..geometry.matching import interpolation, match_surface
from ..geometry.remeshing import decimate
from ..geometry.triangles import Floats, Ints, TriangleMesh, area, edges, vertex_areas
from ..settings.terms import (
    FOLD_BANDS,
    MIN_KEPT_CURVATURE,
    OBSERVED,
    PROXIES,
    LastBand,
    MassMatrix,
)
from .curvature import kept_curvature
from .laplace_beltrami import (
    count_below,
    first_eigenvalue,
    laplacian,
    lowest_modes,
    modes_below,
)

type SpangyModes = int | LastBand

BANDS = 6
"""The bands are B0 to B6; B4, B5 and B6 go with primary, secondary and tertiary
folds."""
PARTS = 16
"""Parts of a band, each a sixteenth of an octave of wavelength, whose powers are given
for distances of spectra."""
PART_POWERS = [f"power_{part:02d}of{PARTS}" for part in range(1, PARTS + 1)]
HEMISPHERE = ["subject", "run", "week", "hemisphere"]
"""The columns that name a hemisphere in the tables of a study."""
OPEN_AND_CLOSED = "open and closed hemispheres"
"""Flag of a distance between an open hemisphere and a closed one: closing a cut makes L
5 to 7 % shorter."""
ROUNDING = 1e-9
"""Limits of bands that differ by less, relative to their size, are equal."""
VERTICES_PER_WAVELENGTH = 4.5
"""Edges per shortest wave on the surface that modes are computed on;
`benchmarks/spectra.py` compares other numbers."""
LONGEST_EDGE_MM = 1.5
"""Edges of that surface at most: longer ones do not follow the banks of sulci, whatever
the waves."""
DISPERSION = 1.0 / 256.0 - 1.0 / 576.0
"""Eigenvalues by the mean mass matrix are too small by this times (λh²)², on even
triangles with edges h: the next term of the series whose first one it cancels."""
WORTHWHILE = 0.8
"""A coarser surface is made if it has at most this share of the vertices."""
SERIES_TOL = 1e-8
"""Size of the last term of the series that makes modes orthonormal, relative to the
first; about six terms."""
MAX_TERMS = 200


@dataclass(frozen=True, eq=False)
class Spectrum:
    """A folding proxy on the k modes of a surface with n vertices.

    `eigenvalues` λ (k,) are in mm⁻², `coefficients` (k,) in the proxy's unit times mm,
    `band` (k,) the band of each mode, −1 beyond the last one. `dominant_band` (n,) is
    the signed dominant band, −6 to 6, among the complete bands, 0 where none is;
    `captured` the share of the proxy's power ∫f² that the modes hold, 1 if all
    (Parseval).

    `bands` has a row per band: band, wavelength_min_mm, wavelength_max_mm, modes, power
    (unit of the proxy squared times mm²; NaN without modes), relative_power (share of
    those of B1 to B6 that have modes; NaN for B0), complete (the modes reach the band's
    upper limit), denominator_complete (all bands that relative powers are shares of
    are), kept_curvature (of a shallow wave of the band's middle length, see
    `curvature.kept_curvature`), resolved (that is at least 80 %), is_open (the surface
    has an edge), and `PART_POWERS`, the band's power from long to short waves.
    """

    eigenvalues: Floats
    coefficients: Floats
    band: Ints
    bands: pd.DataFrame
    dominant_band: Ints
    captured: float


def weyl_number(area_mm2: float, first: float) -> int:
    """Return the number of modes up to band B6 by Weyl's law, N = A·λmax/4π.

    WL6 = WL0/2⁶ with WL0 = 2π/√λ1, and λmax = 2π/WL6², the formula printed in the
    FetalFoldSim paper; it is 2π times smaller than (2π/WL6)² = 4⁶·λ1, the upper limit
    of B6.
    """
    return round(area_mm2 * first * 4.0**BANDS / (8.0 * np.pi**2))


def _band_limits(first: float) -> Floats:
    """Return the (7,) limits of the bands B1 to B6 in mm⁻²: Bk holds λ1·4^(k−1) ≤ λ <
    λ1·4^k."""
    return first * 4.0 ** np.arange(
        BANDS + 1,
        dtype=np.float64,
    )


@dataclass(frozen=True, eq=False)
class Basis:
    """The k modes that spectra of a surface with n vertices are made of, on the surface
    or on a copy with m vertices.

    `eigenvalues` λ (k,) are in mm⁻², `functions` (m, k) in mm⁻¹; `first` is λ1 of the
    surface, `reach` the λ below which no mode is missing. `places` (n, m) takes values
    from the copy to the surface, where `energy` (n, n) gives ∫f² in mm². There the
    functions are almost orthonormal; spectra are of the orthonormal ones nearest to
    them (Löwdin 1950), functions S^(-1/2) with their products S (k, k), none of which
    is computed as a whole.
    """

    eigenvalues: Floats
    functions: NDArray[np.floating]
    places: sparse.csr_matrix
    energy: sparse.csc_matrix
    first: float
    reach: float
    is_open: bool

    @property
    def band(self) -> Ints:
        """The (k,) band of each mode: 0 for the constant alone, −1 beyond B6."""
        limits = _band_limits(self.first)
        band = np.searchsorted(limits, self.eigenvalues, side="right")
        # λ1 of the copy may be below that of the surface by rounding
        band[1:] = np.maximum(band[1:], 1)
        band[0] = 0
        band[self.eigenvalues >= limits[-1]] = -1
        return band

    @cached_property
    def _energy_of_places(self) -> sparse.csr_matrix:
        """The (m, m) energy of maps on the copy, in mm²."""
        return sparse.csr_matrix(self.places.T @ self.energy @ self.places)


def _sums(basis: Basis, coefficients: Floats) -> Floats:
    """Return the (m, c) sums of the functions with (k, c) coefficients, in the
    precision of the functions: a copy in another would be as large."""
    functions = basis.functions
    # transposed, since BLAS is twice as fast with a wide matrix on the right
    return (coefficients.astype(functions.dtype).T @ functions.T).T.astype(float)


def _products(basis: Basis, values: Floats) -> Floats:
    """Return the (k, c) products of the functions with (m, c) values, in their
    precision."""
    functions = basis.functions
    return (functions.T @ values.astype(functions.dtype)).astype(float)


def _by_inverse_root(basis: Basis, vectors: Floats) -> Floats:
    """Return S^(-1/2) V for (k, c) vectors V, by the binomial series of (1 − X) for X =
    I − S.

    It converges as the powers of X, whose norm is below 0.6: that is reached where S is
    the lumped mass of modes that are orthonormal by the mean mass.
    """
    found = term = vectors
    size = np.linalg.norm(vectors)
    for number in range(1, MAX_TERMS + 1):
        values = _sums(basis, term)
        change = term - _products(basis, basis._energy_of_places @ values)
        term = (1.0 - 0.5 / number) * change
        found = found + term
        if np.linalg.norm(term) <= SERIES_TOL * size:
            return found
    raise SolverError(
        "the modes are not orthonormal on the surface",
        found=f"{np.linalg.norm(term) / size:.2g} after {MAX_TERMS} terms",
        expected=f"at most {SERIES_TOL:g}",
        remedy="Remesh the surface.",
    )


def spectral_basis(
    mesh: TriangleMesh,
    choice: SpangyModes,
    mass: MassMatrix = "mean",
) -> Basis:
    """Return the modes that a hemisphere's spectra are made of.

    The name of a band stands for all modes up to its end; that none is missing there is
    known by inertia, so that no mode of the next band is needed to show it. They are at
    most half as many as there are vertices. A number is taken as it is. With the `mean`
    mass matrix they are computed on a copy with only as many vertices as the shortest
    wave needs, and powers are sums over the surface's vertices; neither has an error of
    order (kh)². `consistent` is as in LaPy: on the surface as it is, with powers by the
    same matrix. MeshError where the surface is not in one piece.
    """
    stiffness, matrix = laplacian(mesh, mass)
    first = first_eigenvalue(stiffness, matrix)
    places = sparse.eye(len(mesh.vertices), format="csr")
    energy = (
        matrix
        if mass == "consistent"
        else sparse.csc_matrix(sparse.diags(vertex_areas(mesh)))
    )
    by_name = isinstance(choice, str)
    end = (
        float(_band_limits(first)[int(str(choice)[1:])])
        if by_name
        else 4.0 * np.pi * int(choice) / area(mesh)
    )
    edge_mm = min(
        2.0 * np.pi / np.sqrt(end) / VERTICES_PER_WAVELENGTH,
        LONGEST_EDGE_MM,
    )
    needed = math.ceil(area(mesh) / (np.sqrt(0.75) * edge_mm**2))
    scale = 1.0
    dispersion = 0.0
    if mass == "mean" and needed < WORTHWHILE * len(mesh.vertices):
        copy = decimate(mesh, needed)
        places = interpolation(
            match_surface(mesh, copy),
            len(copy.vertices),
        )
        stiffness, matrix = laplacian(copy, mass)
        scale = first / first_eigenvalue(stiffness, matrix)
        dispersion = DISPERSION * (_even_edge(copy) ** 4 - _even_edge(mesh) ** 4)
    number = stiffness.shape[0] // 2
    end_of_copy = end / scale / (1.0 + dispersion * end**2)
    if by_name and (count := count_below(stiffness, matrix, end_of_copy)) <= number:
        modes, reach = modes_below(stiffness, matrix, end_of_copy, count), end
    else:
        modes = lowest_modes(stiffness, matrix, number if by_name else int(choice))
        reach = -math.inf
    # λ of the surface, whose λ/(1 + dispersion λ²) is that of the copy
    scaled = scale * modes.eigenvalues
    root = np.sqrt(1.0 - 4.0 * dispersion * scaled**2)
    eigenvalues = 2.0 * scaled / (1.0 + root)
    return Basis(
        eigenvalues,
        modes.functions,
        places,
        energy,
        first,
        reach=max(reach, float(eigenvalues[-1])),
        is_open=bool((edges(mesh)[1] == 1).any()),
    )


def _even_edge(mesh: TriangleMesh) -> float:
    """Return the edge in mm of as many equilateral triangles of the same area."""
    return math.sqrt(area(mesh) / len(mesh.vertices) / math.sqrt(0.75))


def spectrum(
    proxy: Floats,
    basis: Basis,
    *,
    radius_mm: float,
) -> Spectrum:
    """Return the band spectrum of a folding proxy, (n,) values per vertex of the
    surface.

    `radius_mm` is the radius of the curvature fit. The dominant band is as in Germanaud
    et al. 2012, from the part of the proxy in each of B1 to B6: at a vertex where the
    proxy is positive the band with the largest part, elsewhere the one with the
    smallest, with a minus sign.
    """
    band = basis.band
    energy = basis.energy @ proxy
    products = _products(
        basis,
        basis.places.T @ energy[:, None],
    )
    coefficients = _by_inverse_root(basis, products)[:, 0]
    bands = _band_table(basis, coefficients, radius_mm)
    dominant: Ints = np.zeros(
        len(proxy),
        dtype=np.int64,
    )
    is_whole = bands["complete"] & (bands["band"] > 0)
    whole = bands.loc[is_whole, "band"].to_numpy()
    if len(whole):
        is_in_band = band[:, None] == whole
        parts = _by_inverse_root(basis, is_in_band * coefficients[:, None])
        at_vertices = basis.places @ _sums(basis, parts)
        largest = whole[at_vertices.argmax(axis=1)]
        smallest = whole[at_vertices.argmin(axis=1)]
        dominant = np.where(proxy > 0, largest, -smallest)
    captured = 1.0
    if proxy.any():
        captured = float(np.sum(coefficients**2) / (proxy @ energy))
    return Spectrum(basis.eigenvalues, coefficients, band, bands, dominant, captured)


def _band_table(
    basis: Basis,
    coefficients: Floats,
    radius_mm: float,
) -> pd.DataFrame:
    limits = _band_limits(basis.first)
    powers = coefficients**2
    bands = np.arange(BANDS + 1)
    is_mean = bands == 0
    # modes beyond the last band have −1
    in_bands = basis.band[basis.band >= 0]
    numbers = np.bincount(in_bands, minlength=BANDS + 1)
    power = np.full(BANDS + 1, np.nan)
    for band in np.flatnonzero(numbers):
        power[band] = np.sum(powers[basis.band == band])
    total = np.nansum(power[1:])
    relative_power = power / total if total > 0 else 0.0 * power
    relative_power[is_mean] = np.nan
    wavelengths = np.append(
        np.inf,
        2.0 * np.pi / np.sqrt(limits),
    )
    longest = wavelengths[:-1]
    shortest = wavelengths[1:]
    complete = np.append(
        True,
        limits[1:] <= basis.reach * (1.0 + ROUNDING),
    )
    kept = kept_curvature(np.sqrt(shortest * longest), radius_mm)
    table = pd.DataFrame(
        {
            "band": bands,
            "wavelength_min_mm": np.where(is_mean, np.inf, shortest),
            "wavelength_max_mm": longest,
            "modes": numbers,
            "power": power,
            "relative_power": relative_power,
            "complete": complete,
            "denominator_complete": bool(complete[numbers > 0].all()),
            "kept_curvature": kept,
            "resolved": is_mean | (kept >= MIN_KEPT_CURVATURE),
            "is_open": basis.is_open,
        }
    )
    inside = basis.band > 0
    octaves = np.log2(basis.eigenvalues[inside] / basis.first) / 2
    part = (PARTS * np.maximum(octaves, 0.0)).astype(int)
    parts = np.bincount(part, powers[inside], PARTS * BANDS)
    of_bands = parts.reshape(BANDS, PARTS)
    return table.join(
        pd.DataFrame(
            of_bands,
            bands[1:],
            PART_POWERS,
        )
    )


@dataclass(frozen=True, eq=False)
class _Profile:
    """A hemisphere's power over wavelength: log2 of L in mm, the power of each part of
    B1 to B6, and its bands."""

    longest: float
    powers: Floats
    complete: NDArray[np.bool_]
    resolved: NDArray[np.bool_]
    is_open: bool


def _cumulative(profile: _Profile, octaves: Floats, end: float) -> Floats:
    """Return the share of the power of waves longer than 2^octaves mm, of those longer
    than 2^end."""
    edges = profile.longest - np.arange(len(profile.powers) + 1) / PARTS
    sums = np.append(0.0, np.cumsum(profile.powers))
    ascending = edges[::-1]
    sums_to_edges = sums[::-1]
    power = np.interp(octaves, ascending, sums_to_edges)
    whole = np.interp(end, ascending, sums_to_edges)
    return power / whole


def spectral_distances(spectra: pd.DataFrame) -> pd.DataFrame:
    """Return how far the spectrum of each hemisphere is from those of the same side of
    all measured brains.

    The distance is the area between the cumulative power of both over log2 of the
    wavelength, in octaves: how far power has to be moved on average, 1 if all waves are
    half as long. It has no edges between bands. Each curve is the share of the power of
    waves down to the end of a band Bk, of the two brains the one at the longer wave.
    There is one up to B4, up to B5 and up to B6, each between all pairs whose bands are
    complete and resolved in both.

    Spectra have the columns subject, run ("observed" for observed brains), week,
    hemisphere, proxy, and those of `Spectrum.bands`; those of mean curvature are
    compared. A measured brain is not compared with itself.

    Columns subject, run, week, hemisphere, observed (the brain), observed_week, proxy,
    metric (spectral_distance_B4, spectral_distance_B4_to_B5,
    spectral_distance_B4_to_B6), value, unit, flag ("ok", `OPEN_AND_CLOSED`, or the
    reason for a missing value: "B5 B6 not resolved" or "B6 cut off", not complete, in
    one of the two).
    """
    rows = spectra[
        (spectra["proxy"] == PROXIES[0]) & (spectra["band"] > 0)
    ].sort_values("band")
    profiles = {
        key: _Profile(
            float(np.log2(bands["wavelength_max_mm"].iloc[0])),
            np.nan_to_num(bands[PART_POWERS].to_numpy(dtype=float)).ravel(),
            bands["complete"].to_numpy(dtype=bool),
            bands["resolved"].to_numpy(dtype=bool),
            bool(bands["is_open"].iloc[0]),
        )
        for key, bands in rows.groupby(HEMISPHERE)
    }
    found = []
    for key, profile in profiles.items():
        for other, observed in profiles.items():
            subject, run, week, hemisphere = other
            if run != OBSERVED or hemisphere != key[3] or key == other:
                continue
            labels = (*key, subject, week, PROXIES[0])
            for row in _distances(profile, observed):
                found.append((*labels, *row))
    return pd.DataFrame(
        found,
        columns=[
            *HEMISPHERE,
            "observed",
            "observed_week",
            "proxy",
            "metric",
            "value",
            "unit",
            "flag",
        ],
    )


def _distances(a: _Profile, b: _Profile) -> list[tuple[str, float, str, str]]:
    """Return rows of measure, value, unit and flag: the distance of the bands from B4
    to each further one."""
    rows = []
    longest = max(a.longest, b.longest)
    for last in FOLD_BANDS:
        cut = _bands_without(a.complete & b.complete, last)
        coarse = _bands_without(a.resolved & b.resolved, last)
        value = math.nan
        if cut:
            flag = f"{cut} cut off"
        elif coarse:
            flag = f"{coarse} not resolved"
        else:
            flag = OPEN_AND_CLOSED if a.is_open != b.is_open else "ok"
            end = longest - last
            octaves = np.linspace(
                end,
                longest,
                4 * PARTS * last + 1,
            )
            difference = _cumulative(a, octaves, end) - _cumulative(b, octaves, end)
            value = float(
                np.trapezoid(
                    np.abs(difference),
                    octaves,
                )
            )
        name = "spectral_distance_B4"
        if last > FOLD_BANDS[0]:
            name += f"_to_B{last}"
        rows.append((name, value, "octaves", flag))
    return rows


def _bands_without(has: NDArray[np.bool_], last: int) -> str:
    """Return the names of the bands up to the last one that do not have something."""
    numbers = np.flatnonzero(~has[:last]) + 1
    return " ".join(f"B{number}" for number in numbers)
