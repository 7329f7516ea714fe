"""What `verification.py` prints of waves: the one that grows fastest, and the errors of its growth mesh by mesh."""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline

from .closed_forms import thin_film
from .modes import Slab

Floats = NDArray[np.float64]


def fastest(lengths: ArrayLike, values: ArrayLike) -> tuple[float, float]:
    """Return the length of the largest value and that value, by cubic splines between waves of a slab."""
    waves = 1 / np.asarray(lengths)
    spline = CubicSpline(waves, values)
    fine = np.linspace(waves.min(), waves.max(), 20_001)
    best = int(spline(fine).argmax())
    return float(1 / fine[best]), float(spline(fine[best]))


def orders(errors: ArrayLike) -> Floats:
    """Return the observed orders from each mesh to the next of twice as many cells."""
    values = np.abs(np.asarray(errors))
    return np.log2(values[:-1] / values[1:])


def rates_of(contrast: float, found: dict) -> dict:
    """Sum up the wave that grows fastest where stress is forgotten: closed form, theory, and mesh by mesh."""
    film = thin_film(Slab(contrast))
    expected = np.array(found["expected"])
    length, rate = fastest(found["lengths"], expected)
    peaks = [fastest(found["lengths"], measured) for measured in found["measured"]]
    errors = np.array(found["measured"]) / expected - 1
    return {
        "thin_film_wavelength": film.wavelength,
        "thin_film_rate": film.growth_rate,
        "wavelength": length,
        "rate": rate,
        "measured_wavelengths": [length for length, _ in peaks],
        "measured_rates": [rate for _, rate in peaks],
        "orders_at_peak": orders(errors[:, expected.argmax()]),
        "largest_relative_error_on_finest": np.abs(errors[-1]).max(),
    }


def memory_of(found: dict) -> dict:
    """Sum up the largest amplification, that expected and that on each mesh, and errors of its logarithm."""
    expected, measured = np.array(found["expected"])[-1], np.array(found["measured"])[:, -1]
    wave = int(expected.argmax())
    errors = np.log(measured[:, wave]) / np.log(expected[wave]) - 1
    return {
        "wavelength": found["lengths"][wave],
        "expected": expected[wave],
        "measured": measured[:, wave],
        "relative_errors_of_logarithm": errors,
        "orders": orders(errors),
    }


def plain(value, digits: int = 4):
    """Return a value for JSON: arrays as lists, all numbers at so many significant digits."""
    if isinstance(value, dict):
        return {key: plain(item, digits) for key, item in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [plain(item, digits) for item in value]
    value = value.item() if isinstance(value, np.generic) else value
    return float(f"{value:.{digits}g}") if isinstance(value, float) else value
