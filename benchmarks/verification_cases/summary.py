"""What `verification.py` prints of its measurements: numbers that a table can hold."""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline

from .closed_forms import thin_film
from .modes import Slab

Floats = NDArray[np.float64]
AS_FOUND = (
    *("consistency", "quadratic_consistency", "manufactured", "quadratic_manufactured", "elements", "symmetry"),
    *("ranks", "theory"),
)
"""Parts whose numbers need no working out."""


def fastest(lengths: ArrayLike, values: ArrayLike) -> tuple[float, float]:
    """Returns the length of the largest value and that value, by cubic splines between waves of a slab."""
    waves = 1 / np.asarray(lengths)
    spline = CubicSpline(waves, values)
    fine = np.linspace(waves.min(), waves.max(), 20_001)
    best = int(spline(fine).argmax())
    return float(1 / fine[best]), float(spline(fine[best]))


def orders(errors: ArrayLike) -> Floats:
    """Returns the observed orders from each mesh to the next of twice as many cells."""
    values = np.abs(np.asarray(errors))
    return np.log2(values[:-1] / values[1:])


def rates_of(contrast: float, found: dict) -> dict:
    """Returns the wave that grows fastest where stress is forgotten: closed form, theory, and mesh by mesh."""
    film = thin_film(Slab(contrast))
    expected = np.array(found["expected"])
    wave = int(expected.argmax())
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
        "relative_errors_at_peak": errors[:, wave],
        "orders_at_peak": orders(errors[:, wave]),
        "largest_relative_error_on_finest": np.abs(errors[-1]).max(),
    }


def memory_of(found: dict) -> dict:
    """Returns the largest amplification, that expected and that on each mesh, and errors of its logarithm."""
    expected = np.array(found["expected"])[-1]
    measured = np.array(found["measured"])[:, -1]
    wave = int(expected.argmax())
    errors = np.log(measured[:, wave]) / np.log(expected[wave]) - 1
    return {
        "wavelength": found["lengths"][wave],
        "expected": expected[wave],
        "measured": measured[:, wave],
        "relative_errors_of_logarithm": errors,
        "orders": orders(errors),
    }


def time_steps_of(found: dict) -> dict:
    """Returns the largest amplification against the length of the steps."""
    expected, measured = np.array(found["expected"]), np.array(found["measured"])
    wave = int(expected[-1].argmax())
    return {
        "growth_of_step": found["growth_of_step"],
        "expected": expected[:, wave],
        "measured": measured[:, wave],
        "change_expected": expected[1:, wave] / expected[:-1, wave] - 1,
        "change_measured": measured[1:, wave] / measured[:-1, wave] - 1,
    }


def default_of(elements: list[dict], order: int, cells: int, poisson_ratio: float) -> float:
    """Returns the error of the fastest wave's rate of an element among those that were compared."""
    kind = (order, cells, poisson_ratio)
    (found,) = [one for one in elements if (one["order"], one["cells"], one["poisson_ratio"]) == kind]
    return found["rate_error"]


def rounded(value, digits: int = 4):
    """Returns a value with all numbers at so many significant digits, arrays as lists."""
    if isinstance(value, dict):
        return {key: rounded(item, digits) for key, item in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [rounded(item, digits) for item in value]
    return float(f"{value:.{digits}g}") if isinstance(value, float) else value


def summary(found: dict, order: int, cells: int) -> dict:
    """Returns the content of the benchmark's last line from what all parts found.

    `order` and `cells`, to a cortical thickness, are those of the default element at its default edge.
    """
    return rounded(
        {
            "default_order": order,
            "default_fastest_wave_rate_error": default_of(found["elements"], order, cells, 0.45),
            "default_fastest_wave_rate_error_at_0_48": default_of(found["elements"], order, cells, 0.48),
            **{name: found[name] for name in AS_FOUND},
            "rates": {contrast: rates_of(float(contrast), one) for contrast, one in found["rates"].items()},
            "memory": {tau: memory_of(one) for tau, one in found["memory"].items()},
            "time_steps": time_steps_of(found["time_steps"]),
        }
    )
