"""Pictures show the right side, at one scale, in the colours of their values."""

import numpy as np
import pytest
from facts import Facts
from matplotlib.text import Text
from pictures import colour_bar, covered, picture, pictures, tone, words
from shapes import box, ellipsoid, ellipsoid_mesh, sphere

from gyriflow.folding.growth import GrowthByRates, StepStart, model_fields
from gyriflow.folding.zones import zones_of_run
from gyriflow.geometry.triangles import TriangleMesh, merged
from gyriflow.quantities import name_in_interval
from gyriflow.report.panels import LINES_MM, direction_lines
from gyriflow.report.pictures import (
    GridBrain,
    brain_depth,
    brain_grid,
    brain_maps,
    displacement_maps,
    expected_figure,
    growth_grid,
    in_views,
    influence_figure,
    predicted_figure,
    region_grid,
    scale_of,
    shape_maps,
    weekly_figure,
    zones_figure,
)
from gyriflow.report.scene import VIEWS, render, uniform_colours
from gyriflow.report.sections import model_figure, outlines_figure
from gyriflow.settings.folding import parameters_from

BRAIN = box((20, 30, 20))
SMOOTH = ellipsoid((20.0, 26.0, 18.0))


def plain(row, column, mesh, *, simulated=False):
    """Return a brain of one colour."""
    return GridBrain(row, column, [(mesh, {})], simulated)


def seen(mesh, colours, view, mm=20, **look):
    return render(mesh, colours, VIEWS[view], (mm, mm), 4, **look).astype(float)


@pytest.mark.parametrize("name", ["left", "right", "top", "bottom", "front", "back"])
def test_the_ends_of_a_view_are_where_its_letters_say(name):
    mesh = merged(
        *(
            box((4, 4, 4), place)
            for place in [(-15, 0, 0), (15, 0, 0), (0, 15, 0), (0, -15, 0), (0, 0, 0)]
        )
    )
    palette = {"L": (1, 0, 0), "R": (0, 1, 0), "A": (0, 0, 1), "P": (1, 1, 0)}
    image = seen(
        mesh,
        np.repeat([*palette.values(), (0.5, 0.5, 0.5)], 12, axis=0).astype(float),
        name,
    )
    found = []
    for part in (image[:, :40], image[:, -40:]):
        hue = part[covered(part)].mean(axis=0)
        found.append(
            max(
                palette,
                key=lambda key: (
                    hue @ np.array(palette[key]) / np.linalg.norm(palette[key])
                ),
            )
        )
    assert tuple(found) == VIEWS[name].ends


def test_up_is_superior_and_in_the_top_view_anterior():
    mesh = merged(
        box((20, 20, 20)), box((5, 5, 5), (0, 0, 20)), box((5, 5, 5), (0, 20, 0))
    )
    for name in ("left", "top"):
        width = covered(seen(mesh, uniform_colours(mesh, "#ff0000"), name)).sum(axis=1)
        assert 0 < width[:30].max() < width[-30:].max()


def test_a_predicted_brain_alone_is_blue_between_start_and_atlas():
    figure = predicted_figure(
        [
            plain("", "start", BRAIN),
            plain("", "then", box((24, 34, 24)), simulated=True),
            plain("", "atlas", BRAIN),
        ]
    )
    tones = [tone(picture(figure, number)) for number in range(9)]
    assert [blue > red for red, _, blue in tones] == 3 * [False, True, False]


def test_weeks_that_stand_below_others_have_no_row_of_a_brain_that_ends_before():
    long = [
        plain("long", week, BRAIN, simulated=True) for week in np.arange(21.0, 31.0)
    ]
    figure = brain_grid(
        in_views([*long, plain("observed brain", 21.0, BRAIN)], ("left",))
    )
    written = [text.get_text() for text in figure.findobj(Text)]
    assert [
        sum(name in text for text in written) for name in ("long", "observed brain")
    ] == [2, 1]


def test_runs_by_week_have_a_panel_per_brain_and_leave_gaps_and_one_scale():
    small, large = BRAIN, box((60, 80, 60))
    # weeks are sorted
    figure = weekly_figure(
        [
            plain("simulated", 23.5, large, simulated=True),
            plain("simulated", 22.0, small, simulated=True),
            plain("observed brain", 22.0, small),
        ]
    )
    panels = [axes.get_label() for axes in pictures(figure)]
    assert len(panels) == 6
    assert "observed brain, column 0" in panels
    assert "observed brain, column 1" not in panels
    assert {
        "22 GW\nleft view",
        "23.5 GW\ntop view",
        "a",
        "b",
        "simulated",
        "A",
        "P",
        "L",
        "R",
    } <= words(figure)
    assert covered(picture(figure, 0)).sum() < covered(picture(figure, 1)).sum()
    scales = [
        np.ptp(axes.get_xlim()) / axes.get_window_extent().width
        for axes in pictures(figure)
    ]
    scales += [
        np.ptp(axes.get_ylim()) / axes.get_window_extent().height
        for axes in pictures(figure)
    ]
    assert scales == pytest.approx([scales[0]] * len(scales))
    (bar,) = [axes for axes in figure.axes if axes.get_label() == "scale bar"]
    length = np.ptp(bar.get_xlim())
    assert f"{length:g} mm" in words(figure)
    assert length / bar.get_window_extent().width == pytest.approx(scales[0])


def test_displacement_maps_share_their_colour_scale():
    before = {
        norm: TriangleMesh(BRAIN.vertices - [0.0, 0, norm], BRAIN.faces)
        for norm in (1, 4)
    }
    frames = [
        {21.0: (before[1], {}), 22.0: (BRAIN, {})},
        {22.0: (before[4], {}), 23.0: (BRAIN, {})},
    ]
    figure = displacement_maps(frames, runs=["slow", "fast"])
    bar = colour_bar(figure, "displacement")
    assert bar.get_xlim() == pytest.approx((0.0, 4.0))
    assert "(mm)" in bar.get_xlabel()
    assert {"21–22 GW\nleft view", "22–23 GW\nleft view", "slow", "fast"} <= words(
        figure
    )
    assert all(
        Facts(f"{norm}.00 mm", "−10, −15, −10") in list(words(figure))
        for norm in (1, 4)
    )
    first, second = map(tone, (picture(figure, 0), picture(figure, 2)))
    # pale at a quarter of the scale, dark blue at its end
    assert first.sum() > 1.5 * second.sum()
    assert second[2] > 1.5 * second[0]


def test_one_sharp_vertex_does_not_set_the_scale_of_a_displacement_and_is_ringed():
    moves = np.tile([0.0, 0, 1], (len(SMOOTH.vertices), 1))
    # on the right, not seen from the left
    top = int((SMOOTH.vertices @ [0.3, 0, 1]).argmax())
    moves[top] *= 50
    before = TriangleMesh(SMOOTH.vertices - moves, SMOOTH.faces)
    figure = displacement_maps([{21.0: (before, {}), 22.0: (SMOOTH, {})}], runs=["run"])
    bar = colour_bar(figure, "displacement")
    assert bar.get_xlim()[1] == pytest.approx(1.0)
    rings = [
        ring
        for axes in pictures(figure)
        for ring in axes.patches
        if ring.get_edgecolor()[:3] == (0, 0, 0)
    ]
    assert [ring.get_linestyle() for ring in rings] == [":", "-"]
    middle = (SMOOTH.vertices.min(axis=0) + SMOOTH.vertices.max(axis=0)) / 2
    assert rings[1].center == pytest.approx((SMOOTH.vertices[top] - middle)[:2])


def test_shape_index_goes_from_minus_one_to_one_and_gyri_are_red():
    values = {"simulated": 0.7, "observed brain": -0.7}
    grid = [
        GridBrain(row, 28.0, [(BRAIN, {"shape_index": np.full(8, value)})])
        for row, value in values.items()
    ]
    figure = brain_grid(in_views(grid, ("left",)), "shape_index")
    bar = colour_bar(figure, "shape index")
    assert bar.get_xlim() == (-1.0, 1.0)
    gyri, sulci = map(tone, (picture(figure, 0), picture(figure, 1)))
    assert gyri[0] > gyri[2]
    assert sulci[2] > sulci[0]


def test_zones_have_their_areas_and_the_medial_view_shows_one_hemisphere():
    brain = merged(box((10, 30, 20), (-6, 0, 0)), box((10, 30, 20), (6, 0, 0)))
    zones = np.repeat([1, 3], 12)
    run = {
        "start_week": 21,
        "end_week": 22,
        "output_weeks": [21, 22],
        "fissure_x_mm": 0.0,
    }
    figure = zones_figure((brain, {"zone": zones}), parameters_from(run))
    # a box of 10 × 30 × 20 mm has 22 cm²
    assert {"clamped 22.0 cm²", "right contact 22.0 cm²"} <= words(figure)
    assert not any("free" in text for text in words(figure))
    left, right = map(tone, (picture(figure, 2), picture(figure, 3)))
    assert left[1] > left[0]
    assert right[0] > 2 * right[2]


def test_lines_on_a_map_run_along_directions_where_these_are_seen():
    right = np.tile([0.0, 0.5, 0.0], (len(SMOOTH.vertices), 1)) * (
        SMOOTH.vertices[:, :1] > 0
    )
    ends = direction_lines(SMOOTH, right, VIEWS["right"])
    assert np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) == pytest.approx(
        0.5 * LINES_MM
    )
    longest = direction_lines(SMOOTH, 5 * right, VIEWS["right"])
    assert np.linalg.norm(longest[:, 1] - longest[:, 0], axis=1) == pytest.approx(
        LINES_MM
    )
    # one in each cube
    assert len(np.unique(np.floor(ends.mean(axis=1) / LINES_MM), axis=0)) > 0.6 * len(
        ends
    )
    growth = {
        name_in_interval(f"growth_direction_{axis}", 21.0, 22.0): right[:, number]
        for number, axis in enumerate("xyz")
    }
    name = "area_growth_percent_per_gw"
    growth[name_in_interval(name, 21.0, 22.0)] = np.full(len(right), 0.1)
    frames = {21.0: (SMOOTH, {}), 22.0: (SMOOTH, {})}
    figure = growth_grid(frames, growth, name, views=("right", "left"))
    dark = [(picture(figure, number) < 60).all(axis=-1).sum() for number in (0, 1)]
    assert dark[0] > 1000
    assert dark[1] == 0


def test_a_map_that_one_hemisphere_lacks_is_grey_there():
    halves = [
        (box((8, 30, 20), (x, 0, 0)), maps)
        for x, maps in ((-6, {"shape_index": np.ones(8)}), (6, {}))
    ]
    figure = shape_maps([GridBrain("simulated", 21.0, halves)])
    assert {"simulated", "not measured"} <= words(figure)
    # from above
    image = picture(figure, 1).astype(float)
    left = tone(image[:, : image.shape[1] // 2])
    right = tone(image[:, image.shape[1] // 2 :])
    assert np.ptp(right) < 3 < np.ptp(left)


def test_growth_of_an_interval_is_on_the_surface_at_its_end():
    frames = {
        week: (box((20, 30, height)), {})
        for week, height in ((21.0, 20), (22.5, 24), (25.0, 30))
    }
    values = {(21.0, 22.5): 2.0, (22.5, 25.0): 8.0}
    names = {"area_growth_percent_per_gw": 1.0, "thickness_growth_percent_per_gw": -0.5}
    maps = {
        name_in_interval(name, *ends): np.full(8, factor * value)
        for name, factor in names.items()
        for ends, value in values.items()
    }
    area, across_surface = names
    figure = growth_grid(frames, maps, area, views=("left",))
    assert {"21–22.5 GW\nleft view", "22.5–25 GW\nleft view"} <= words(figure)
    assert colour_bar(figure, "growth of area").get_xlim() == pytest.approx((0.0, 8.0))
    first, second = picture(figure, 0), picture(figure, 1)
    assert covered(second).any(axis=1).sum() / covered(first).any(
        axis=1
    ).sum() == pytest.approx(30 / 24, rel=0.02)
    assert tone(first).sum() > 1.3 * tone(second).sum()
    across = growth_grid(frames, maps, across_surface, views=("left",))
    assert colour_bar(across, "across").get_xlim() == pytest.approx((-4.0, 4.0))


def test_an_observed_surface_outside_of_the_expected_one_is_red_and_inside_blue():
    distance = np.where(BRAIN.vertices[:, 1] > 0, 3.0, -1.5)
    figure = expected_figure(
        [
            plain("expected", 22.0, BRAIN, simulated=True),
            plain("expected", 26.0, BRAIN, simulated=True),
            plain("observed brain", 26.0, BRAIN),
            GridBrain("distance", 26.0, [(BRAIN, {"distance_mm": distance})]),
        ]
    )
    # rows: the run in two weeks from two sides, the observed brain, the distance
    image = picture(figure, 7).astype(float)
    front = tone(image[: image.shape[0] // 3])
    back = tone(image[-image.shape[0] // 3 :])
    assert front[0] > front[2] + 30
    assert back[2] > back[0] + 10
    assert colour_bar(figure, "distance").get_xlim() == pytest.approx((-3.0, 3.0))


def test_runs_of_a_sweep_stand_in_their_order_with_the_observed_brain_last():
    halves = {
        name: [(box((20, 30, tall)), {"shape_index": np.full(8, value)})]
        for name, tall, value in (
            ("thin", 20, -0.9),
            ("thick", 28, 0.9),
            ("observed", 24, 0.1),
        )
    }
    grid = [
        GridBrain("", "a", halves["thick"], is_simulated=True),
        GridBrain("", "b", is_simulated=True),
        GridBrain("", "c", halves["thin"], is_simulated=True),
        GridBrain("", "seen", halves["observed"]),
    ]
    values = {
        run: {"thickness_mm": size}
        for run, size in (("a", 2.5), ("b", 2.0), ("c", 1.5))
    }
    figure = influence_figure(grid, values=values)
    assert {"2.5 mm", "2 mm", "1.5 mm", "seen", "ended\nbefore\nthis week"} <= words(
        figure
    )
    # in each row three pictures: surfaces from the left and from above, then their
    # shape index
    tall = [covered(picture(figure, number)).any(axis=1).sum() for number in range(3)]
    assert np.array(tall) / tall[2] == pytest.approx([28 / 24, 20 / 24, 1.0], rel=0.03)
    red, _, blue = np.transpose(
        [tone(picture(figure, number)) for number in (0, 1, 2, 6, 7)]
    )
    assert (red > blue).tolist() == [False, False, True, True, False]


@pytest.mark.parametrize("quantity", ["curvedness", "sulcal_depth_mm"])
def test_scales_go_from_zero_to_where_few_vertices_are_above(quantity):
    values = np.array([0.1] * 399 + [9.0])
    assert scale_of(quantity, values).get_clim() == (0.0, pytest.approx(0.1))


def test_regions_are_seen_in_their_colours_where_they_are():
    mesh = sphere(20.0)
    y, z = mesh.vertices[:, 1], mesh.vertices[:, 2]
    regions = np.where(z < -12, 0, np.where(y > 0, 1, 2))
    figure = region_grid(
        [GridBrain("", "p", [(mesh, (regions, {1: "front", 2: "back"}))])]
    )
    hues = {
        patch.get_label(): np.array(patch.get_facecolor()[:3])
        for patch in figure.legends[0].legend_handles
    }
    image = picture(figure) / 255.0
    # seen from the left, anterior is on the left of the picture
    for row, column, name in (
        (0.45, 0.3, "front"),
        (0.45, 0.7, "back"),
        (0.92, 0.5, "no region"),
    ):
        pixel = image[int(row * image.shape[0]), int(column * image.shape[1])]
        away = {
            key: np.linalg.norm(hue / hue.sum() - pixel / pixel.sum())
            for key, hue in hues.items()
        }
        assert min(away, key=away.__getitem__) == name


def test_the_models_fields_are_drawn_in_the_elements_at_the_start_and_at_the_end():
    mesh = ellipsoid_mesh(8, (20.0, 26.0, 18.0))
    run = {
        "start_week": 21,
        "end_week": 22,
        "output_weeks": [21, 22],
        "fissure_x_mm": 0.0,
        "step_s": 1e5,
    }
    p = parameters_from(run | {"thickness_mm": 4.0})
    zones, sizes = zones_of_run(mesh, p), {21.0: 1.0, 22.0: 1.2}
    growth = GrowthByRates(p, StepStart(mesh.vertices, 0.0, p.step_s))
    weeks = {
        week: model_fields(growth, zones, size * mesh.vertices, week)
        for week, size in sizes.items()
    }
    figure = model_figure((mesh.tets, weeks))
    assert {"cortical weight", "growth zone", "normals", "21 GW", "22 GW"} <= words(
        figure
    )
    weight, zone, increment, normals = (axes.collections[0] for axes in figure.axes[:4])
    later = figure.axes[4].collections[0]
    assert np.ptp(weight.get_array()) > 0.9
    assert set(np.unique(zone.get_array())) >= {0.0, 1.0}
    # 2e-7 per s for 1e5 s
    assert 0.9 * 0.02 < increment.get_array().max() <= 0.02
    # the whole section, as wide as the brain
    width = [
        np.ptp(np.concatenate([path.vertices for path in part.get_paths()])[:, 0])
        for part in (weight, later)
    ]
    assert width == pytest.approx([40.0, 48.0], rel=0.03)
    assert len(normals.get_paths()) == len(weight.get_paths())


def test_outlines_are_those_of_both_brains_at_one_scale_aligned():
    bigger, moved = (
        TriangleMesh(mesh, SMOOTH.faces)
        for mesh in (1.1 * SMOOTH.vertices, SMOOTH.vertices + [5, -3, 2])
    )
    figure = outlines_figure(
        [
            plain("thin", 21.0, SMOOTH, simulated=True),
            plain("thin", 22.0, moved, simulated=True),
            plain("observed brain", 21.0, SMOOTH),
            plain("observed brain", 22.0, bigger),
        ]
    )
    first, second = figure.axes[2:4]
    assert np.ptp(first.get_xlim()) == np.ptp(second.get_xlim())
    real, simulated = (
        np.concatenate(lines.get_segments()) for lines in second.collections
    )
    assert np.ptp(real[:, 0]) == pytest.approx(44.0, rel=0.01)
    assert np.ptp(simulated[:, 0]) == pytest.approx(40.0, rel=0.01)
    assert simulated.mean(axis=0) == pytest.approx(real.mean(axis=0), abs=0.5)
    assert {"thin", "observed brain", "21 GW", "22 GW"} <= words(figure)


@pytest.mark.parametrize(("sides", "inner"), [("lr", 2), ("l", 1), ("r", 1)])
def test_a_brain_is_shown_from_outside_and_each_hemisphere_from_within(sides, inner):
    halves = {
        "l": box((20, 30, 20), (-11, 0, 0)),
        "r": box((20, 30, 20), (11, 0, 0)),
    }
    # the inner face of a half is a sulcus, its outer one a gyrus
    maps = []
    for name in sides:
        x = halves[name].vertices[:, 0]
        is_inner = np.abs(x) < 2
        maps.append((halves[name], {"shape_index": np.where(is_inner, -0.5, 0.5)}))
    names = {"l": "left", "r": "right"}
    figure = brain_maps(maps, sides=[names[side] for side in sides])
    count = len(pictures(figure))
    assert count == 3 + inner
    tones = [tone(picture(figure, number)) for number in range(count)]
    # outside red, inside blue
    assert all(red > blue for red, _, blue in (tones[0], tones[1]) if sides == "lr")
    assert all(blue > red for red, _, blue in tones[3:])


def test_brains_of_several_pages_have_one_scale_and_one_depth():
    figures = []
    for size, deep in ((60.0, 2.0), (80.0, 9.0)):
        mesh = box((size, size, size))
        depth = {"sulcal_depth_mm": np.full(len(mesh.vertices), deep)}
        figures.append(brain_depth([(mesh, depth)], sides=["left"]))
    assert figures[0].get_figwidth() == figures[1].get_figwidth()
    # dots per mm of the pictures and of the scale bars
    scales = set()
    for figure in figures:
        (bar,) = [axes for axes in figure.axes if axes.get_label() == "scale bar"]
        assert "20 mm" in words(figure)
        for axes in (bar, *pictures(figure)):
            dots = axes.get_window_extent().width
            scales.add(round(dots / np.ptp(axes.get_xlim()), 2))
    assert len(scales) == 1
    ends = [colour_bar(figure, "sulcal depth").get_xlim() for figure in figures]
    assert ends[0] == ends[1] == (0.0, 5.0)
    # what is wider than the page is smaller
    mesh = box((400.0, 400.0, 400.0))
    depth = {"sulcal_depth_mm": np.zeros(len(mesh.vertices))}
    wide = brain_depth([(mesh, depth)], sides=["left"])
    assert wide.get_figwidth() == figures[0].get_figwidth()
