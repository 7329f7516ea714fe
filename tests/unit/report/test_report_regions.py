"""The picture and the chart of regions, and their table."""

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
import trimesh

from gyriflow.errors import InputError
from gyriflow.geometry.triangles import TriangleMesh
from gyriflow.report.regions import region_colours, regions_chart, regions_picture
from gyriflow.report.style import NEUTRAL_COLOUR, RUN_COLOURS
from gyriflow.report.tables import region_table

COLUMNS = ["subject", "run", "week", "hemisphere", "region", "metric", "value", "unit"]
REGIONS = pd.DataFrame(
    [
        (subject, run, week, side, region, metric, factor * size + (1.0 if side == "left" else 0.0), unit)
        for subject, run, week, size in (("a", "real", 21.0, 10.0), ("b", "real", 22.0, 12.0), ("a", "r", 22.0, 11.0))
        for side in ("left", "right")
        for region, factor in (("front", 1), ("back", 2))
        for metric, unit in (("area", "cm2"), ("mean_sulcal_depth", "mm"))
    ],
    columns=COLUMNS,
)
ASYMMETRY = pd.DataFrame(
    [("a", "real", 21.0, "area", region, 0.1) for region in ("front", "back")] + [("a", "real", 21.0, "area", "", 0.5)],
    columns=["subject", "run", "week", "metric", "region", "asymmetry_index"],
)


def test_regions_are_seen_in_their_colours_where_they_are():
    ball = trimesh.creation.icosphere(subdivisions=4, radius=20.0)
    mesh = TriangleMesh(ball.vertices, ball.faces)
    y, z = mesh.vertices[:, 1], mesh.vertices[:, 2]
    regions = np.where(z < -12, 0, np.where(y > 0, 1, 2))
    figure = regions_picture({"p": (mesh, regions)}, {1: "front", 2: "back"}, views=("left",))
    (image,) = [axes.images[0].get_array() for axes in figure.axes if axes.images]
    height, width = image.shape[:2]

    def hue(row: float, column: float) -> str:
        """Returns whose hue a place of the picture is nearest to."""
        pixel = image[int(row * height), int(column * width)] / 255.0
        palette = {"front": RUN_COLOURS[0], "back": RUN_COLOURS[1], "none": NEUTRAL_COLOUR}
        shades = {name: np.array(mpl.colors.to_rgb(colour)) for name, colour in palette.items()}
        return min(shades, key=lambda name: np.linalg.norm(shades[name] / shades[name].sum() - pixel / pixel.sum()))

    # seen from the left, anterior is on the left of the picture
    assert (hue(0.45, 0.3), hue(0.45, 0.7), hue(0.92, 0.5)) == ("front", "back", "none")
    assert [text.get_text() for text in figure.legends[0].texts] == ["front", "back", "no region"]


def test_a_legend_of_many_regions_does_not_lie_over_the_brains():
    ball = trimesh.creation.icosphere(subdivisions=2, radius=20.0)
    mesh = TriangleMesh(ball.vertices, ball.faces)
    names = {number: f"region {number}" for number in range(1, 25)}
    regions = np.arange(len(mesh.vertices)) % 25
    figure = regions_picture({"p": (mesh, regions)}, names, views=("left",))
    figure.canvas.draw()
    top = figure.legends[0].get_window_extent().y1
    assert top <= min(axes.get_window_extent().y0 for axes in figure.axes if axes.images)


def test_many_regions_have_colours_of_their_own_and_none_is_darker_than_those_of_runs():
    colours = region_colours([f"region {number}" for number in range(21)])
    assert len({tuple(np.round(colour, 3)) for colour in colours.values()}) == 21
    brightness = [max(colour) for colour in colours.values()]
    assert min(brightness) >= min(max(mpl.colors.to_rgb(colour)) for colour in RUN_COLOURS)


def test_without_a_brain_there_is_no_picture():
    with pytest.raises(InputError, match="no brain with regions"):
        regions_picture({}, {1: "front"})


def test_chart_sums_areas_and_averages_depths():
    figure = regions_chart(REGIONS, ASYMMETRY)
    area, depth, asymmetry = figure.axes[:3]
    assert "area" in area.get_title()
    assert "(mm)" in depth.get_title()

    def points(axes, colour, marker):
        return [
            (float(x), float(y))
            for line in axes.lines
            if line.get_marker() == marker and mpl.colors.same_color(line.get_color(), colour)
            for x, y in zip(line.get_xdata(), line.get_ydata(), strict=True)
        ]

    assert points(area, RUN_COLOURS[0], "*") == [(21, 21), (22, 25)]
    assert points(depth, RUN_COLOURS[1], "*") == [(21, 20.5), (22, 24.5)]
    assert points(depth, RUN_COLOURS[1], "None") == [(22, 22.5)]
    # that of the hemispheres is no region
    assert points(asymmetry, RUN_COLOURS[0], "*") == [(21, 0.1)]


def test_table_has_left_right_and_asymmetry():
    table = region_table(REGIONS, ASYMMETRY)
    row = table.loc[("a", "real", 21.0, "front")]
    assert (row["area (cm²), left"], row["area (cm²), right"], row["area, asymmetry"]) == (11.0, 10.0, 0.1)
    assert len(table) == 6
