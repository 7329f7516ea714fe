"""Quality control before the solve: a page and a verdict for each brain."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
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
from ..quantities import VERTEX_MAPS
from ..settings.schemes import LabelScheme
from .scene import (
    VIEWS,
    colour_scale,
    half_extents,
    paint,
    render,
    restricted,
    uniform_colours,
)
from .sections import PLANES, SCALE_BAR_MM, draw_outline
from .style import FULL_WIDTH_IN, MUTED_COLOUR, OBSERVED_SURFACE_COLOUR, styled, wrap

VERDICT_HEADINGS = {
    "fine": ("No warnings.", "#009E73"),
    "needs review": ("Warnings:", "#E69F00"),
}
"""Heading above the warnings of a page, and colour of the verdict."""
TISSUE_GROUPS = {
    1: "cortex",
    2: "inside the cortex",
    3: "ventricles",
    4: "other labels",
}
"""Groups of labels that share a colour, shown if there is no image."""
TISSUE_COLOURS = ("#FFFFFF", "#B7A58B", "#E9E4DA", "#9CC3E0", "#E6E6E6")
PIAL_COLOUR, INNER_COLOUR = "#D55E00", "#0072B2"
# the same for all brains, so that their pages can be compared
THICKNESS_LIMITS_MM = (0.0, 4.0)
SHAPE_VIEWS = ("left", "right", "top", "bottom")
THICKNESS_VIEWS = ("left", "right", "left medial", "right medial")
OTHER_VIEWS = ("front", "back", "left medial", "right medial")
# letters of a line, and of one beside the verdict
LINE_LETTERS, FACT_LETTERS = 138, 112
# in inches
ROWS_IN, HEAD_IN, LINE_IN = (2.4, 1.42, 1.42), 0.9, 0.13
PIXELS_PER_INCH = 200
MARGIN_MM, PIXEL_MM = 8.0, 0.25
"""Margin around the surface and pixel size of the planes."""
# quantile of the positive grey values that is shown as white
_BRIGHTEST = 0.995


@dataclass(frozen=True, eq=False)
class QualityBrain:
    """The surfaces, thickness and volumes on a brain's page.

    `pial` is the whole surface in RAS+ mm, `white` the white one in the same
    coordinates, `fissure_x_mm` the plane that separates the hemispheres in medial
    views, and `thickness_mm` (n,) at the vertices of the surface, NaN where not
    measured. `image` and `tissues` are the (i, j, k) grey values and groups of labels
    (`TISSUE_GROUPS`), each with the (4, 4) affine from voxel index to the surface's
    coordinates.
    """

    pial: TriangleMesh
    fissure_x_mm: float
    thickness_mm: Floats | None = None
    white: TriangleMesh | None = None
    image: tuple[Floats, Floats] | None = None
    tissues: tuple[NDArray[np.integer], Floats] | None = None


def tissue_groups(
    labels: NDArray[np.integer], scheme: LabelScheme
) -> NDArray[np.uint8]:
    """Return the (i, j, k) group of each voxel as in `TISSUE_GROUPS`; 0 is
    background."""
    groups = np.where(
        labels > 0,
        4,
        0,
    ).astype(np.uint8)
    groups[np.isin(labels, scheme.cerebrum)] = 2
    groups[np.isin(labels, scheme.cortex)] = 1
    groups[np.isin(labels, scheme.ventricles)] = 3
    return groups


@styled
def quality_page(
    brain: QualityBrain,
    row: Mapping[str, Any],
    warnings: Sequence[str],
    notes: Sequence[str] = (),
) -> Figure:
    """Draw the page of a brain: three planes, the surface in four views, thickness in
    four views, its warnings and notes, which need no review.

    The outlines are drawn on the image, or on the labels if there is no image. The page
    ends below its last line. `row` is the output of `quality_row`.
    """
    lines = []
    for text in warnings:
        lines += wrap(f"• {text}", LINE_LETTERS).split("\n")
    for text in notes:
        lines += wrap(f"Note: {text}", LINE_LETTERS).split("\n")
    height_in = HEAD_IN + sum(ROWS_IN) + LINE_IN * len(lines)
    figure = Figure(figsize=(FULL_WIDTH_IN, height_in), layout="constrained")
    heading, colour = VERDICT_HEADINGS[row["verdict"]]
    left: dict[str, Any] = {
        "x": 0.015,
        "ha": "left",
        "fontsize": 6.5,
    }
    bold: dict[str, Any] = {"fontsize": 10, "fontweight": "bold"}
    # lines break between facts only
    facts = [
        f"{name}: {value}".replace(" ", "\N{NO-BREAK SPACE}")
        for name, value in _facts(row).items()
    ]
    words = wrap("   ".join(facts), FACT_LETTERS)
    figure.suptitle(
        f"{row['subject']}, {row['week']:g} GW",
        **left | bold,
    )
    figure.text(
        0.985,
        0.985,
        row["verdict"].upper(),
        color="white",
        bbox={"boxstyle": "round,pad=0.3", "facecolor": colour, "edgecolor": "none"},
        ha="right",
        va="top",
        **bold,
    )
    figure.supxlabel(
        "\n".join([heading, *lines]),
        **left,
    )
    rows: Any = figure.subfigures(3, 1, height_ratios=ROWS_IN)
    planes, views, thickness = rows
    planes.suptitle(words, **left)
    _draw_planes(planes, brain)
    uniform = uniform_colours(brain.pial, OBSERVED_SURFACE_COLOUR)
    _draw_views(views, brain, uniform, SHAPE_VIEWS)
    if brain.thickness_mm is None:
        _draw_views(thickness, brain, uniform, OTHER_VIEWS)
    else:
        colours = VERTEX_MAPS["thickness_mm"].colours
        scale = colour_scale(colours, *THICKNESS_LIMITS_MM, cut=True)
        painted = paint(brain.thickness_mm, scale)
        panels = _draw_views(thickness, brain, painted, THICKNESS_VIEWS)
        label = "thickness (mm)"
        if not np.isfinite(brain.thickness_mm).all():
            label += "\ngrey: not measured"
        thickness.colorbar(scale, ax=panels).set_label(label, fontsize=6.5)
    for letter, part in zip("abc", rows, strict=True):
        height = 0.82 if part is planes else 1.0
        part.text(
            0.015,
            height,
            letter,
            va="top",
            **bold | {"fontsize": 9},
        )
    return figure


def _draw_planes(figure: SubFigure, brain: QualityBrain) -> None:
    """Draw three planes through the middle, the sagittal one through the middle of a
    hemisphere."""
    low, high = brain.pial.vertices.min(axis=0), brain.pial.vertices.max(axis=0)
    middle = (low + high) / 2
    fissure = float(
        np.clip(
            brain.fissure_x_mm,
            low[0],
            high[0],
        )
    )
    # the larger hemisphere, of equal ones the right one
    outer = high[0] if high[0] - fissure > 0.8 * (fissure - low[0]) else low[0]
    at = {
        "coronal": middle[1],
        "axial": middle[2],
        "sagittal": (fissure + outer) / 2,
    }
    # pixel coordinates by axis, and the edges of the pictures
    dots = [
        np.arange(begin - MARGIN_MM, end + MARGIN_MM, PIXEL_MM)
        for begin, end in zip(low, high, strict=True)
    ]
    ends = [(dots_of_axis[0], dots_of_axis[-1] + PIXEL_MM) for dots_of_axis in dots]
    tallest = max(np.ptp(ends[up]) for *_, up in PLANES.values())
    colour = "black" if brain.image is None else "white"
    panels = figure.subplots(
        1, 3, width_ratios=[np.ptp(ends[right]) for _, right, _ in PLANES.values()]
    )
    for axes, (plane, (normal, right, up)) in zip(
        panels,
        PLANES.items(),
        strict=True,
    ):
        points = np.empty(
            (
                len(dots[up]),
                len(dots[right]),
                3,
            )
        )
        points[..., normal] = at[plane]
        points[..., right] = dots[right]
        points[..., up] = dots[up][:, None]
        edges = (ends[right], ends[up])
        _draw_volumes(axes, brain, points, edges)
        if brain.white is not None:
            draw_outline(axes, brain.white, plane, at[plane], INNER_COLOUR)
        draw_outline(axes, brain.pial, plane, at[plane], PIAL_COLOUR)
        # all at one scale
        heights = sum(ends[up]) / 2 + np.array([-0.5, 0.5]) * tallest
        axes.set(
            xlim=ends[right],
            ylim=heights,
            aspect="equal",
        )
        axes.set_axis_off()
        # its ticks would be measured to place the title
        axes.yaxis.set_visible(False)
        title = f"{plane}, {'xyz'[normal]} = {at[plane]:.0f} mm"
        axes.set_title(title, fontsize=6.5, pad=2)
        names = "PA" if plane == "sagittal" else "LR"
        style = {"va": "center", "fontsize": 6.5, "color": colour}
        _write_ends(axes, names, 0.03, 0.5, **style)
    coronal, left, bottom = panels[0], ends[0][0] + 1, ends[2][0] + 2
    bar = [left, left + SCALE_BAR_MM]
    coronal.plot(
        bar,
        [bottom] * 2,
        color=colour,
        linewidth=1.2,
    )
    label = f"{SCALE_BAR_MM:g} mm"
    coronal.text(
        left,
        bottom + 1,
        label,
        fontsize=6,
        color=colour,
    )
    keys = [Patch(color=PIAL_COLOUR, label="pial surface")]
    if brain.white is not None or brain.tissues:
        keys.append(Patch(color=INNER_COLOUR, label="inner border of the cortex"))
    if brain.tissues and not brain.image:
        for code, name in TISSUE_GROUPS.items():
            if (brain.tissues[0] == code).any():
                keys.append(Patch(color=TISSUE_COLOURS[code], label=name))
    figure.legend(
        handles=keys,
        loc="outside lower center",
        ncols=len(keys),
        fontsize=6,
        handlelength=1.0,
    )


def _draw_volumes(
    axes: Axes,
    brain: QualityBrain,
    points: Floats,
    edges: tuple[tuple[float, float], tuple[float, float]],
) -> None:
    """Draw the image, or else the labels, at the points (h, w, 3) of a plane, and the
    inner border of cortex labels."""
    (left, right), (bottom, top) = edges
    style: dict[str, Any] = {
        "origin": "lower",
        "extent": (left, right, bottom, top),
        "interpolation": "none",
    }
    if brain.image:
        values, affine = brain.image
        lit = values[np.isfinite(values) & (values > 0)]
        brightest = float(np.quantile(lit, _BRIGHTEST)) if lit.size else 1.0
        index = voxel_index(points, affine)
        grey = map_coordinates(np.nan_to_num(values), index, order=1)
        axes.imshow(
            grey,
            cmap="gray",
            vmin=0,
            vmax=brightest,
            **style,
        )
    if not brain.tissues:
        return
    groups, affine = brain.tissues
    index = voxel_index(points, affine)
    if not brain.image:
        tissues = map_coordinates(groups, index, order=0, mode="constant")
        colours = ListedColormap(TISSUE_COLOURS)
        axes.imshow(
            tissues,
            cmap=colours,
            vmin=-0.5,
            vmax=4.5,
            **style,
        )
    is_inside = np.isin(
        groups,
        (2, 3),
    ).astype(np.float32)
    inside = map_coordinates(is_inside, index, order=1)
    if (groups == 1).any() and inside.min() < 0.5 < inside.max():
        height, width = inside.shape
        across = np.linspace(left, right, width)
        upward = np.linspace(bottom, top, height)
        style = {"colors": INNER_COLOUR, "linewidths": 0.6}
        axes.contour(
            across,
            upward,
            inside,
            levels=[0.5],
            **style,
        )


def _draw_views(
    figure: SubFigure,
    brain: QualityBrain,
    colours: Floats,
    names: Sequence[str],
) -> list[Axes]:
    """Draw a row of views at one scale, without views of a missing hemisphere."""
    every = [
        half_extents(
            brain.pial,
            VIEWS[name],
        )
        for name in (*SHAPE_VIEWS, *OTHER_VIEWS)
    ]
    wide, tall = 1.04 * np.max(every, axis=0)
    panels = list(figure.subplots(1, len(names)))
    pixels_per_mm = PIXELS_PER_INCH * (FULL_WIDTH_IN - 0.7) / len(names) / (2 * wide)
    for axes, name in zip(panels, names, strict=True):
        view = VIEWS[name]
        axes.set_axis_off()
        # its ticks would be measured to place the title
        axes.yaxis.set_visible(False)
        mesh, painted = restricted(
            brain.pial, colours, view.hemisphere, brain.fissure_x_mm
        )
        if not len(mesh.faces):
            continue
        axes.imshow(
            render(
                mesh,
                painted,
                view,
                (wide, tall),
                pixels_per_mm,
            )
        )
        axes.set_title(name, fontsize=6.5, pad=1)
        style = {"va": "top", "fontsize": 6, "color": MUTED_COLOUR}
        _write_ends(axes, view.ends, 0.05, 0.97, **style)
    return panels


def _write_ends(
    axes: Axes,
    ends: Sequence[str],
    margin: float,
    height: float,
    **style: Any,
) -> None:
    """Name the left and the right end of a panel, at a fraction of its width from its
    sides and of its height."""
    style |= {"transform": axes.transAxes, "ha": "center"}
    left, right = ends
    axes.text(margin, height, left, **style)
    axes.text(1 - margin, height, right, **style)


def _facts(row: Mapping[str, Any]) -> dict[str, str]:
    """Return the facts at the top of a brain's page, by name."""
    sides = str(row["sides"]).split()
    both = " + ".join(f"{row[f'area_{side}_cm2']:.1f}" for side in sides)
    turned, thickness = row["rotation_deg"], row["mean_thickness_mm"]
    facts = {
        "source": str(row["source"]),
        "hemispheres": " and ".join(sides),
        "area": f"{row['area_cm2']:.1f} cm² ({both})",
        "volume, with ventricles": f"{row['volume_ml']:.1f} mL",
        "pose": (
            f"by {row['pose_by']}, turned by {turned:.1f}°"
            if turned >= 0.05
            else "as in the file"
        ),
    }
    if row["asymmetry_mm"] is not None:
        facts["distance from its mirror image"] = f"{row['asymmetry_mm']:.1f} mm"
    if row["cut_share"] is not None:
        usual = f"usually at most {100 * row['usual_cut_share']:.0f} %"
        facts["cut at the midline"] = (
            f"{100 * row['cut_share']:.0f} % of the medial wall ({usual})"
        )
    if thickness is not None:
        doubt = "inaccurate, " if row["thickness_is_inaccurate"] else ""
        facts["thickness"] = (
            f"{thickness:.2f} mm ({doubt}measured on"
            f" {100 * row['thickness_measured_share']:.0f} %)"
        )
    return facts


def quality_row(
    labels: Mapping[str, Any],
    report: Mapping[str, Any],
    thickness: Mapping[str, Any],
    warnings: Sequence[str],
    expected_ml: float,
    *,
    thickness_is_inaccurate: bool = False,
    area_is_lower_bound: bool = False,
) -> dict[str, Any]:
    """Return the row of a brain with a surface; its verdict is "needs review" if there
    are warnings, else "fine".

    `labels` are subject, week, population, source, sides and page; `report` and
    `thickness` the contents of `surface.json` and `thickness.json`. `expected_ml` is
    the approximate volume of a cerebrum of the week; half of it is expected of a single
    hemisphere. The last two are those of `anatomy.plausible.is_inaccurate` and
    `hides_area`.
    """
    area, sides = report["area_cm2"], str(labels["sides"]).split()
    pose = pose_from(report["pose"])
    return {
        **labels,
        "verdict": "needs review" if warnings else "fine",
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
        "thickness_is_inaccurate": thickness_is_inaccurate,
        "area_is_lower_bound": area_is_lower_bound,
        "pose_by": pose.by,
        "rotation_deg": angle_deg(pose.of_file()[:3, :3]),
        "asymmetry_mm": report.get("asymmetry_mm"),
        "cut_share": report.get("cut_share"),
        "usual_cut_share": report.get("usual_cut_share"),
    }
