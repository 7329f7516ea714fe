"""Quality control before the solve: a page and a verdict for each brain, and the table of all brains of a study."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from ..geometry.alignment import angle_deg
from ..geometry.poses import pose_from
from ..geometry.triangles import Floats, TriangleMesh
from ..parameters.measures import SHAPE_MEASURES
from ..parameters.schemes import LabelScheme
from .scene import VIEWS, View, colour_scale, half_extents, hemisphere_faces, paint, render, restricted, uniform_colours
from .sections import PLANES, SCALE_BAR_MM, draw_image, draw_outline, plane_grid, voxel_index
from .style import FULL_WIDTH_IN, REAL_SURFACE_COLOUR, styled, synthetic_note, wrap

Verdict = Literal["fine", "look", "refused"]
VERDICT_COLOURS: Mapping[Verdict, str] = {"fine": "#009E73", "look": "#E69F00", "refused": "#D55E00"}

TISSUES = {
    1: ("cortex", "#B7A58B"),
    2: ("inside the cortex", "#E9E4DA"),
    3: ("ventricles", "#9CC3E0"),
    4: ("other labels", "#E6E6E6"),
}
"""Groups of labels as they are coloured, in place of an image."""
PIAL_COLOUR, INNER_COLOUR = "#D55E00", "#0072B2"
# the same for all brains, so that their pages can be compared
THICKNESS_LIMITS_MM = (0.0, 4.0)
SHAPE_VIEWS = ("left", "right", "top", "bottom")
THICKNESS_VIEWS = ("left", "right", "left medial", "right medial")
OTHER_VIEWS = ("front", "back", "left medial", "right medial")
MOST_LINES, LINE_LETTERS = 8, 138
# in inches, from the top of the page
HEAD_IN, PLANES_IN, VIEWS_IN, FOOT_IN, LINE_IN = 0.62, 2.4, 1.42, 0.35, 0.13
PIXELS_PER_INCH = 200


COLUMNS = (
    *("subject", "week", "population", "source", "sides", "verdict", "cause", "warning_count", "warnings"),
    *("area_cm2", "area_left_cm2", "area_right_cm2", "volume_ml", "share_of_expected_volume"),
    *(
        "mean_thickness_mm",
        "thickness_measured_share",
        "voxels_through_cortex",
        "pose_by",
        "rotation_deg",
        "asymmetry_mm",
        "page",
    ),
)
"""The columns; the first three, `source` and `sides` are of the configuration, the others of the surface stage."""
SEPARATOR = " | "
"""Between the warnings of a brain in its row."""


@dataclass(frozen=True, eq=False)
class Volume:
    """A volume behind the outlines: grey values, or groups of labels (`TISSUES`), and voxel index to position in mm.

    Attributes
    ----------
    image : (i, j, k) float or None
    tissues : (i, j, k) int or None
    affine : (4, 4) float
        To the surface's coordinates.
    """

    image: NDArray | None
    tissues: NDArray[np.integer] | None
    affine: Floats


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
    volumes
        What lies behind the outlines: the labels, and the image, as far as they are there.
    """

    pial: TriangleMesh
    fissure_x_mm: float
    thickness_mm: Floats | None = None
    white: TriangleMesh | None = None
    volumes: Sequence[Volume] = ()


def tissue_groups(labels: NDArray[np.integer], scheme: LabelScheme) -> NDArray[np.uint8]:
    """Returns the (i, j, k) group of each voxel as in `TISSUES`; 0 is background."""
    groups = np.where(labels > 0, 4, 0).astype(np.uint8)
    groups[np.isin(labels, scheme.cerebrum)] = 2
    groups[np.isin(labels, scheme.cortex)] = 1
    groups[np.isin(labels, scheme.ventricles)] = 3
    return groups


@styled
def quality_page(
    brain: Brain,
    *,
    title: str,
    verdict: Verdict,
    facts: Mapping[str, str],
    warnings: Sequence[str],
    synthetic: bool = False,
) -> Figure:
    """Returns the page of a brain: three planes, the surface in four views, thickness in four views, and its warnings.

    The image lies behind the outlines where there is one, else the labels. A page ends below its last warning.
    """
    lines = _warning_lines(warnings)
    foot = FOOT_IN + LINE_IN * len(lines)
    height = HEAD_IN + PLANES_IN + 2 * VIEWS_IN + foot
    figure = Figure(figsize=(FULL_WIDTH_IN, height))
    _draw_head(figure, title + (f" ({synthetic_note()})" if synthetic else ""), verdict, facts)
    _draw_planes(figure, brain, top=height - HEAD_IN)
    uniform = uniform_colours(brain.pial, REAL_SURFACE_COLOUR)
    top = height - HEAD_IN - PLANES_IN
    _draw_views(figure, brain, uniform, SHAPE_VIEWS, top)
    if brain.thickness_mm is None:
        _draw_views(figure, brain, uniform, OTHER_VIEWS, top - VIEWS_IN)
    else:
        scale = colour_scale(SHAPE_MEASURES["thickness_mm"].colours, *THICKNESS_LIMITS_MM, cut=True)
        _draw_views(figure, brain, paint(brain.thickness_mm, scale), THICKNESS_VIEWS, top - VIEWS_IN)
        bar = figure.add_axes((0.93, (foot + 0.2) / height, 0.012, (VIEWS_IN - 0.4) / height))
        figure.colorbar(scale, cax=bar).set_label("thickness (mm)", fontsize=6.5)
        if not np.isfinite(brain.thickness_mm).all():
            figure.text(0.985, (foot + 0.06) / height, "grey: not measured", fontsize=6, ha="right", va="top")
        bar.tick_params(labelsize=6)
    for letter, below in zip("abc", (HEAD_IN, HEAD_IN + PLANES_IN, HEAD_IN + PLANES_IN + VIEWS_IN), strict=True):
        place = 1 - (below + 0.02) / height
        figure.text(0.015, place, letter, ha="left", va="top", fontsize=9, fontweight="bold")
    _draw_warnings(figure, verdict, lines)
    return figure


def _draw_head(figure: Figure, title: str, verdict: Verdict, facts: Mapping[str, str]) -> None:
    height = figure.get_figheight()
    figure.text(0.015, 1 - 0.1 / height, title, ha="left", va="top", fontsize=10, fontweight="bold")
    figure.text(
        0.985, 1 - 0.1 / height, verdict.upper(), ha="right", va="top", fontsize=10, fontweight="bold", color="white",
        bbox={"boxstyle": "round,pad=0.3", "facecolor": VERDICT_COLOURS[verdict], "edgecolor": "none"},
    )  # fmt: skip
    words = wrap("   ".join(f"{name}: {value}" for name, value in facts.items()), LINE_LETTERS)
    figure.text(0.015, 1 - 0.33 / height, words, ha="left", va="top", fontsize=6.5, linespacing=1.35)


def _warning_lines(warnings: Sequence[str]) -> list[str]:
    lines = [line for text in warnings for line in wrap(f"• {text}", LINE_LETTERS).split("\n")]
    if len(lines) > MOST_LINES:
        lines = [*lines[: MOST_LINES - 1], "• … more in quality.csv"]
    return lines


def _draw_warnings(figure: Figure, verdict: Verdict, lines: Sequence[str]) -> None:
    height = figure.get_figheight()
    heading = {"fine": "No warnings.", "look": "Look at:", "refused": "Refused:"}[verdict]
    place, colour = (FOOT_IN + LINE_IN * len(lines) - 0.12) / height, VERDICT_COLOURS[verdict]
    figure.text(0.015, place, heading, fontsize=7.5, fontweight="bold", color=colour, ha="left", va="top")
    below = place - 0.16 / height
    figure.text(0.015, below, "\n".join(lines), fontsize=6.5, linespacing=1.35, ha="left", va="top")


def _draw_planes(figure: Figure, brain: Brain, *, top: float) -> None:
    height = figure.get_figheight()
    low, high = brain.pial.vertices.min(axis=0), brain.pial.vertices.max(axis=0)
    at = _places(brain, low, high)
    grids = {plane: plane_grid(plane, at[plane], low, high) for plane in PLANES}
    widths = np.array([extent[1] - extent[0] for _, extent in grids.values()])
    tallest = max(extent[3] - extent[2] for _, extent in grids.values())
    inches = min((PLANES_IN - 0.4) / tallest, (FULL_WIDTH_IN - 0.6) / widths.sum())
    left = 0.5 * (FULL_WIDTH_IN - inches * widths.sum() - 0.3)
    keys: list[Patch] = []
    for plane, (points, extent) in grids.items():
        wide, tall = inches * (extent[1] - extent[0]), inches * (extent[3] - extent[2])
        box = (left / FULL_WIDTH_IN, (top - 0.17 - tall) / height, wide / FULL_WIDTH_IN, tall / height)
        axes = figure.add_axes(box)
        keys = _draw_volumes(axes, brain.volumes, points, extent)
        if brain.white is not None:
            draw_outline(axes, brain.white, plane, at[plane], INNER_COLOUR)
        draw_outline(axes, brain.pial, plane, at[plane], PIAL_COLOUR)
        axes.set(xlim=extent[:2], ylim=extent[2:], xticks=[], yticks=[])
        axes.set_title(f"{plane}, {'xyz'[PLANES[plane][0]]} = {at[plane]:.0f} mm", fontsize=6.5, pad=2)
        for spine in axes.spines.values():
            spine.set_visible(False)
        ends = ("L", "R") if plane != "sagittal" else ("P", "A")
        colour = "white" if brain.volumes and brain.volumes[0].image is not None else "black"
        for x, end in zip((0.03, 0.97), ends, strict=True):
            axes.text(x, 0.5, end, transform=axes.transAxes, ha="center", va="center", fontsize=6.5, color=colour)
        if plane == "coronal":
            start = extent[0] + 1.0, extent[2] + 2.0
            axes.plot([start[0], start[0] + SCALE_BAR_MM], [start[1]] * 2, color=colour, linewidth=1.2)
            axes.text(start[0], start[1] + 1.0, f"{SCALE_BAR_MM:g} mm", fontsize=6, color=colour)
        left += wide + 0.15
    inner = brain.white is not None or any(volume.tissues is not None for volume in brain.volumes)
    names = [Patch(color=PIAL_COLOUR, label="pial surface")]
    names += [Patch(color=INNER_COLOUR, label="inner border of the cortex")] if inner else []
    handles = [*names, *keys]
    figure.legend(
        handles=handles, loc="upper center", ncols=len(handles), fontsize=6, frameon=False, handlelength=1.0,
        bbox_to_anchor=(0.5, (top - PLANES_IN + 0.15) / height), borderaxespad=0, columnspacing=1.2,
    )  # fmt: skip


def _places(brain: Brain, low: Floats, high: Floats) -> dict[str, float]:
    """Returns where the planes are: through the middle, the sagittal one through the middle of a hemisphere."""
    middle = (low + high) / 2
    # the larger one, of equal ones the right one
    right = high[0] - brain.fissure_x_mm > 0.8 * (brain.fissure_x_mm - low[0])
    inner = float(np.clip(brain.fissure_x_mm, low[0], high[0]))
    return {"coronal": middle[1], "axial": middle[2], "sagittal": (inner + (high[0] if right else low[0])) / 2}


def _draw_volumes(
    axes: Axes,
    volumes: Sequence[Volume],
    points: Floats,
    extent: tuple[float, float, float, float],
) -> list[Patch]:
    """Draws the image, or else the labels, and the inner border of the cortex where there are labels."""
    keys: list[Patch] = []
    image = next((volume for volume in volumes if volume.image is not None), None)
    if image is not None and image.image is not None:
        draw_image(axes, image.image, image.affine, points, extent)
    for volume in volumes:
        if volume.tissues is None:
            continue
        index = voxel_index(points, volume.affine)
        groups = map_coordinates(volume.tissues, index, order=0, mode="constant")
        if image is None:
            colours = np.ones((len(TISSUES) + 1, 3))
            for code, (name, colour) in TISSUES.items():
                colours[code] = to_rgb(colour)
                keys += [Patch(color=colour, label=name)] if (volume.tissues == code).any() else []
            axes.imshow(colours[groups], origin="lower", extent=extent, interpolation="none")
        if (volume.tissues == 1).any():
            inside = map_coordinates(np.isin(volume.tissues, (2, 3)).astype(np.float32), index, order=1)
            right, up = (np.linspace(*ends, count) for ends, count in zip(
                (extent[:2], extent[2:]), inside.shape[::-1], strict=True))  # fmt: skip
            if inside.min() < 0.5 < inside.max():
                axes.contour(right, up, inside, levels=[0.5], colors=INNER_COLOUR, linewidths=0.6)
    return keys


def _draw_views(figure: Figure, brain: Brain, colours: Floats, names: Sequence[str], top: float) -> None:
    """Draws a row of views at one scale; those of a hemisphere that is not there stay away."""
    height = figure.get_figheight()
    shown = [
        (view, *restricted(brain.pial, colours, view.hemisphere, brain.fissure_x_mm))
        for view in (VIEWS[name] for name in names)
        if hemisphere_faces(brain.pial, view.hemisphere, brain.fissure_x_mm).any()
    ]
    all_views: list[View] = [VIEWS[name] for name in (*SHAPE_VIEWS, *OTHER_VIEWS)]
    halves = np.array([half_extents(brain.pial, view) for view in all_views]).max(axis=0) * 1.04
    wide = (FULL_WIDTH_IN - 0.7) / len(names)
    inches = min(wide / 2 / halves[0], (VIEWS_IN - 0.16) / 2 / halves[1])
    for number, (view, mesh, painted) in enumerate(shown):
        picture = render(
            mesh, painted, view, half_width_mm=float(halves[0]), half_height_mm=float(halves[1]),
            pixels_per_mm=PIXELS_PER_INCH * inches,
        )  # fmt: skip
        middle, size = 0.1 + (number + 0.5) * wide, 2 * inches * halves
        box = (middle - size[0] / 2) / FULL_WIDTH_IN, (top - 0.15 - size[1]) / height
        axes = figure.add_axes((*box, size[0] / FULL_WIDTH_IN, size[1] / height))
        axes.imshow(picture)
        axes.set_axis_off()
        axes.set_title(view.name, fontsize=6.5, pad=1)
        for x, end in zip((0.05, 0.95), view.ends, strict=True):
            axes.text(x, 0.97, end, transform=axes.transAxes, ha="center", va="top", fontsize=6, color="#767676")


def quality_row(
    labels: Mapping[str, Any],
    report: Mapping[str, Any],
    thickness: Mapping[str, Any],
    warnings: Sequence[str],
    expected_ml: float,
) -> dict[str, Any]:
    """Returns the row of a brain whose surface was made; its verdict is "fine", or "look" where there are warnings.

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
        "warnings": SEPARATOR.join(warnings),
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
    """Returns the rows of all brains in an order of their ids.

    Parameters
    ----------
    rows
        What `quality_row` returns.
    refused
        labels and cause of the brains that were refused.
    """
    every = [dict(row) for row in rows] + [{**row, "verdict": "refused", "warning_count": 0} for row in refused]
    table = pd.DataFrame(every, columns=list(COLUMNS))
    rank = {name: number for number, name in enumerate(order)}
    return table.sort_values("subject", key=lambda names: names.map(rank)).reset_index(drop=True)


def facts(row: Mapping[str, Any]) -> dict[str, str]:
    """Returns what stands in the head of a brain's page, by name."""
    turned = row["rotation_deg"]
    both = " + ".join(f"{row[f'area_{side}_cm2']:.1f}" for side in str(row["sides"]).split())
    found = {
        "source": str(row["source"]),
        "hemispheres": " and ".join(str(row["sides"]).split()),
        "area": f"{row['area_cm2']:.1f} cm² ({both})",
        "volume": f"{row['volume_ml']:.1f} mL ({100 * row['share_of_expected_volume']:.0f} % of that expected)",
        "pose": f"by {row['pose_by']}, turned by {turned:.1f}°" if turned >= 0.05 else "as in the file",
    }
    if _known(row["asymmetry_mm"]):
        found["asymmetry"] = f"{row['asymmetry_mm']:.1f} mm"
    if _known(row["mean_thickness_mm"]):
        share = 100 * row["thickness_measured_share"]
        found["thickness"] = f"{row['mean_thickness_mm']:.2f} mm (measured on {share:.0f} %)"
    return found


def _known(value: object) -> bool:
    return isinstance(value, int | float) and bool(np.isfinite(value))
