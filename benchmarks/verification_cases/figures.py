"""The figure of the verification: rates of growth of waves by wavelength."""

from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator

from gyriflow.report.style import FULL_WIDTH_IN, MUTED_COLOUR, RUN_COLOURS, SETTINGS, new_figure

from .closed_forms import short_wave_rate, thin_film
from .modes import Slab, growth_rates

MARKERS = "os^D"


def rates(found: dict, slab_cells: tuple[int, ...]) -> Figure:
    """Draw the rates of growth by wavelength where stress is forgotten, a panel for each contrast."""
    figure = new_figure(FULL_WIDTH_IN, 2.6)
    panels = figure.subplots(1, len(found))
    for axes, (contrast, case) in zip(panels, found.items(), strict=True):
        lengths = np.array(case["lengths"])
        slab = Slab(float(contrast), depth=lengths[0] / 2)
        fine = np.geomspace(1.0, lengths[0], 120)
        axes.plot(fine, growth_rates(slab, 2 * np.pi / fine), color="black", label="linearised theory")
        for number, (cells, values) in enumerate(zip(slab_cells, case["measured"], strict=True)):
            look = {"color": RUN_COLOURS[number], "mfc": "none", "markersize": 3.5}
            axes.plot(lengths, values, MARKERS[number], label=f"solver, {cells} cells to H", **look)
        axes.axvline(thin_film(slab).wavelength, color=MUTED_COLOUR, linestyle=":", label="fastest, thin film")
        axes.axhline(short_wave_rate(0.45), color=MUTED_COLOUR, linestyle="--", linewidth=0.8, label="3 + 2ν")
        axes.set(title=f"stiffness contrast {contrast}", xlabel="wavelength / cortical thickness", xscale="log")
        axes.xaxis.set_major_locator(FixedLocator([1, 2, 4, 8, 16, 32, 64]))
        axes.xaxis.set_minor_locator(NullLocator())
        axes.xaxis.set_major_formatter("{x:g}")
        axes.set(xlim=(1.0, lengths[0] * 1.1), ylim=(0.0, 1.12 * max(case["expected"])))
    panels[0].set_ylabel("growth rate of waves per growth")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return figure


def draw(found: dict, slab_cells: tuple[int, ...], folder: Path) -> None:
    """Write the figure into a folder."""
    with mpl.rc_context(SETTINGS):
        rates(found, slab_cells).savefig(folder / "verification-rates.png", dpi=200)
