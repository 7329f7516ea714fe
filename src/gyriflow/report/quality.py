"""Quality control before the solve: a page and a verdict for each brain, and the table of all brains of a study."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure, SubFigure
from matplotlib.patches import Patch
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from ..geometry.alignment import angle_deg
from ..geometry.deformations import voxel_index
from ..geometry.poses import pose_from
from ..geometry.triangles import Floats, TriangleMesh
from ..parameters.measures import SHAPE_MEASURES
from ..parameters.schemes import LabelScheme
from .scene import VIEWS, colour_scale, half_extents, paint, render, restricted, uniform_colours
from .sections import PLANES, SCALE_BAR_MM, Extent, draw_image, draw_outline, plane_grid
from .style import FULL_WIDTH_IN, REAL_SURFACE_COLOUR, new_figure, styled, wrap

Verdict = Literal["fine", "look"]
VERDICTS: Mapping[Verdict, tuple[str, str]] = {"fine": ("No warnings.", "#009E73"), "look": ("Look at:", "#E69F00")}
"""What stands above the warnings of a page, and the colour of the verdict."""
TISSUES = {1: "cortex", 2: "inside the cortex", 3: "ventricles", 4: "other labels"}
"""Groups of labels as they are coloured, in place of an image."""
TISSUE_COLOURS = ("#FFFFFF", "#B7A58B", "#E9E4DA", "#9CC3E0", "#E6E6E6")
PIAL_COLOUR, INNER_COLOUR = "#D55E00", "#0072B2"
# the same for all brains, so that their pages can be compared
THICKNESS_LIMITS_MM = (0.0, 4.0)
SHAPE_VIEWS = ("left", "right", "top", "bottom")
THICKNESS_VIEWS = ("left", "right", "left medial", "right medial")
OTHER_VIEWS = ("front", "back", "left medial", "right medial")
MOST_LINES, LINE_LETTERS = 8, 138
# in inches
ROWS_IN, HEAD_IN, LINE_IN = (2.4, 1.42, 1.42), 0.9, 0.13
PIXELS_PER_INCH = 200

COLUMNS = (
    *("subject", "week", "population", "source", "sides", "verdict", "cause", "warning_count", "warnings"),
    *("area_cm2", "area_left_cm2", "area_right_cm2", "volume_ml", "share_of_expected_volume"),
    *("mean_thickness_mm", "thickness_measured_share", "voxels_through_cortex"),
    *("pose_by", "rotation_deg", "asymmetry_mm", "page"),
)
"""The columns; the first three, `source` and `sides` are of the configuration, the others of the surface stage."""


@dataclass(frozen=True, eq=False)
class Brain:
    """What a page shows of a brain.

    Attributes
    ----------
    pial
        The whole surface, in RAS+ mm.
    fissure_x_mm
        Where the medial views part the hemispheres.
    thickness_mm : (n,) float or None
        At the vertices of the surface, NaN where it was not measured.
    white
        The white surface, in the same coordinates, if it is given.
    image, tissues
        The (i, j, k) grey values and groups of labels (`TISSUES`) behind the outlines, as far as they are there, each
        with the (4, 4) affine from voxel index to the surface's coordinates.
    """

    pial: TriangleMesh
    fissure_x_mm: float
    thickness_mm: Floats | None = None
    white: TriangleMesh | None = None
    image: tuple[Floats, Floats] | None = None
    tissues: tuple[NDArray[np.integer], Floats] | None = None


def tissue_groups(labels: NDArray[np.integer], scheme: LabelScheme) -> NDArray[np.uint8]:
    """Return the (i, j, k) group of each voxel as in `TISSUES`; 0 is background."""
    groups = np.where(labels > 0, 4, 0).astype(np.uint8)
    groups[np.isin(labels, scheme.cerebrum)] = 2
    groups[np.isin(labels, scheme.cortex)] = 1
    groups[np.isin(labels, scheme.ventricles)] = 3
    return groups


@styled
def quality_page(
    brain: Brain, *, title: str, verdict: Verdict, facts: Mapping[str, str], warnings: Sequence[str]
) -> Figure:
    """Draw the page of a brain: three planes, the surface in four views, thickness in four views, and its warnings.

    The image lies behind the outlines where there is one, else the labels. A page ends below its last warning.
    """
    lines = [line for text in warnings for line in wrap(f"• {text}", LINE_LETTERS).split("\n")]
    if len(lines) > MOST_LINES:
        lines = [*lines[: MOST_LINES - 1], "• … more in quality.csv"]
    figure = new_figure(FULL_WIDTH_IN, HEAD_IN + sum(ROWS_IN) + LINE_IN * len(lines))
    heading, colour = VERDICTS[verdict]
    left: dict[str, Any] = {"x": 0.015, "ha": "left", "fontsize": 6.5}
    words = wrap("   ".join(f"{name}: {value}" for name, value in facts.items()), LINE_LETTERS)
    figure.suptitle(title, x=0.015, ha="left", fontsize=10, fontweight="bold")
    box = {"boxstyle": "round,pad=0.3", "facecolor": colour, "edgecolor": "none"}
    place: dict[str, Any] = {"ha": "right", "va": "top", "fontsize": 10, "fontweight": "bold"}
    figure.text(0.985, 0.985, verdict.upper(), color="white", bbox=box, **place)
    figure.supxlabel("\n".join([heading, *lines]), **left)
    rows: Any = figure.subfigures(3, 1, height_ratios=ROWS_IN)
    planes, views, thickness = rows
    planes.suptitle(words, **left)
    _draw_planes(planes, brain)
    uniform = uniform_colours(brain.pial, REAL_SURFACE_COLOUR)
    _draw_views(views, brain, uniform, SHAPE_VIEWS)
    if brain.thickness_mm is None:
        _draw_views(thickness, brain, uniform, OTHER_VIEWS)
    else:
        scale = colour_scale(SHAPE_MEASURES["thickness_mm"].colours, *THICKNESS_LIMITS_MM, cut=True)
        panels = _draw_views(thickness, brain, paint(brain.thickness_mm, scale), THICKNESS_VIEWS)
        unknown = "" if np.isfinite(brain.thickness_mm).all() else "\ngrey: not measured"
        thickness.colorbar(scale, ax=panels).set_label(f"thickness (mm){unknown}", fontsize=6.5)
    for letter, row in zip("abc", rows, strict=True):
        row.text(0.015, 0.85 if row is planes else 1.0, letter, ha="left", va="top", fontsize=9, fontweight="bold")
    return figure


def _draw_planes(figure: SubFigure, brain: Brain) -> None:
    """Draw three planes through the middle, the sagittal one through the middle of a hemisphere."""
    low, high = brain.pial.vertices.min(axis=0), brain.pial.vertices.max(axis=0)
    middle, fissure = (low + high) / 2, float(np.clip(brain.fissure_x_mm, low[0], high[0]))
    # the larger hemisphere, of equal ones the right one
    outer = high[0] if high[0] - fissure > 0.8 * (fissure - low[0]) else low[0]
    at = {"coronal": middle[1], "axial": middle[2], "sagittal": (fissure + outer) / 2}
    grids = {plane: plane_grid(plane, at[plane], low, high) for plane in PLANES}
    widths = [right - left for _, (left, right, *_) in grids.values()]
    tallest = max(top - bottom for _, (*_, bottom, top) in grids.values())
    colour = "black" if brain.image is None else "white"
    panels = figure.subplots(1, 3, width_ratios=widths)
    for axes, (plane, (points, extent)) in zip(panels, grids.items(), strict=True):
        if brain.image:
            draw_image(axes, *brain.image, points, extent)
        if brain.tissues:
            _draw_tissues(axes, *brain.tissues, points, extent, filled=brain.image is None)
        if brain.white is not None:
            draw_outline(axes, brain.white, plane, at[plane], INNER_COLOUR)
        draw_outline(axes, brain.pial, plane, at[plane], PIAL_COLOUR)
        # all at one scale
        axes.set(xlim=extent[:2], ylim=(sum(extent[2:]) / 2 + np.array([-0.5, 0.5]) * tallest), aspect="equal")
        axes.set_axis_off()
        axes.set_title(f"{plane}, {'xyz'[PLANES[plane][0]]} = {at[plane]:.0f} mm", fontsize=6.5, pad=2)
        for x, end in zip((0.03, 0.97), "PA" if plane == "sagittal" else "LR", strict=True):
            axes.text(x, 0.5, end, transform=axes.transAxes, ha="center", va="center", fontsize=6.5, color=colour)
    coronal, (left, _, bottom, _) = panels[0], grids["coronal"][1]
    coronal.plot([left + 1, left + 1 + SCALE_BAR_MM], [bottom + 2] * 2, color=colour, linewidth=1.2)
    coronal.text(left + 1, bottom + 3, f"{SCALE_BAR_MM:g} mm", fontsize=6, color=colour)
    keys = [Patch(color=PIAL_COLOUR, label="pial surface")]
    if brain.white is not None or brain.tissues:
        keys.append(Patch(color=INNER_COLOUR, label="inner border of the cortex"))
    if brain.tissues and not brain.image:
        there = np.unique(brain.tissues[0])
        keys += [Patch(color=TISSUE_COLOURS[code], label=name) for code, name in TISSUES.items() if code in there]
    figure.legend(handles=keys, loc="outside lower center", ncols=len(keys), fontsize=6, handlelength=1.0)


def _draw_tissues(
    axes: Axes, groups: NDArray[np.integer], affine: Floats, points: Floats, extent: Extent, *, filled: bool
) -> None:
    """Draw the groups of labels in a plane where they are to be `filled`, and the inner border of the cortex."""
    index = voxel_index(points, affine)
    if filled:
        shown = map_coordinates(groups, index, order=0, mode="constant")
        look: dict[str, Any] = {"cmap": ListedColormap(TISSUE_COLOURS), "vmin": -0.5, "vmax": 4.5, "origin": "lower"}
        axes.imshow(shown, extent=extent, interpolation="none", **look)
    inside = map_coordinates(np.isin(groups, (2, 3)).astype(np.float32), index, order=1)
    if (groups == 1).any() and inside.min() < 0.5 < inside.max():
        right, up = np.linspace(*extent[:2], inside.shape[1]), np.linspace(*extent[2:], inside.shape[0])
        axes.contour(right, up, inside, levels=[0.5], colors=INNER_COLOUR, linewidths=0.6)


def _draw_views(figure: SubFigure, brain: Brain, colours: Floats, names: Sequence[str]) -> list[Axes]:
    """Draw a row of views at one scale; those of a hemisphere that is not there stay away."""
    every = [half_extents(brain.pial, VIEWS[name]) for name in (*SHAPE_VIEWS, *OTHER_VIEWS)]
    wide, tall = 1.04 * np.max(every, axis=0)
    panels = list(figure.subplots(1, len(names)))
    pixels_per_mm = PIXELS_PER_INCH * (FULL_WIDTH_IN - 0.7) / len(names) / (2 * wide)
    for axes, view in zip(panels, [VIEWS[name] for name in names], strict=True):
        axes.set_axis_off()
        mesh, painted = restricted(brain.pial, colours, view.hemisphere, brain.fissure_x_mm)
        if not len(mesh.faces):
            continue
        picture = render(mesh, painted, view, half_width_mm=wide, half_height_mm=tall, pixels_per_mm=pixels_per_mm)
        axes.imshow(picture)
        axes.set_title(view.name, fontsize=6.5, pad=1)
        for x, end in zip((0.05, 0.95), view.ends, strict=True):
            axes.text(x, 0.97, end, transform=axes.transAxes, ha="center", va="top", fontsize=6, color="#767676")
    return panels


def quality_row(
    labels: Mapping[str, Any],
    report: Mapping[str, Any],
    thickness: Mapping[str, Any],
    warnings: Sequence[str],
    expected_ml: float,
) -> dict[str, Any]:
    """Return the row of a brain whose surface was made; its verdict is "fine", or "look" where there are warnings.

    Parameters
    ----------
    labels
        subject, week, population, source, sides and page.
    report, thickness
        What the surface stage and the thickness say, as in `surface.json` and `thickness.json`.
    expected_ml
        The coarse volume of a cerebrum of the week; of one side alone half of it is expected.
    """
    area, sides = report["area_cm2"], str(labels["sides"]).split()
    pose = pose_from(report["pose"])
    return {
        **labels,
        "verdict": "look" if warnings else "fine",
        "cause": "",
        "warning_count": len(warnings),
        "warnings": " | ".join(warnings),
        "area_cm2": area["whole"],
        "area_left_cm2": area.get("left"),
        "area_right_cm2": area.get("right"),
        "volume_ml": report["volume_mL"],
        "share_of_expected_volume": report["volume_mL"] / expected_ml * 2 / len(sides),
        "mean_thickness_mm": thickness.get("mean_mm"),
        "thickness_measured_share": thickness.get("measured_area_share"),
        "voxels_through_cortex": thickness.get("voxels_through_cortex"),
        "pose_by": pose.by,
        "rotation_deg": angle_deg(pose.of_file()[:3, :3]),
        "asymmetry_mm": report.get("asymmetry_mm"),
    }


def quality_table(
    rows: Sequence[Mapping[str, Any]], refused: Sequence[Mapping[str, Any]], order: Sequence[str]
) -> pd.DataFrame:
    """Return the rows of all brains in an order of their ids.

    Parameters
    ----------
    rows
        What `quality_row` returns.
    refused
        labels and cause of the brains that were refused.
    """
    every = [*rows, *({**row, "verdict": "refused", "warning_count": 0} for row in refused)]
    table = pd.DataFrame(every, columns=list(COLUMNS)).set_index("subject", drop=False)
    return table.loc[[name for name in order if name in table.index]].reset_index(drop=True)


def facts(row: Mapping[str, Any]) -> dict[str, str]:
    """Return what stands in the head of a brain's page, by name."""
    sides = str(row["sides"]).split()
    both = " + ".join(f"{row[f'area_{side}_cm2']:.1f}" for side in sides)
    turned = row["rotation_deg"]
    shown = {
        "source": str(row["source"]),
        "hemispheres": " and ".join(sides),
        "area": f"{row['area_cm2']:.1f} cm² ({both})",
        "volume": f"{row['volume_ml']:.1f} mL ({100 * row['share_of_expected_volume']:.0f} % of that expected)",
        "pose": f"by {row['pose_by']}, turned by {turned:.1f}°" if turned >= 0.05 else "as in the file",
    }
    if row["asymmetry_mm"] is not None:
        shown["asymmetry"] = f"{row['asymmetry_mm']:.1f} mm"
    if row["mean_thickness_mm"] is not None:
        share = 100 * row["thickness_measured_share"]
        shown["thickness"] = f"{row['mean_thickness_mm']:.2f} mm (measured on {share:.0f} %)"
    return shown
