"""Summaries and figure of waves for `verification.py`: the fastest wave, and its growth
on each mesh."""

from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline

from gyriflow.report.style import (
    FULL_WIDTH_IN,
    MATPLOTLIB_SETTINGS,
    MUTED_COLOUR,
    RUN_COLOURS,
)

from .closed_forms import short_wave_rate, thin_film
from .modes import Slab, growth_rates

Floats = NDArray[np.float64]
MARKERS = "os^D"


def fastest(lengths: ArrayLike, values: ArrayLike) -> tuple[float, float]:
    """Return the length of the fastest wave and its value, by cubic splines between the
    waves of a slab."""
    waves = 1 / np.asarray(lengths)
    spline = CubicSpline(waves, values)
    fine = np.linspace(waves.min(), waves.max(), 20_001)
    best = int(spline(fine).argmax())
    return float(1 / fine[best]), float(spline(fine[best]))


def orders(errors: ArrayLike) -> Floats:
    """Return the observed orders of convergence from each mesh to the next, with twice
    as many cells."""
    values = np.abs(np.asarray(errors))
    return np.log2(values[:-1] / values[1:])


def rates_of(contrast: float, found: dict) -> dict:
    """Summarise the fastest wave without stress memory: closed form, theory, and each
    mesh."""
    film = thin_film(Slab(contrast))
    expected = np.array(found["expected"])
    length, rate = fastest(found["lengths"], expected)
    peaks = [fastest(found["lengths"], values) for values in found["measured"]]
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
    """Summarise the largest amplification: expected, on each mesh, and the errors of
    its logarithm."""
    expected = np.array(found["expected"])[-1]
    simulated = np.array(found["measured"])[:, -1]
    wave = int(expected.argmax())
    errors = np.log(simulated[:, wave]) / np.log(expected[wave]) - 1
    return {
        "wavelength": found["lengths"][wave],
        "expected": expected[wave],
        "measured": simulated[:, wave],
        "relative_errors_of_logarithm": errors,
        "orders": orders(errors),
    }


def plain(value, digits: int = 4):
    """Return a value for JSON: arrays as lists, numbers rounded to significant
    digits."""
    if isinstance(value, dict):
        return {key: plain(item, digits) for key, item in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [plain(item, digits) for item in value]
    value = value.item() if isinstance(value, np.generic) else value
    return float(f"{value:.{digits}g}") if isinstance(value, float) else value


def draw(found: dict, slab_cells: tuple[int, ...], folder: Path) -> None:
    """Draw growth rates by wavelength without stress memory into a folder, one panel
    per contrast."""
    with mpl.rc_context(MATPLOTLIB_SETTINGS):
        figure = Figure(figsize=(FULL_WIDTH_IN, 2.6), layout="constrained")
        panels = figure.subplots(1, len(found))
        for axes, (contrast, case) in zip(panels, found.items(), strict=True):
            lengths = np.array(case["lengths"])
            slab = Slab(float(contrast), depth=lengths[0] / 2)
            fine = np.geomspace(1.0, lengths[0], 120)
            axes.plot(
                fine,
                growth_rates(slab, 2 * np.pi / fine),
                color="black",
                label="linearised theory",
            )
            for number, (cells, values) in enumerate(
                zip(slab_cells, case["measured"], strict=True)
            ):
                look = {"color": RUN_COLOURS[number], "mfc": "none", "markersize": 3.5}
                axes.plot(
                    lengths,
                    values,
                    MARKERS[number],
                    label=f"solver, {cells} cells to H",
                    **look,
                )
            axes.axvline(
                thin_film(slab).wavelength,
                color=MUTED_COLOUR,
                linestyle=":",
                label="fastest, thin film",
            )
            axes.axhline(
                short_wave_rate(0.45),
                color=MUTED_COLOUR,
                linestyle="--",
                linewidth=0.8,
                label="3 + 2ν",
            )
            axes.set(
                title=f"stiffness contrast {contrast}",
                xlabel="wavelength / cortical thickness",
                xscale="log",
            )
            axes.xaxis.set_major_locator(FixedLocator([1, 2, 4, 8, 16, 32, 64]))
            axes.xaxis.set_minor_locator(NullLocator())
            axes.xaxis.set_major_formatter("{x:g}")
            axes.set(
                xlim=(1.0, lengths[0] * 1.1), ylim=(0.0, 1.12 * max(case["expected"]))
            )
        panels[0].set_ylabel("growth rate of waves per growth")
        figure.legend(
            *panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=4
        )
        figure.savefig(folder / "verification-rates.png", dpi=200)
