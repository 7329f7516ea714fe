"""Figures of the verification: convergence, rates of growth by wavelength, and remembered stress."""

from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator

from gyriflow.report.style import FULL_WIDTH_IN, MUTED_COLOUR, RUN_COLOURS, SETTINGS, new_figure

from .closed_forms import short_wave_rate, thin_film
from .modes import Slab, amplifications, critical_growth, growth_rates

HEIGHT_IN = 2.6
THEORY = {"color": "black", "linewidth": 1.2, "label": "linearised theory"}
MARKERS = "os^D"
CASES = {"uniform": "uniform layers", "graded": "graded layers", "stretched": "kept stretch"}


def by_length(axes: Axes, shown: list[float], label: str) -> None:
    """Gives axes a logarithmic abscissa of wavelengths."""
    axes.set(xscale="log", xlabel="wavelength / cortical thickness", ylabel=label)
    axes.xaxis.set_major_locator(FixedLocator(shown))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter("{x:g}")


def log_scales(axes: Axes, ticks: list, xlabel: str, ylabel: str) -> None:
    """Gives axes logarithmic scales with ticks at given places."""
    axes.set(xscale="log", yscale="log", xlabel=xlabel, ylabel=ylabel)
    axes.xaxis.set_major_locator(FixedLocator(ticks))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter("{x:g}")


def slope(axes: Axes, x, at: float, order: float) -> None:
    """Draws the line of an order through a value at the last of x, named beside it."""
    x = np.asarray(x, dtype=float)
    y = at * (x / x[-1]) ** order
    axes.plot(x, y, ":", color=MUTED_COLOUR, linewidth=1.0, zorder=1)
    side, shift = ("left", 4) if order > 0 else ("right", -4)
    place, place_of_text = (x[-2], y[-2]), (shift, -4)
    text = {"textcoords": "offset points", "ha": side, "va": "top", "color": MUTED_COLOUR}
    axes.annotate(f"order {abs(order):g}", place, place_of_text, **text)


def convergence(found: dict, slab_cells: tuple[int, ...]) -> Figure:
    """Returns Taylor's remainders, and the errors of manufactured solutions and of growing waves by mesh."""
    figure = new_figure(FULL_WIDTH_IN, HEIGHT_IN)
    taylor, manufactured, waves = figure.subplots(1, 3)
    one = found["consistency"]
    for i, (key, name) in enumerate((("energy_remainders", "energy"), ("residual_remainders", "forces"))):
        values = np.array(one[key]) / one[key][0]
        look = {"color": RUN_COLOURS[i], "markersize": 6 - 3 * i, "mfc": ("none", RUN_COLOURS[i])[i]}
        taylor.plot(one["lengths"], values, MARKERS[i] + ("-", "--")[i], label=name, **look)
    slope(taylor, one["lengths"], 0.3 * values[-1], 2)
    log_scales(taylor, one["lengths"], "step along a direction", "Taylor remainder (relative)")
    taylor.legend(loc="upper left")

    for i, (case, name) in enumerate(CASES.items()):
        own = found["manufactured"][case]
        for key, line in (("gradient_errors", "--"), ("displacement_errors", "-")):
            label = name if line == "-" else None
            manufactured.plot(own["cells"], own[key], MARKERS[i] + line, color=RUN_COLOURS[i], mfc="none", label=label)
    slope(manufactured, own["cells"], 0.6 * own["displacement_errors"][-1], -2)
    slope(manufactured, own["cells"], 0.7 * own["gradient_errors"][-1], -1)
    log_scales(manufactured, own["cells"], "cells along a side", "relative error")
    manufactured.plot([], [], "-", color=MUTED_COLOUR, label="displacement")
    manufactured.plot([], [], "--", color=MUTED_COLOUR, label="its gradient")
    manufactured.legend(loc="lower left", fontsize=6, labelspacing=0.25)
    manufactured.set_ylim(bottom=4e-4)

    for i, (contrast, own) in enumerate(found["rates"].items()):
        expected = np.array(own["expected"])
        errors = np.abs(np.array(own["measured"]) / expected - 1)[:, expected.argmax()]
        label = f"contrast {contrast}"
        waves.plot(slab_cells, errors, MARKERS[i] + "-", color=RUN_COLOURS[i], mfc="none", label=label)
    slope(waves, slab_cells, 0.5 * errors[-1], -2)
    log_scales(
        waves, list(slab_cells), "cells to a cortical thickness", "relative error of the fastest\nwave's growth rate"
    )
    waves.legend(loc="lower left")
    return figure


def rates(found: dict, slab_cells: tuple[int, ...]) -> Figure:
    """Returns the rates of growth by wavelength where stress is forgotten, a panel for each contrast."""
    figure = new_figure(FULL_WIDTH_IN, HEIGHT_IN)
    all_axes = figure.subplots(1, len(found["rates"]))
    for axes, (contrast, own) in zip(all_axes, found["rates"].items(), strict=True):
        lengths = np.array(own["lengths"])
        slab = Slab(float(contrast), depth=lengths[0] / 2)
        fine = np.geomspace(1.0, lengths[0], 120)
        axes.plot(fine, growth_rates(slab, 2 * np.pi / fine), **THEORY)
        for i, (cells, values) in enumerate(zip(slab_cells, own["measured"], strict=True)):
            label = f"solver, {cells} cells to H"
            axes.plot(lengths, values, MARKERS[i], color=RUN_COLOURS[i], mfc="none", markersize=3.5, label=label)
        axes.axvline(thin_film(slab).wavelength, color=MUTED_COLOUR, linestyle=":", label="fastest, thin film")
        axes.axhline(short_wave_rate(0.45), color=MUTED_COLOUR, linestyle="--", linewidth=0.8, label="3 + 2ν")
        axes.set_title(f"stiffness contrast {contrast}")
        by_length(axes, [1, 2, 4, 8, 16, 32, 64], "")
        axes.set_xlim(1.0, lengths[0] * 1.1)
        axes.set_ylim(0.0, 1.12 * max(own["expected"]))
    all_axes[0].set_ylabel("growth rate of waves per growth")
    figure.legend(*all_axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return figure


def memory(found: dict, cells: tuple[int, ...]) -> Figure:
    """Returns amplifications where stress is kept, by wavelength and by growth."""
    figure = new_figure(FULL_WIDTH_IN, HEIGHT_IN + 0.7)
    by_wave, by_growth = figure.subplots(1, 2)
    contrast, step = found["contrast"], found["growth"]
    runs = found["memory"]
    own = runs["inf"]
    lengths, steps = np.array(own["lengths"]), len(own["expected"]) - 1
    kept = Slab(contrast, depth=lengths[0] / 2, memory=np.inf)
    fine = np.geomspace(lengths[-1], lengths[0], 80)
    by_wave.plot(fine, amplifications(kept, 2 * np.pi / fine, step, steps)[-1], **THEORY)
    for i, (count, values) in enumerate(zip(cells, own["measured"], strict=True)):
        label = f"solver, {count} cells to H"
        by_wave.plot(lengths, values[-1], MARKERS[i], color=RUN_COLOURS[i], mfc="none", label=label)
    label = "fastest, thin film"
    by_wave.axvline(thin_film(kept).wavelength, color=MUTED_COLOUR, linestyle=":", label=label)
    by_length(by_wave, [4, 6, 8, 12, 16, 24, 48], f"height over that at the start,\nafter growth by {step * steps:.3g}")
    by_wave.set_title("all stress kept")

    wave = int(np.argmax(own["expected"][-1]))
    growth = step * np.arange(steps + 1)
    names = {"inf": "all stress kept", "0.05": "kept over growth by 0.05", "0": "forgotten each step"}
    for i, (tau, name) in enumerate(names.items()):
        expected = np.array(runs[tau]["expected"])[:, wave]
        finest = np.array(runs[tau]["measured"][-1])[:, wave]
        by_growth.plot(growth, expected, color=RUN_COLOURS[i])
        label = f"{name}, {cells[-1] if tau == 'inf' else cells[2]} cells to H"
        by_growth.plot(growth, finest, MARKERS[i], color=RUN_COLOURS[i], mfc="none", label=label)
    critical = critical_growth(kept, 2 * np.pi / lengths[[wave]], step / 4, 0.1)[0]
    by_growth.axvline(critical, color=MUTED_COLOUR, linestyle="--", linewidth=0.8, label="critical growth, stress kept")
    by_growth.set_title(f"waves of {lengths[wave]:g} H")
    by_growth.set(yscale="log", xlabel="growth of the cortex", ylabel="height over that at the start")
    by_growth.yaxis.set_major_locator(FixedLocator([1, 2, 3, 4, 6]))
    by_growth.yaxis.set_minor_locator(NullLocator())
    by_growth.yaxis.set_major_formatter("{x:g}")
    for axes, columns in ((by_wave, 2), (by_growth, 1)):
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=columns)
    return figure


def draw(found: dict, folder: Path) -> None:
    """Writes the figures into a folder; `found` also names the meshes and the steps with memory."""
    charts = {
        "convergence": (convergence, found["slab_cells"]),
        "rates": (rates, found["slab_cells"]),
        "memory": (memory, found["memory_cells"]),
    }
    for name, (chart, cells) in charts.items():
        with mpl.rc_context(SETTINGS):
            chart(found, cells).savefig(folder / f"verification-{name}.png", dpi=200)
