"""Spectral analysis of gyrification (SpAnGy): the power of a folding proxy in bands of spatial frequency.

Germanaud et al. 2012, "Larger is twistier", NeuroImage 63, 1257-1272. Which modes a spectrum is made of, its bands, and
how far two spectra are from each other.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import sparse

from ..errors import MeshError
from ..geometry.triangles import Floats, Ints
from ..settings.terms import FOLD_BANDS, MEASURED, MIN_KEPT_CURVATURE, PROXIES, LastBand
from .curvature import kept_curvature
from .laplace_beltrami import Modes, count_below, lowest_modes, modes_below

type SpangyModes = int | LastBand

BANDS = 6
"""The bands are B0 to B6; B4, B5 and B6 go with primary, secondary and tertiary folds."""

HEMISPHERE = ["subject", "run", "week", "hemisphere"]
"""The columns that name a hemisphere in the tables of a study."""

ROUNDING = 1e-9
"""Limits of bands that differ by less, relative to their size, are equal."""


@dataclass(frozen=True, eq=False)
class Spectrum:
    """A folding proxy on the k modes of a surface with n vertices.

    `eigenvalues` λ (k,) are in mm⁻², `coefficients` cᵢ = fᵀ M φᵢ (k,) in the proxy's unit times mm, `band` (k,) the
    band of each mode, −1 beyond the last one. `dominant_band` (n,) is the signed dominant band, −6 to 6, among the
    complete bands, 0 where none is; `captured` the share of fᵀMf that the modes hold, 1 if all (Parseval).

    `bands` has a row per band: band, wavelength_min_mm, wavelength_max_mm, modes, power (unit of the proxy squared
    times mm²; NaN without modes), relative_power (share of those of B1 to B6 that have modes; NaN for B0), complete
    (the modes reach the band's upper limit), denominator_complete (all bands that relative powers are shares of are),
    resolved (a wave of the band's middle length keeps 80 % of its curvature, see `curvature.kept_curvature`).
    """

    eigenvalues: Floats
    coefficients: Floats
    band: Ints
    bands: pd.DataFrame
    dominant_band: Ints
    captured: float


def first_eigenvalue(stiffness: sparse.csc_matrix, mass: sparse.csc_matrix) -> float:
    """Return λ1, the lowest eigenvalue above 0, in mm⁻²; MeshError where the surface is not in one piece."""
    values = lowest_modes(stiffness, mass, 3).eigenvalues
    # the constant is the only mode at 0 of a connected surface; Weyl's spacing gives the scale
    if values[1] < 1e-6 * 4.0 * np.pi / mass.sum():
        raise MeshError("the surface is not in one piece", remedy="Remove all but its largest piece.")
    return float(values[1])


def weyl_number(area_mm2: float, first: float) -> int:
    """Return the number of modes up to band B6 by Weyl's law, N = A·λmax/4π.

    WL6 = WL0/2⁶ with WL0 = 2π/√λ1, and λmax = 2π/WL6², the formula printed in the FetalFoldSim paper; it is 2π times
    smaller than (2π/WL6)² = 4⁶·λ1, the upper limit of B6.
    """
    shortest = 2.0 * np.pi / np.sqrt(first) / 2.0**BANDS
    largest = 2.0 * np.pi / shortest**2
    return round(area_mm2 * largest / (4.0 * np.pi))


def band_limits(first: float) -> Floats:
    """Return the (7,) limits of the bands B1 to B6 in mm⁻²: Bk holds λ1·4^(k−1) ≤ λ < λ1·4^k."""
    return first * 4.0 ** np.arange(BANDS + 1)


def modes_of(
    choice: SpangyModes, stiffness: sparse.csc_matrix, mass: sparse.csc_matrix, first: float
) -> tuple[Modes, float]:
    """Return the modes that a hemisphere's spectrum is made of, and the λ in mm⁻² below which none is missing.

    The name of a band stands for all modes up to its end; that none is missing there is known by inertia, so that no
    mode of the next band is needed to show it. They are at most half as many as there are vertices. A number is taken
    as it is.
    """
    number = stiffness.shape[0] // 2 if isinstance(choice, str) else choice
    if isinstance(choice, str):
        end = float(band_limits(first)[int(choice.removeprefix("B"))])
        if count_below(stiffness, mass, end) <= number:
            return modes_below(stiffness, mass, end), end
    modes = lowest_modes(stiffness, mass, number)
    return modes, float(modes.eigenvalues[-1])


def bands_of_modes(eigenvalues: Floats) -> Ints:
    """Return the (k,) band of each mode: 0 for the constant alone, −1 beyond B6."""
    limits = band_limits(eigenvalues[1])
    band = np.searchsorted(limits, eigenvalues, side="right")
    band[0] = 0
    band[eigenvalues >= limits[-1]] = -1
    return band


def spectrum(
    proxy: Floats, modes: Modes, mass: sparse.csc_matrix, *, radius_mm: float, reach: float | None = None
) -> Spectrum:
    """Return the band spectrum of a folding proxy, (n,) values per vertex.

    `radius_mm` is the radius of the curvature fit. `reach` is the λ in mm⁻² below which no mode is missing, by default
    that of the highest mode. The dominant band is as in Germanaud et al. 2012, from the part of the proxy in each of B1
    to B6: at a vertex where the proxy is positive the band with the largest part, elsewhere the one with the smallest,
    with a minus sign.
    """
    coefficients = modes.functions.T @ (mass @ proxy)
    band = bands_of_modes(modes.eigenvalues)
    reach = float(modes.eigenvalues[-1]) if reach is None else reach
    bands = _band_table(modes.eigenvalues, band, coefficients, radius_mm, reach)
    dominant: Ints = np.zeros(len(proxy), dtype=np.int64)
    if len(whole := bands.loc[bands["complete"] & (bands["band"] > 0), "band"].to_numpy()):
        parts = np.stack([modes.functions[:, band == k] @ coefficients[band == k] for k in whole])
        dominant = np.where(proxy > 0, whole[parts.argmax(axis=0)], -whole[parts.argmin(axis=0)])
    captured = float(np.sum(coefficients**2) / (proxy @ (mass @ proxy))) if proxy.any() else 1.0
    return Spectrum(modes.eigenvalues, coefficients, band, bands, dominant, captured)


def _band_table(eigenvalues: Floats, band: Ints, coefficients: Floats, radius_mm: float, reach: float) -> pd.DataFrame:
    limits = band_limits(eigenvalues[1])
    numbers = np.array([np.count_nonzero(band == k) for k in range(BANDS + 1)])
    power = np.array([np.sum(coefficients[band == k] ** 2) if numbers[k] else np.nan for k in range(BANDS + 1)])
    total = np.nansum(power[1:])
    wavelengths = np.concatenate([[np.inf], 2.0 * np.pi / np.sqrt(limits)])
    complete = np.concatenate([[True], limits[1:] <= reach * (1.0 + ROUNDING)])
    whole = np.arange(BANDS + 1) == 0
    share = kept_curvature(np.sqrt(wavelengths[1:] * wavelengths[:-1]), radius_mm)
    return pd.DataFrame(
        {
            "band": np.arange(BANDS + 1),
            "wavelength_min_mm": np.where(whole, np.inf, wavelengths[1:]),
            "wavelength_max_mm": wavelengths[:-1],
            "modes": numbers,
            "power": power,
            "relative_power": np.append(np.nan, power[1:] / total if total > 0 else 0 * power[1:]),
            "complete": complete,
            "denominator_complete": bool(complete[numbers > 0].all()),
            "resolved": whole | (share >= MIN_KEPT_CURVATURE),
        }
    )


def spectral_distances(spectra: pd.DataFrame) -> pd.DataFrame:
    """Return how far the spectrum of each hemisphere is from those of the same side of all measured brains.

    The distance up to band Bk is √Σ(s − s′)² over the fold bands B4 to Bk, where s is the share that a band has of the
    power of B1 to Bk: 0 for equal shares, at most √2. Neither the size of the brain nor the number of modes enters it.
    There is one up to B4, up to B5 and up to B6, each between all pairs whose bands are complete and resolved in both.

    Spectra have the columns subject, run ("real" for measured brains), week, hemisphere, proxy, band, power, complete,
    resolved; those of mean curvature are compared. A measured brain is not compared with itself.

    Columns subject, run, week, hemisphere, real (the measured brain), real_week, proxy, metric (spectral_distance_B4,
    spectral_distance_B4_to_B5, spectral_distance_B4_to_B6), value, unit, flag ("ok", or the reason for a missing value:
    "B5 B6 not resolved" or "B6 cut off", not complete, in one of the two).
    """
    spectra = spectra[spectra["proxy"] == PROXIES[0]]
    complete, resolved, powers = (
        spectra.pivot_table(name, HEMISPHERE, "band", aggfunc="first").reindex(columns=range(1, BANDS + 1))
        for name in ("complete", "resolved", "power")
    )
    hemispheres = list(complete.index)
    fine = resolved.eq(True).to_numpy()
    whole = powers.reindex(complete.index).where(complete.eq(True)).to_numpy(dtype=float)
    rows = [
        (*first, second[0], second[2], *row)
        for i, first in enumerate(hemispheres)
        for j, second in enumerate(hemispheres)
        if second[1] == MEASURED and second[3] == first[3] and i != j
        for row in _distances(whole[i], whole[j], fine[i] & fine[j])
    ]
    table = pd.DataFrame(rows, columns=[*HEMISPHERE, "real", "real_week", "metric", "value", "flag"])
    table.insert(len(HEMISPHERE) + 2, "proxy", PROXIES[0])
    return table.assign(unit="1")[[*table.columns[:-1], "unit", "flag"]]


def _distances(a: Floats, b: Floats, resolved: NDArray[np.bool_]) -> list[tuple[str, float, str]]:
    rows = []
    for last in FOLD_BANDS:
        fold = slice(FOLD_BANDS[0] - 1, last)
        shares = a[:last] / a[:last].sum(), b[:last] / b[:last].sum()
        cut, coarse = (
            " ".join(f"B{k + 1}" for k in np.flatnonzero(bands)) for bands in (np.isnan(a + b)[:last], ~resolved[:last])
        )
        flag = f"{cut} cut off" if cut else f"{coarse} not resolved" if coarse else "ok"
        name = "spectral_distance_B4" + (f"_to_B{last}" if last > FOLD_BANDS[0] else "")
        rows.append((name, float(np.linalg.norm(shares[0][fold] - shares[1][fold])) if flag == "ok" else np.nan, flag))
    return rows
