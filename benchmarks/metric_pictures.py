"""Draw what the metrics are, on the shipped brain of 25 GW (operated).

    ./run python benchmarks/metric_pictures.py docs/images/metrics.png

The brain is measured as the workflow does with its default settings. A title is the
name of the metric or map in the tables; the caption is in docs/metrics.md. Printed are
the numbers that the picture shows.
"""

import argparse
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path
from string import ascii_lowercase
from typing import Any

import numpy as np
import pandas as pd
from gallery import WEEK, read_sound, save
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from gyriflow.anatomy.pial import PialSurface
from gyriflow.anatomy.thickness import thickness_from_labels
from gyriflow.geometry.matching import nearest_on
from gyriflow.geometry.triangles import (
    Floats,
    TriangleMesh,
    convex_hull,
    merged,
    vertex_areas,
)
from gyriflow.metrics.curvature import curvature
from gyriflow.metrics.gyrification import cap, envelope
from gyriflow.metrics.measure import CURVATURE_RADIUS_MM, BrainMetrics, measure_brain
from gyriflow.metrics.spangy import spectral_basis, spectrum
from gyriflow.metrics.tables import asymmetry
from gyriflow.quantities import SIGNED_COLOURS, VERTEX_MAPS
from gyriflow.report.pictures import scale_of
from gyriflow.report.quality import INNER_COLOUR, PIAL_COLOUR
from gyriflow.report.scene import (
    MAP,
    TISSUE,
    VIEWS,
    colour_scale,
    half_extents,
    paint,
    render,
    uniform_colours,
)
from gyriflow.report.sections import draw_outline
from gyriflow.report.style import (
    FULL_WIDTH_IN,
    MUTED_COLOUR,
    NEUTRAL_COLOUR,
    OBSERVED_SURFACE_COLOUR,
    styled,
)

HULL_COLOUR = "#0072B2"
PLAIN_COLOURS = "YlGnBu"
COLUMNS, ROW_IN = 3, 1.75
DOTS_PER_INCH = 120
BANDS = (4, 5)
# every so many vertices of the section have a line of thickness
LINES_EVERY = 3
SECTION_MM = 1.0
ZOOM_MM = 12.0
LOWER_LABEL = 0.7
QUANTILES = ("q05", "q25", "q50", "q75", "q95")
COMPARED = (
    "volume",
    "area",
    "gyrification_index",
    "mean_sulcal_depth",
    "mean_curvedness",
    "mean_thickness",
)


@dataclass(frozen=True, eq=False)
class Measured:
    """What is drawn: the surfaces in the brain's pose, its metrics, and the parts (n,)
    of the left hemisphere's mean curvature (1/mm) in bands."""

    pial: PialSurface
    left: TriangleMesh
    inner: TriangleMesh
    brain: BrainMetrics
    hull: TriangleMesh
    envelope: TriangleMesh
    in_bands: dict[int, Floats]


def measure() -> Measured:
    """Measure the brain."""
    sound = read_sound()
    pial = sound.pial
    left = sound.posed_sides["left"]
    thickness = thickness_from_labels(
        pial.cortex,
        pial.whole,
        pial.pose,
        pial.fissure_x_mm,
    )
    return Measured(
        pial=pial,
        left=left,
        inner=merged(*sound.posed_whites.values()),
        brain=measure_brain(
            pial.whole, left, pial.right, thickness_mm=thickness.measured_mm
        ),
        hull=convex_hull(left),
        envelope=envelope(left),
        in_bands=parts_in_bands(left),
    )


@styled
def draw(measured: Measured) -> Figure:
    """Draw the figure, a panel for each metric or map."""
    figure = Figure(figsize=(FULL_WIDTH_IN, 5 * ROW_IN), layout="constrained")
    grid = list(figure.subplots(5, COLUMNS).flat)
    panels = iter(grid)
    left, brain = measured.left, measured.brain
    maps = brain.maps["left"]

    draw_cut(next(panels), left)
    draw_section(next(panels), left, measured.hull, "gyrification_index", "hull")
    title = "gyrification_index_envelope"
    draw_section(next(panels), left, measured.envelope, title, "envelope")
    for name in ("sulcal_depth_mm", "local_gyrification_index"):
        draw_map(next(panels), left, name, maps[name])
    draw_thickness(next(panels), measured.pial, measured.inner)
    for name in ("shape_index", "mean_curvature", "curvedness"):
        draw_map(next(panels), left, name, maps[name])
    for band, values in measured.in_bands.items():
        end = float(np.quantile(np.abs(values), 0.98))
        draw_map(
            next(panels),
            left,
            "mean_curvature",
            values,
            title=f"spangy_B{band}_power",
            note=f"mean curvature (1/mm) in B{band}",
            scale=colour_scale(SIGNED_COLOURS, -end, end),
        )
    name = "spangy_dominant_band"
    scale = colour_scale(SIGNED_COLOURS, -max(BANDS), max(BANDS))
    draw_map(next(panels), left, name, maps[name], scale=scale)
    draw_map(next(panels), left, "thickness_mm", maps["thickness_mm"])
    draw_quantiles(next(panels), left, brain)
    draw_asymmetry(next(panels), brain)
    for letter, axes in zip(ascii_lowercase, grid, strict=False):
        axes.set_title(rf"$\bf{{{letter}}}$  {axes.get_title()}")
    return figure


def parts_in_bands(mesh: TriangleMesh) -> dict[int, Floats]:
    """Return the parts of the mean curvature (1/mm) of a hemisphere in `BANDS`."""
    bent = curvature(mesh, radius_mm=CURVATURE_RADIUS_MM)
    basis = spectral_basis(mesh, f"B{max(BANDS)}")
    found = spectrum(bent.mean, basis, radius_mm=CURVATURE_RADIUS_MM)
    parts = {}
    for band in BANDS:
        is_in = found.band == band
        part = basis.functions[:, is_in] @ found.coefficients[is_in]
        parts[band] = np.asarray(basis.places @ part)
    return parts


def draw_surface(
    axes: Axes, mesh: TriangleMesh, colours: Floats, view: str, light: Any
) -> None:
    """Draw a surface from one side, so large that it fills the panel."""
    wide, tall = (1.03 * half for half in half_extents(mesh, VIEWS[view]))
    pixels_per_mm = FULL_WIDTH_IN / COLUMNS * DOTS_PER_INCH / (2 * wide)
    axes.imshow(
        render(mesh, colours, VIEWS[view], (wide, tall), pixels_per_mm, light=light)
    )
    axes.set_axis_off()


def draw_map(
    axes: Axes,
    mesh: TriangleMesh,
    name: str,
    values: Floats,
    *,
    title: str = "",
    note: str = "",
    scale: ScalarMappable | None = None,
) -> None:
    """Draw a map on the left hemisphere, from its left, with its colours."""
    record = VERTEX_MAPS[name]
    if scale is None and (record.colours or record.is_signed):
        scale = scale_of(name, values)
    elif scale is None:
        # a map that pages do not show has no colours of its own
        scale = colour_scale(PLAIN_COLOURS, 0.0, float(np.nanquantile(values, 0.98)))
    draw_surface(axes, mesh, paint(values, scale), "left", MAP)
    axes.figure.colorbar(scale, ax=axes, shrink=0.7, aspect=12, pad=0.02)
    unit = record.unit
    axes.set_title(title or f"{name}{'' if unit in ('1', '') else f' ({unit})'}")
    write_below(axes, note)


def write_below(axes: Axes, note: str) -> None:
    """Write what a panel shows below it."""
    axes.text(
        0.5,
        -0.02,
        note,
        transform=axes.transAxes,
        ha="center",
        va="top",
        fontsize=5.5,
    )


def draw_cut(axes: Axes, mesh: TriangleMesh) -> None:
    """Draw the medial side of the left hemisphere, closed by its cut, which is grey."""
    closed = cap(mesh)
    colours = uniform_colours(closed, OBSERVED_SURFACE_COLOUR)
    by_face = np.repeat(colours[:1], len(closed.faces), axis=0)
    by_face[len(mesh.faces) :] = uniform_colours(closed, NEUTRAL_COLOUR)[0]
    draw_surface(axes, closed, by_face, "right", TISSUE)
    axes.set_title("area")
    write_below(axes, "medial side; grey: the cut, left out")


def draw_section(
    axes: Axes,
    mesh: TriangleMesh,
    around: TriangleMesh,
    title: str,
    name: str,
) -> None:
    """Draw a coronal section of a hemisphere and of what is around it."""
    at = float(np.median(mesh.vertices[:, 1]))
    draw_outline(axes, around, "coronal", at, HULL_COLOUR, 1.0)
    draw_outline(axes, cap(mesh), "coronal", at, PIAL_COLOUR, 1.0)
    axes.set(aspect="equal")
    axes.autoscale_view()
    axes.set_axis_off()
    axes.set_title(title)
    write_below(axes, f"orange: pial surface; blue: {name}")


def draw_thickness(axes: Axes, pial: PialSurface, inner: TriangleMesh) -> None:
    """Draw both borders of the cortex in a part of a coronal section, and distances
    from the pial to the inner one."""
    mesh = pial.whole
    at = float(np.median(mesh.vertices[:, 1]))
    draw_outline(axes, inner, "coronal", at, INNER_COLOUR, 1.0)
    draw_outline(axes, mesh, "coronal", at, PIAL_COLOUR, 1.0)
    near = np.flatnonzero(np.abs(mesh.vertices[:, 1] - at) < SECTION_MM)
    near = near[::LINES_EVERY]
    start = mesh.vertices[near]
    end = nearest_on(start, inner)[2]
    is_in_plane = np.abs(end[:, 1] - start[:, 1]) < SECTION_MM
    lines = np.stack([start, end], axis=1)[is_in_plane][..., [0, 2]]
    axes.add_collection(
        LineCollection(list(lines), colors=MUTED_COLOUR, linewidths=0.6)
    )
    outermost = mesh.vertices[near[mesh.vertices[near, 0].argmin()]]
    half = np.array([-ZOOM_MM, ZOOM_MM]) / 2
    axes.set(xlim=outermost[0] + half, ylim=outermost[2] + half, aspect="equal")
    axes.set_axis_off()
    axes.set_title("mean_thickness")
    write_below(axes, "orange: pial surface; blue: inner border")


def draw_quantiles(axes: Axes, mesh: TriangleMesh, brain: BrainMetrics) -> None:
    """Draw the area by mean curvature, and the quantiles in the table."""
    bent = brain.maps["left"]["mean_curvature"]
    is_reliable = brain.maps["left"]["reliable"] == 1
    areas = vertex_areas(mesh)
    axes.hist(
        bent[is_reliable],
        bins=np.linspace(-0.2, 0.4, 61),
        weights=areas[is_reliable] / areas[is_reliable].sum(),
        color=OBSERVED_SURFACE_COLOUR,
    )
    table = brain.table.query("hemisphere == 'left'").set_index("metric")["value"]
    top = axes.get_ylim()[1]
    # neighbours at two heights, as they are close to each other
    heights = cycle((top, LOWER_LABEL * top))
    for quantile, height in zip(QUANTILES, heights, strict=False):
        value = table[f"mean_curvature_{quantile}"]
        axes.axvline(value, color="black", linewidth=0.8)
        style: Any = {"rotation": 90, "fontsize": 5.5, "ha": "right", "va": "top"}
        axes.text(value, height, quantile, **style)
        print(f"mean_curvature_{quantile}: {value:.3f} 1/mm")
    axes.set(xlabel="mean curvature (1/mm)", ylabel="share of the area")
    axes.set_title("mean_curvature_q05 … q95")


def draw_asymmetry(axes: Axes, brain: BrainMetrics) -> None:
    """Draw the asymmetry index of some metrics of the brain."""
    table = brain.table.assign(subject="brain", run="observed", week=float(WEEK))
    found = asymmetry(table).set_index("metric")["asymmetry_index"]
    values = pd.Series({name: float(found[name]) for name in COMPARED})
    places = np.arange(len(values))[::-1]
    axes.barh(places, values, color=HULL_COLOUR)
    axes.axvline(0.0, color="black", linewidth=0.6)
    axes.set_yticks(places, list(values.index), fontsize=5.5)
    axes.set(xlabel="right has more ← 0 → left has more")
    axes.set_title("asymmetry index")
    print(values.to_string())


def main() -> None:
    """Measure the brain and draw the picture."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("picture", type=Path)
    picture = parser.parse_args().picture
    save(draw(measure()), picture)


if __name__ == "__main__":
    main()
