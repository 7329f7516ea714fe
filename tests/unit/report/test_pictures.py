"""Pictures show the right side, at one scale, in the colours of their values."""

import numpy as np
import pytest
from matplotlib.text import Text
from pictures import (
    colour_bar,
    covered,
    parts,
    picture,
    pictures,
    surfaces_seen,
    tone,
    words,
)
from shapes import box, ellipsoid, ellipsoid_mesh, sphere

from gyriflow.folding.growth import GrowthByRates, StepStart, model_fields
from gyriflow.folding.zones import zones_of_run
from gyriflow.geometry.triangles import TriangleMesh, merged
from gyriflow.quantities import name_in_interval
from gyriflow.report import panels
from gyriflow.report import pictures as pictures_of_surfaces
from gyriflow.report.panels import LINES_MM
from gyriflow.report.pictures import (
    GridBrain,
    brain_depth,
    brain_maps,
    brain_regions,
    displacement_maps,
    expected_figure,
    growth_across_figure,
    growth_found_figure,
    influence_figure,
    scale_of,
    shape_maps,
    weekly_figure,
    zones_figure,
)
from gyriflow.report.scene import VIEWS, render, uniform_colours
from gyriflow.report.sections import model_figure, outlines_figure
from gyriflow.report.style import FULL_WIDTH_IN
from gyriflow.settings.folding import parameters_from

BRAIN = box((20, 30, 20))
SMOOTH = ellipsoid((20.0, 26.0, 18.0))
RUN = {"start_week": 21, "end_week": 22, "output_weeks": [21, 22], "fissure_x_mm": 0.0}


def plain(row, column, mesh, *, simulated=False):
    """Return a brain of one colour."""
    return GridBrain(row, column, [(mesh, {})], simulated)


def mapped(row, column, mesh, name, value):
    """Return a brain with a map of one value."""
    values = np.full(len(mesh.vertices), value)
    return GridBrain(row, column, [(mesh, {name: values})])


def tones(figure):
    """Return the mean colours of all pictures."""
    return [tone(picture(figure, number)) for number in range(len(pictures(figure)))]


# sides


def seen(mesh, colours, view):
    return render(mesh, colours, VIEWS[view], (20, 20), 4).astype(float)


@pytest.mark.parametrize("name", ["left", "right", "top", "bottom", "front", "back"])
def test_the_ends_of_a_view_are_where_its_letters_say(name):
    places = [(-15, 0, 0), (15, 0, 0), (0, 15, 0), (0, -15, 0), (0, 0, 0)]
    mesh = merged(*(box((4, 4, 4), place) for place in places))
    palette = {"L": (1, 0, 0), "R": (0, 1, 0), "A": (0, 0, 1), "P": (1, 1, 0)}
    hues = [*palette.values(), (0.5, 0.5, 0.5)]
    image = seen(mesh, np.repeat(hues, 12, axis=0).astype(float), name)
    found = []
    for part in (image[:, :40], image[:, -40:]):
        hue = part[covered(part)].mean(axis=0)
        likeness = {
            key: hue @ rgb / np.linalg.norm(rgb) for key, rgb in palette.items()
        }
        found.append(max(likeness, key=likeness.__getitem__))
    assert tuple(found) == VIEWS[name].ends


@pytest.mark.parametrize("name", ["left", "top"])
def test_up_is_superior_and_in_the_top_view_anterior(name):
    on_top, in_front = box((5, 5, 5), (0, 0, 20)), box((5, 5, 5), (0, 20, 0))
    mesh = merged(box((20, 20, 20)), on_top, in_front)
    width = covered(seen(mesh, uniform_colours(mesh, "#ff0000"), name)).sum(axis=1)
    assert 0 < width[:30].max() < width[-30:].max()


@pytest.mark.parametrize(("sides", "inner"), [("lr", 2), ("r", 1)])
def test_a_brain_is_shown_from_outside_and_each_hemisphere_from_within(sides, inner):
    # the inner face of a half is a sulcus, its outer one a gyrus
    maps = []
    for name in sides:
        mesh = box((20, 30, 20), (-11 if name == "l" else 11, 0, 0))
        is_inner = np.abs(mesh.vertices[:, 0]) < 2
        maps.append((mesh, {"shape_index": np.where(is_inner, -0.5, 0.5)}))
    names = {"l": "left", "r": "right"}
    found = tones(brain_maps(maps, sides=[names[side] for side in sides]))
    assert len(found) == 3 + inner
    # outside red, inside blue
    assert all(red > blue for red, _, blue in found[:2] if sides == "lr")
    assert all(blue > red for red, _, blue in found[3:])


# grids


@pytest.fixture
def blank(monkeypatch):
    """Draw no surfaces, where only their places matter."""
    white = np.full((2, 2, 3), 255, np.uint8)
    monkeypatch.setattr(panels, "render", lambda *_, **__: white)


def by_week():
    """Weeks are sorted and leave gaps, and all is at one scale."""
    return weekly_figure(
        [
            plain("simulated", 23.5, box((60, 80, 60)), simulated=True),
            plain("simulated", 22.0, BRAIN, simulated=True),
            plain("observed brain", 22.0, BRAIN),
        ]
    )


def runs_of_a_sweep():
    """In their order, with the observed brain last; one has ended before."""
    sizes = {"a": (28, 0.9), "b": (0, 0), "c": (20, -0.9), "seen": (24, 0.1)}
    grid = []
    for name, (tall, value) in sizes.items():
        grid.append(mapped("", name, box((20, 30, tall)), "shape_index", value))
    grid[1] = GridBrain("", "b", is_simulated=True)
    values = {"a": 2.5, "b": 2.0, "c": 1.5}
    varied = {run: {"thickness_mm": size} for run, size in values.items()}
    return influence_figure(grid, values=varied)


def displacement_of_two_runs():
    """Each has its interval, its maximum and where that is; one scale is for both."""
    frames = []
    for week, mm in ((21.0, 1), (22.0, 4)):
        before = TriangleMesh(BRAIN.vertices - [0.0, 0, mm], BRAIN.faces)
        frames.append({week: (before, {}), week + 1: (BRAIN, {})})
    return displacement_maps(frames, runs=["slow", "fast"])


def observed_outside_and_inside_of_the_expected():
    """Red and blue."""
    distance = np.where(BRAIN.vertices[:, 1] > 0, 3.0, -1.5)
    return expected_figure(
        [
            plain("expected", 26.0, BRAIN, simulated=True),
            plain("observed brain", 26.0, BRAIN),
            GridBrain("distance", 26.0, [(BRAIN, {"distance_mm": distance})]),
        ]
    )


def a_map_that_one_hemisphere_lacks():
    left, right = box((8, 30, 20), (-6, 0, 0)), box((8, 30, 20), (6, 0, 0))
    halves = [(left, {"shape_index": np.ones(8)}), (right, {})]
    return shape_maps([GridBrain("simulated", 21.0, halves)])


def growth(draw, quantity, factor):
    """Draw the growth of two intervals, each on the surface at its end."""
    heights = {21.0: 20, 22.5: 24, 25.0: 30}
    frames = {week: (box((20, 30, tall)), {}) for week, tall in heights.items()}
    maps = {}
    for interval, value in (((21.0, 22.5), 2.0), ((22.5, 25.0), 8.0)):
        name = name_in_interval(f"{quantity}_growth_percent_per_gw", *interval)
        maps[name] = np.full(8, factor * value)
    return draw(frames, maps)


def growth_of_area():
    return growth(growth_found_figure, "area", 1.0)


def growth_across():
    return growth(growth_across_figure, "thickness", -0.5)


def regions():
    """One colour a region, and none for other numbers."""
    mesh = sphere(20.0)
    y, z = mesh.vertices[:, 1], mesh.vertices[:, 2]
    numbers = np.where(z < -12, 0, np.where(y > 0, 1, 2))
    names = {1: "front", 2: "back"}
    return brain_regions([GridBrain("", "p", [(mesh, (numbers, names))])])


def zones():
    """With their areas: a box of 10 × 30 × 20 mm has 22 cm². A medial view has one
    hemisphere."""
    brain = merged(box((10, 30, 20), (-6, 0, 0)), box((10, 30, 20), (6, 0, 0)))
    tags = {"zone": np.repeat([1, 3], 12)}
    return zones_figure((brain, tags), parameters_from(RUN))


PICTURES = (
    by_week,
    runs_of_a_sweep,
    displacement_of_two_runs,
    observed_outside_and_inside_of_the_expected,
    a_map_that_one_hemisphere_lacks,
    growth_of_area,
    growth_across,
    regions,
    zones,
)


@pytest.mark.parametrize("drawn", PICTURES, ids=lambda drawn: drawn.__name__)
def test_pictures_show(drawn, recorded):
    # renderers differ by some dots
    recorded(surfaces_seen(drawn()), rtol=5e-2, atol=2.0)


@pytest.mark.usefixtures("blank")
def test_weeks_that_stand_below_others_have_no_row_of_a_brain_that_ends_before(
    monkeypatch,
):
    for module in (panels, pictures_of_surfaces):
        monkeypatch.setattr(module, "MAX_COLUMNS", 2)
    weeks = (21.0, 22.0, 23.0)
    long = [plain("long", week, BRAIN, simulated=True) for week in weeks]
    figure = weekly_figure([*long, plain("observed brain", 21.0, BRAIN)])
    # of two blocks with two views
    written = [text.get_text() for text in parts(figure, Text)]
    assert sum("long" in text for text in written) == 4
    assert sum("observed brain" in text for text in written) == 2


@pytest.mark.usefixtures("blank")
def test_brains_of_several_pages_have_one_scale_and_one_depth():
    scales = []
    # what is wider than the page is smaller
    for size, deep in ((60.0, 2.0), (80.0, 9.0), (400.0, 0.0)):
        brain = mapped("", "", box((size, size, size)), "sulcal_depth_mm", deep)
        figure = brain_depth(brain.halves, sides=["left"])
        assert colour_bar(figure, "sulcal depth").get_xlim() == (0.0, 5.0)
        assert "20 mm" in words(figure)
        assert figure.get_figwidth() == FULL_WIDTH_IN
        for axes in figure.axes:
            if axes.images or axes.get_label() == "scale bar":
                dots = axes.get_window_extent().width
                scales.append(np.ptp(axes.get_xlim()) / dots)
    assert scales[:10] == pytest.approx([scales[0]] * 10, rel=1e-2)


def test_one_sharp_vertex_does_not_set_the_scale_of_a_displacement_and_is_ringed():
    moves = np.tile([0.0, 0, 1], (len(SMOOTH.vertices), 1))
    # on the right, not seen from the left
    top = int((SMOOTH.vertices @ [0.3, 0, 1]).argmax())
    moves[top] *= 50
    before = TriangleMesh(SMOOTH.vertices - moves, SMOOTH.faces)
    figure = displacement_maps([{21.0: (before, {}), 22.0: (SMOOTH, {})}], runs=["run"])
    bar = colour_bar(figure, "displacement")
    assert bar.get_xlim()[1] == pytest.approx(1.0)
    rings = []
    for axes in pictures(figure):
        rings += [
            ring for ring in axes.patches if ring.get_edgecolor()[:3] == (0, 0, 0)
        ]
    assert [ring.get_linestyle() for ring in rings] == [":", "-"]
    middle = (SMOOTH.vertices.min(axis=0) + SMOOTH.vertices.max(axis=0)) / 2
    assert rings[1].center == pytest.approx((SMOOTH.vertices[top] - middle)[:2])


@pytest.mark.parametrize("quantity", ["curvedness", "sulcal_depth_mm"])
def test_scales_go_from_zero_to_where_few_vertices_are_above(quantity):
    values = np.array([0.1] * 399 + [9.0])
    assert scale_of(quantity, values).get_clim() == (0.0, pytest.approx(0.1))


# growth


def test_lines_on_a_map_run_along_directions_where_these_are_seen(monkeypatch):
    drawn = []

    def noted(*arguments, lines, **more):
        drawn.append(lines)
        return render(*arguments, lines=lines, **more)

    monkeypatch.setattr(panels, "render", noted)
    x, y, _ = SMOOTH.vertices.T
    # shorter in front
    along_y = np.where(x > 0, np.where(y > 0, 0.25, 0.5), 0.0)
    name = "area_growth_percent_per_gw"
    growth = {name_in_interval(name, 21.0, 22.0): np.full(len(x), 0.1)}
    for axis, values in {"x": 0 * x, "y": along_y, "z": 0 * x}.items():
        growth[name_in_interval(f"growth_direction_{axis}", 21.0, 22.0)] = values
    frames = {21.0: (SMOOTH, {}), 22.0: (SMOOTH, {})}
    figure = growth_found_figure(frames, growth)
    _, from_above, _ = drawn
    along = from_above[:, 1] - from_above[:, 0]
    lengths = np.unique(along[:, 1].round(6))
    assert lengths == pytest.approx([0, LINES_MM / 2, LINES_MM])
    assert not along[:, [0, 2]].any()
    # one in each cube
    cubes = np.unique(np.floor(from_above.mean(axis=1) / LINES_MM), axis=0)
    assert len(cubes) > 0.6 * len(from_above)
    # from the left, and from above with the right on the right
    dark = [(picture(figure, number) < 60).all(axis=-1) for number in (0, 1)]
    middle = dark[1].shape[1] // 2
    assert not dark[0].any()
    assert not dark[1][:, :middle].any()
    assert dark[1][:, middle:].sum() > 50


# sections


def test_the_models_fields_are_drawn_in_the_elements_at_the_start_and_at_the_end():
    mesh = ellipsoid_mesh(8, (20.0, 26.0, 18.0))
    p = parameters_from(RUN | {"step_s": 1e5, "thickness_mm": 4.0})
    zones = zones_of_run(mesh, p)
    growth = GrowthByRates(p, StepStart(mesh.vertices, 0.0, p.step_s))
    weeks = {
        week: model_fields(growth, zones, size * mesh.vertices, week)
        for week, size in ((21.0, 1.0), (22.0, 1.2))
    }
    figure = model_figure((mesh.tets, weeks))
    titles = {"cortical weight", "growth zone", "normals", "21 GW", "22 GW"}
    assert titles <= words(figure)
    weight, zone, increment, normals, later = (
        axes.collections[0] for axes in figure.axes[:5]
    )
    assert np.ptp(weight.get_array()) > 0.9
    assert set(np.unique(zone.get_array())) >= {0.0, 1.0}
    # 2e-7 per s for 1e5 s
    assert 0.9 * 0.02 < increment.get_array().max() <= 0.02
    # the whole section, as wide as the brain
    for part, width in ((weight, 40.0), (later, 48.0)):
        places = np.concatenate([path.vertices for path in part.get_paths()])
        assert np.ptp(places[:, 0]) == pytest.approx(width, rel=0.03)
    assert len(normals.get_paths()) == len(weight.get_paths())


def test_outlines_are_those_of_both_brains_at_one_scale_aligned():
    bigger = TriangleMesh(1.1 * SMOOTH.vertices, SMOOTH.faces)
    moved = TriangleMesh(SMOOTH.vertices + [5, -3, 2], SMOOTH.faces)
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
    lines = [np.concatenate(part.get_segments()) for part in second.collections]
    observed, simulated = lines
    assert np.ptp(observed[:, 0]) == pytest.approx(44.0, rel=0.01)
    assert np.ptp(simulated[:, 0]) == pytest.approx(40.0, rel=0.01)
    assert simulated.mean(axis=0) == pytest.approx(observed.mean(axis=0), abs=0.5)
    assert {"thin", "observed brain", "21 GW", "22 GW"} <= words(figure)
