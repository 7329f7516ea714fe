"""Spectral analysis of gyrification (SpAnGy): the power of a folding proxy in bands of spatial frequency.

Germanaud et al. 2012, "Larger is twistier", NeuroImage 63, 1257-1272.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy import sparse

from ..errors import MeshError
from ..geometry.triangles import Floats, Ints
from ..parameters.metrics import WeylFormula
from .laplace_beltrami import Modes, lowest_modes

BANDS = 6
"""The bands are B0 to B6; B4, B5 and B6 go with primary, secondary and tertiary folds."""

ROUNDING = 1e-9
"""Limits of bands that differ by less, relative to their size, are equal."""

EDGES_PER_WAVELENGTH = 6
"""A band whose shortest wavelength spans fewer edges is not resolved by the mesh."""


@dataclass(frozen=True, eq=False)
class Spectrum:
    """A folding proxy on the modes of a surface with n vertices.

    Attributes
    ----------
    eigenvalues : (k,) float
        λ in mm⁻².
    coefficients : (k,) float
        cᵢ = fᵀ M φᵢ, in the proxy's unit times mm.
    band : (k,) int
        The band of each mode; −1 beyond the last band.
    bands : DataFrame
        Per band: band, wavelength_min_mm, wavelength_max_mm, modes, power (unit of the proxy squared times mm²; NaN
        without modes), relative_power (share of those of B1 to B6 that have modes; NaN for B0), complete (the modes
        reach the band's upper limit), denominator_complete (all bands that relative powers are shares of are), resolved
        (the shortest wavelength spans at least 6 edges).
    dominant_band : (n,) int
        Signed dominant band per vertex, −6 to 6, among the complete bands; 0 where none is.
    captured : float
        Share of fᵀMf that the modes hold; 1 would be all (Parseval).
    """

    eigenvalues: Floats
    coefficients: Floats
    band: Ints
    bands: pd.DataFrame
    dominant_band: Ints
    captured: float


def first_eigenvalue(stiffness: sparse.csc_matrix, mass: sparse.csc_matrix) -> float:
    """Returns λ1, the lowest eigenvalue above 0, in mm⁻²; MeshError where the surface is not in one piece."""
    values = lowest_modes(stiffness, mass, 3).eigenvalues
    # the constant is the only mode at 0 of a connected surface; Weyl's spacing gives the scale
    if values[1] < 1e-6 * 4.0 * np.pi / mass.sum():
        raise MeshError("the surface is not in one piece", remedy="Give each hemisphere by itself")
    return float(values[1])


def weyl_number(area_mm2: float, first: float, formula: WeylFormula) -> int:
    """Returns the number of modes up to band B6 by Weyl's law, N = A·λmax/4π.

    WL6 = WL0/2⁶ with WL0 = 2π/√λ1. λmax is (2π/WL6)² = 4⁶·λ1 by "textbook", the upper limit of B6, and 2π/WL6² by
    "paper", the formula printed in the FetalFoldSim paper, 2π times smaller.
    """
    shortest = 2.0 * np.pi / np.sqrt(first) / 2.0**BANDS
    largest = 2.0 * np.pi / shortest**2 if formula == "paper" else (2.0 * np.pi / shortest) ** 2
    return round(area_mm2 * largest / (4.0 * np.pi))


def band_limits(first: float) -> Floats:
    """Returns the (7,) limits of the bands B1 to B6 in mm⁻²: Bk holds λ1·4^(k−1) ≤ λ < λ1·4^k."""
    return first * 4.0 ** np.arange(BANDS + 1)


def bands_of_modes(eigenvalues: Floats) -> Ints:
    """Returns the (k,) band of each mode: 0 for the constant alone, −1 beyond B6."""
    limits = band_limits(eigenvalues[1])
    band = np.searchsorted(limits, eigenvalues, side="right")
    band[0] = 0
    band[eigenvalues >= limits[-1]] = -1
    return band


def spectrum(
    proxy: Floats, modes: Modes, mass: sparse.csc_matrix, *, edge_length_mm: float, reach: float | None = None
) -> Spectrum:
    """Returns the band spectrum of a folding proxy, (n,) values per vertex.

    `reach` is the λ in mm⁻² below which no mode is missing; that of the highest mode where it is not given.

    The dominant band is as in Germanaud et al. 2012, each of B1 to B6 recomposed by itself: a vertex where the
    proxy is positive belongs to the band that adds most, another to the band that takes most away, with a minus sign.
    """
    coefficients = modes.functions.T @ (mass @ proxy)
    band = bands_of_modes(modes.eigenvalues)
    power = np.array([np.sum(coefficients[band == k] ** 2) for k in range(BANDS + 1)])
    reach = float(modes.eigenvalues[-1]) if reach is None else reach
    bands = _band_table(modes.eigenvalues, band, power, edge_length_mm, reach)
    return Spectrum(
        eigenvalues=modes.eigenvalues,
        coefficients=coefficients,
        band=band,
        bands=bands,
        dominant_band=_dominant_band(
            proxy, coefficients, band, modes.functions, bands["band"].to_numpy()[1:][bands["complete"][1:]]
        ),
        captured=float(np.sum(coefficients**2) / (proxy @ (mass @ proxy))) if proxy.any() else 1.0,
    )


def _band_table(eigenvalues: Floats, band: Ints, power: Floats, edge_length_mm: float, reach: float) -> pd.DataFrame:
    limits = band_limits(eigenvalues[1])
    numbers = np.array([np.count_nonzero(band == k) for k in range(BANDS + 1)])
    wavelengths = 2.0 * np.pi / np.sqrt(limits)
    total = power[1:].sum()
    complete = np.concatenate([[True], limits[1:] <= reach * (1.0 + ROUNDING)])
    return pd.DataFrame(
        {
            "band": np.arange(BANDS + 1),
            "wavelength_min_mm": np.concatenate([[np.inf], wavelengths[1:]]),
            "wavelength_max_mm": np.concatenate([[np.inf], wavelengths[:-1]]),
            "modes": numbers,
            "power": np.where(numbers > 0, power, np.nan),
            "relative_power": np.concatenate(
                [[np.nan], np.where(numbers[1:] > 0, power[1:] / total if total > 0 else 0.0, np.nan)]
            ),
            "complete": complete,
            "denominator_complete": bool(complete[numbers > 0].all()),
            "resolved": np.concatenate([[True], wavelengths[1:] >= EDGES_PER_WAVELENGTH * edge_length_mm]),
        }
    )


def _dominant_band(proxy: Floats, coefficients: Floats, band: Ints, functions: Floats, bands: Ints) -> Ints:
    if not len(bands):
        return np.zeros(len(proxy), dtype=np.int64)
    parts = np.stack([functions[:, band == k] @ coefficients[band == k] for k in bands])
    return np.where(proxy > 0, bands[parts.argmax(axis=0)], -bands[parts.argmin(axis=0)])
