"""Pictures show the right side, at one scale, in the colours of their values."""

import numpy as np
import pytest
import pyvista as pv
from matplotlib.figure import Figure
from matplotlib.text import Text
from shapes import ellipsoid_mesh

from gyriflow.errors import InputError
from gyriflow.geometry.tetrahedra import TetrahedralMesh, boundary_faces
from gyriflow.geometry.triangles import TriangleMesh, merged
from gyriflow.io.figures import write_figure
from gyriflow.parameters.terms import ZONE_NAMES
from gyriflow.report.panels import round_length
from gyriflow.report.renders import (
    displacement_maps,
    round_up,
    runs_by_week,
    runs_comparison,
    scalar_maps,
    signed_scale,
)
from gyriflow.report.scene import MAP, TISSUE, VIEWS, render, uniform_colours
from gyriflow.report.sections import Normals, cross_sections, normal_arrows
from gyriflow.report.zones import ZONES, field_picture, zones_picture


def box(size: tuple[float, float, float], middle: tuple[float, float, float] = (0, 0, 0)) -> TriangleMesh:
    """Returns a closed box of the given size in mm."""
    unit = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))]
    return TriangleMesh(unit * size + np.array(middle), np.array(faces))


def picture(figure: Figure, number: int = 0) -> np.ndarray:
    """Returns the pixels of a panel."""
    return np.asarray([axes for axes in figure.axes if axes.images][number].images[0].get_array())


def covered(image: np.ndarray) -> np.ndarray:
    """Returns which pixels are not background."""
    return (image < 250).any(axis=-1)


def ellipsoid_surface() -> TriangleMesh:
    """Returns a smooth closed surface that is the same left and right."""
    body = pv.ParametricEllipsoid(20.0, 26.0, 18.0, u_res=60, v_res=40, w_res=10).triangulate().clean()
    body.compute_normals(auto_orient_normals=True, inplace=True)
    return TriangleMesh(np.asarray(body.points, dtype=float), body.regular_faces)


def pictures(figure: Figure) -> list:
    """Returns the panels that show a picture."""
    return [axes for axes in figure.axes if axes.images]


def words(figure: Figure) -> set[str]:
    return {text.get_text() for text in figure.findobj(Text)}


@pytest.mark.parametrize(("name", "size"), [("left", (30, 20)), ("top", (10, 30)), ("front", (10, 20))])
def test_a_view_shows_the_right_extents_in_mm(name, size):
    mesh = box((10, 30, 20), (100, -50, 7))
    image = render(
        mesh, uniform_colours(mesh, "#ff0000"), VIEWS[name], half_width_mm=20, half_height_mm=20, pixels_per_mm=4
    )
    seen = covered(image)
    assert image.shape == (160, 160, 3)
    assert np.ptp(np.flatnonzero(seen.any(axis=0))) / 4 == pytest.approx(size[0], abs=1)
    assert np.ptp(np.flatnonzero(seen.any(axis=1))) / 4 == pytest.approx(size[1], abs=1)


@pytest.mark.parametrize("name", ["left", "right", "top", "bottom", "front", "back"])
def test_the_letters_of_a_view_are_where_they_say(name):
    mesh = merged(*(box((4, 4, 4), place) for place in [(-15, 0, 0), (15, 0, 0), (0, 15, 0), (0, -15, 0), (0, 0, 0)]))
    palette = {"L": (1, 0, 0), "R": (0, 1, 0), "A": (0, 0, 1), "P": (1, 1, 0), "": (0.5, 0.5, 0.5)}
    colours = np.repeat([palette[key] for key in ("L", "R", "A", "P", "")], 12, axis=0).astype(float)
    image = render(mesh, colours, VIEWS[name], half_width_mm=20, half_height_mm=20, pixels_per_mm=4).astype(float)
    found = []
    for columns in (slice(0, 40), slice(-40, None)):
        part = image[:, columns]
        tone = part[covered(part)].mean(axis=0)
        tone /= np.linalg.norm(tone)
        found.append(max("LRAP", key=lambda key: tone @ np.array(palette[key]) / np.linalg.norm(palette[key])))
    assert tuple(found) == VIEWS[name].ends


def test_up_is_superior_and_in_the_top_view_anterior():
    mesh = merged(box((20, 20, 20)), box((5, 5, 5), (0, 0, 30)), box((5, 5, 5), (0, 30, 0)))
    for name in ("left", "top"):
        image = render(
            mesh, uniform_colours(mesh, "#ff0000"), VIEWS[name], half_width_mm=30, half_height_mm=30, pixels_per_mm=2
        )
        width = covered(image).sum(axis=1)
        assert 0 < width[:20].max() < width[-20:].max()


def test_runs_by_week_have_a_panel_per_brain_and_leave_gaps():
    small, large = box((20, 30, 20)), box((25, 36, 25))
    figure = runs_by_week({"simulated": {22.0: small, 23.5: large}}, {22.0: small}, views=("left", "top"))
    panels = [axes.get_label() for axes in figure.axes if axes.images]
    assert len(panels) == 6
    assert "real brain\nleft view, column 0" in panels
    assert "real brain\nleft view, column 1" not in panels
    assert {"22 GW", "23.5 GW", "a", "d", "simulated\ntop view", "A", "P", "L", "R"} <= words(figure)
    assert covered(picture(figure, 0)).sum() < covered(picture(figure, 1)).sum()


def test_all_panels_have_one_scale_and_the_bar_its_length():
    figure = runs_by_week({"simulated": {22.0: box((20, 30, 20))}}, {22.0: box((60, 80, 60))}, views=("left", "top"))
    axes = [axes for axes in figure.axes if axes.images]
    scales = [np.ptp(each.get_xlim()) / each.get_window_extent().width for each in axes]
    scales += [np.ptp(each.get_ylim()) / each.get_window_extent().height for each in axes]
    assert scales == pytest.approx([scales[0]] * len(scales))
    (bar,) = [each for each in figure.axes if each.get_label() == "scale bar"]
    length = np.ptp(bar.get_xlim())
    assert f"{length:g} mm" in words(figure)
    assert length / bar.get_window_extent().width == pytest.approx(scales[0])


def test_simulated_and_measured_brains_differ_in_colour_and_the_phantom_is_named():
    mesh = box((20, 30, 20))
    figure = runs_by_week(
        {"simulated": {22.0: mesh}}, {22.0: mesh}, views=("left",), measured="phantom", synthetic=True
    )
    simulated, measured = (image[covered(image)].mean(axis=0) for image in (picture(figure, 0), picture(figure, 1)))
    assert simulated[2] > simulated[0]
    assert measured[0] > measured[2]
    assert "phantom\nleft view" in words(figure)
    assert any("synthetic phantom" in text for text in words(figure))
    assert not any("real brain\n" in text for text in words(figure))


def test_many_weeks_go_on_below():
    mesh = box((20, 30, 20))
    figure = runs_by_week({"simulated": {float(week): mesh for week in range(21, 31)}}, {}, views=("left",))
    places = [axes.get_position() for axes in figure.axes if axes.images]
    assert len({round(place.y0, 6) for place in places}) == 2
    assert max(place.x1 for place in places) <= 1


def test_runs_stand_side_by_side_with_the_measured_brain_last():
    mesh = box((20, 30, 20))
    figure = runs_comparison({"thin": mesh, "thick": mesh}, mesh, views=("top",))
    assert {"thin", "thick", "real brain", "top view"} <= words(figure)
    assert len([axes for axes in figure.axes if axes.images]) == 3


def test_displacement_maps_share_their_colour_scale():
    mesh = box((20, 30, 20))
    maps = {(22.0, 23.0): (mesh, np.full(8, 4.0)), (21.0, 22.0): (mesh, np.full(8, 1.0))}
    figure = displacement_maps(maps, views=("left",))
    (bar,) = [axes for axes in figure.axes if "displacement" in axes.get_xlabel()]
    assert bar.get_xlim() == pytest.approx((0.0, 4.0))
    assert "(mm)" in bar.get_xlabel()
    said = {"max 1.00 mm at −10, −15, −10\nmean 1.00 mm", "max 4.00 mm at −10, −15, −10\nmean 4.00 mm"}
    assert {"21–22 GW", "22–23 GW"} | said <= words(figure)
    first, second = (image[covered(image)].mean(axis=0) for image in (picture(figure, 0), picture(figure, 1)))
    # pale at a quarter of the scale, dark blue at its end
    assert first.sum() > 1.5 * second.sum()
    assert second[2] > 1.5 * second[0]


def test_one_sharp_vertex_does_not_set_the_scale_of_a_displacement_and_is_ringed():
    mesh = ellipsoid_surface()
    norms = np.ones(len(mesh.vertices))
    top = int(mesh.vertices[:, 2].argmax())
    norms[top] = 50.0
    figure = displacement_maps({(21.0, 22.0): (mesh, norms)}, views=("top", "bottom"))
    (bar,) = [axes for axes in figure.axes if "displacement" in axes.get_xlabel()]
    assert bar.get_xlim()[1] == pytest.approx(1.0)
    above, below = (
        [ring for ring in axes.patches if ring.get_edgecolor()[:3] == (0, 0, 0)] for axes in pictures(figure)
    )
    assert [ring.get_linestyle() for ring in (*above, *below)] == ["-", ":"]
    middle = (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2
    assert above[0].center == pytest.approx((mesh.vertices[top] - middle)[:2])


@pytest.mark.parametrize("material", [TISSUE, MAP])
def test_light_makes_no_difference_between_the_hemispheres(material):
    mesh = ellipsoid_surface()
    image = render(
        mesh,
        uniform_colours(mesh, "#8FB4DC"),
        VIEWS["top"],
        half_width_mm=25,
        half_height_mm=30,
        pixels_per_mm=4,
        material=material,
    ).astype(float)
    inside = covered(image)
    assert np.abs(image - image[:, ::-1])[inside & inside[:, ::-1]].mean() < 2.0


def test_maps_are_darkened_less_by_shade_than_tissue():
    mesh = ellipsoid_surface()
    size = {"half_width_mm": 25, "half_height_mm": 30, "pixels_per_mm": 4}
    spread = []
    for material in (TISSUE, MAP):
        image = render(mesh, uniform_colours(mesh, "#8FB4DC"), VIEWS["top"], material=material, **size)
        spread.append(np.ptp(np.percentile(image[covered(image)].sum(axis=-1), [5, 95])))
    assert spread[1] < 0.7 * spread[0]


def test_pictures_keep_their_pixels_in_print(tmp_path):
    figure = runs_by_week({"simulated": {22.0: ellipsoid_surface()}}, {}, views=("top",))
    write_figure(tmp_path / "a.png", tmp_path / "a.pdf", figure, dpi=300)
    ((axes, image),) = [(axes, axes.images[0]) for axes in figure.axes if axes.images]
    rows, columns, _ = np.asarray(image.get_array()).shape
    assert f"/Height {rows}" in (pdf := (tmp_path / "a.pdf").read_bytes().decode("latin-1"))
    assert f"/Width {columns}" in pdf
    # the panel covers whole dots of 300 to the inch
    box = axes.get_window_extent()
    inches = np.array([box.x0, box.y0, box.width, box.height]) / figure.dpi
    assert 300 * inches == pytest.approx(np.round(300 * inches), abs=1e-6)
    assert (columns, rows) == tuple(np.round(600 * inches[2:]).astype(int))


def test_shape_index_goes_from_minus_one_to_one_and_gyri_are_red():
    mesh = box((20, 30, 20))
    maps = {"simulated": {28.0: (mesh, np.full(8, 0.7))}, "real brain": {28.0: (mesh, np.full(8, -0.7))}}
    figure = scalar_maps(maps, quantity="shape_index", views=("left",))
    (bar,) = [axes for axes in figure.axes if "shape index" in axes.get_xlabel()]
    assert bar.get_xlim() == (-1.0, 1.0)
    gyri, sulci = (image[covered(image)].mean(axis=0) for image in (picture(figure, 0), picture(figure, 1)))
    assert gyri[0] > gyri[2]
    assert sulci[2] > sulci[0]


def test_an_unknown_quantity_or_view_is_refused():
    mesh = box((20, 30, 20))
    with pytest.raises(InputError, match="unknown quantity; found depth"):
        scalar_maps({"simulated": {28.0: (mesh, np.zeros(8))}}, quantity="depth")
    with pytest.raises(InputError, match=r"unknown view.*lateral"):
        runs_by_week({"simulated": {21.0: mesh}}, {}, views=("lateral",))


def test_zones_have_their_areas_and_the_medial_view_shows_one_hemisphere():
    brain = merged(box((10, 30, 20), (-6, 0, 0)), box((10, 30, 20), (6, 0, 0)))
    zones = np.repeat([1, 3], 12)
    figure = zones_picture(brain, zones, fissure_x_mm=0.0, views=("left medial", "right medial"))
    # a box of 10 × 30 × 20 mm has 22 cm²
    assert {"clamped 22.0 cm²", "right contact 22.0 cm²", "free 0.0 cm²"} <= words(figure)
    left, right = (image[covered(image)].mean(axis=0) for image in (picture(figure, 0), picture(figure, 1)))
    assert left[1] > left[0]
    assert right[0] > 2 * right[2]


def test_the_inside_of_a_parted_brain_has_no_zone():
    mesh = box((10, 30, 20))
    # without the side towards the camera
    open_ = TriangleMesh(mesh.vertices, mesh.faces[~(mesh.vertices[mesh.faces, 0] == 5.0).all(axis=1)])
    figure = zones_picture(open_, np.full(10, 1), fissure_x_mm=20.0, views=("left medial", "left"))
    medial, lateral = (image[covered(image)].astype(float) for image in (picture(figure, 0), picture(figure, 1)))
    assert np.ptp(medial.mean(axis=0)) < 10
    assert lateral.mean(axis=0)[1] > lateral.mean(axis=0)[0] + 50


def test_zones_that_do_not_fit_are_refused():
    mesh = box((20, 30, 20))
    with pytest.raises(InputError, match="found 3 codes; expected 12"):
        zones_picture(mesh, np.zeros(3, int), fissure_x_mm=0.0)
    with pytest.raises(InputError, match=r"unknown zone; found \[9\]"):
        zones_picture(mesh, np.full(12, 9), fissure_x_mm=0.0)


def test_field_picture_names_the_field():
    figure = field_picture(box((20, 30, 20)), np.linspace(0, 2, 8), label="growth (1)", fissure_x_mm=0.0)
    (bar,) = [axes for axes in figure.axes if axes.get_xlabel() == "growth (1)"]
    assert bar.get_xlim() == (0.0, 2.0)


def test_a_field_that_goes_below_zero_has_a_scale_as_wide_on_both_sides():
    figure = field_picture(box((20, 30, 20)), np.linspace(-1, 2, 8), label="growth (1)", fissure_x_mm=0.0)
    (bar,) = [axes for axes in figure.axes if axes.get_xlabel() == "growth (1)"]
    assert bar.get_xlim() == (-2.0, 2.0)
    scale = signed_scale(np.array([-1.0, 0.0, 2.0]))
    minus, zero, plus = scale.to_rgba([-1.0, 0.0, 1.0])[:, :3]
    # blue, pale, red
    assert minus[2] > minus[0]
    assert zero.min() > 0.9
    assert plus[0] > plus[2]


def test_a_field_that_is_the_same_everywhere_has_one_colour():
    values = np.full(5, 300.0) * (1 + 1e-15 * np.arange(5))
    figure = cross_sections(CORNER, {"modulus (Pa)": values}, planes=("axial",))
    drawn = figure.axes[0].collections[0]
    assert drawn.get_clim() == (0.0, pytest.approx(300.0))
    np.testing.assert_allclose(drawn.to_rgba(drawn.get_array()).std(axis=0), 0, atol=0.01)


def test_what_was_not_measured_is_keyed():
    mesh = box((20, 30, 20))
    figure = scalar_maps({"real brain": {21.0: (mesh, np.array([np.nan, *range(7)]))}}, quantity="thickness_mm")
    assert [text.get_text() for text in figure.legends[0].texts] == ["not measured"]


CORNER = TetrahedralMesh(
    [[0, 0, 0], [10, 0, 0], [0, 10, 0], [0, 0, 10], [10, 10, 10]], np.array([[0, 1, 2, 3], [1, 2, 3, 4]])
)


def areas(collection) -> np.ndarray:
    """Returns the areas of drawn triangles."""
    paths = [path.vertices[:3] for path in collection.get_paths()]
    (u, v) = (np.array([path[k] - path[0] for path in paths]) for k in (1, 2))
    return np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]) / 2


def test_a_section_has_the_area_and_the_values_of_the_middle_plane():
    points = CORNER.vertices
    figure = cross_sections(CORNER, {"height (mm)": points[:, 2], "x (mm)": points[:, 0]}, planes=("axial",))
    height, x = (axes.collections[0] for axes in figure.axes[:2])
    # at half its height the corner tetrahedron is a triangle with legs of 5 mm, the other a square of 50 mm2
    assert areas(x).sum() == pytest.approx(12.5 + 50.0)
    np.testing.assert_allclose(np.asarray(height.get_array()), 5.0)
    np.testing.assert_allclose(np.asarray(x.get_array()), [path.vertices[:3, 0].mean() for path in x.get_paths()])
    assert {"axial, z = 5.0 mm\ny (mm)", "height (mm)", "x (mm)"} <= words(figure)


def test_a_section_has_a_row_per_plane_the_tags_colours_and_the_ellipses_of_the_planes():
    tags = {"part": (np.array([4, 2]), {2: ("second", "#00ff00"), 4: ("first", "#ff0000")})}
    ball = (np.array([5.0, 5.0, 1.0]), np.array([5.0, 5.0, 5.0]))
    figure = cross_sections(CORNER, {}, tags=tags, planes=("coronal", "axial"), ellipsoid=ball)
    coronal, axial = figure.axes[:2]
    drawn = axial.collections[0]
    colours = drawn.to_rgba(drawn.get_array())
    assert areas(drawn)[colours[:, 0] == 1].sum() == pytest.approx(12.5)
    assert areas(drawn)[colours[:, 1] == 1].sum() == pytest.approx(50.0)
    # the ball's middle lies in the coronal plane, and 4 mm below the axial one
    assert [axes.patches[0].get_width() for axes in (coronal, axial)] == pytest.approx([10.0, 6.0])
    assert {"first", "second", "part", "ellipsoid"} <= words(figure)


def test_normals_are_arrows_at_vertices_near_the_plane():
    brain = ellipsoid_mesh(8, (20.0, 26.0, 18.0))
    facets = boundary_faces(brain)[0]
    normals = brain.vertices / np.maximum(np.linalg.norm(brain.vertices, axis=1, keepdims=True), 1e-9)
    shown = Normals(brain, normals, np.ones(len(normals)), facets)
    bigger = Normals(TetrahedralMesh(1.2 * brain.vertices, brain.tets), normals, shown.weight, facets)
    figure = normal_arrows({21.0: shown, 23.0: bigger}, planes=("axial",))
    axes, later = figure.axes
    # both weeks have one scale
    assert np.ptp(axes.get_xlim()) == np.ptp(later.get_xlim())
    assert later.get_title().startswith("23 GW, axial")
    pial, inside = (drawn for drawn in axes.collections if hasattr(drawn, "XY"))
    for arrows in (pial, inside):
        assert len(arrows.XY) > 10
        direction = np.stack([arrows.U, arrows.V], axis=1)
        # away from the middle
        outward = np.einsum("ij,ij->i", direction, arrows.XY)
        lengths = np.linalg.norm(direction, axis=1) * np.linalg.norm(arrows.XY, axis=1)
        np.testing.assert_allclose(outward, lengths, atol=1e-6)
    radius = [np.linalg.norm(arrows.XY / [20.0, 26.0], axis=1) for arrows in (pial, inside)]
    assert radius[0].min() > radius[1].max()


def test_a_section_of_wrong_values_or_in_an_unknown_plane_is_refused():
    with pytest.raises(InputError, match="growth: values do not fit the mesh; found 9; expected 5, one per vertex"):
        cross_sections(CORNER, {"growth": np.zeros(9)})
    with pytest.raises(InputError, match=r"unknown plane; found \['oblique'\]"):
        cross_sections(CORNER, {"growth": np.zeros(5)}, planes=("oblique",))
    with pytest.raises(InputError, match=r"part: unknown tag; found \[7\]"):
        cross_sections(CORNER, {}, tags={"part": (np.array([7, 1]), {1: ("one", "red")})})


@pytest.mark.parametrize(("quantity", "label"), [("curvedness", "(mm⁻¹)"), ("sulcal_depth_mm", "sulcal depth (mm)")])
def test_curvedness_and_depth_go_from_zero_to_where_few_vertices_are_above(quantity, label):
    mesh = box((20, 30, 20))
    values = np.array([0.1] * 7 + [9.0])
    figure = scalar_maps({"simulated": {28.0: (mesh, values)}}, quantity=quantity, views=("left",))
    (bar,) = [axes for axes in figure.axes if label in axes.get_xlabel()]
    assert bar.get_xlim() == pytest.approx((0.0, round_up(np.quantile(values, 0.995))))


@pytest.mark.parametrize(
    ("quantity", "unit"), [("contact_pressure_pa", "(Pa)"), ("contact_pressure_pa_per_gw", "(Pa/GW)")]
)
def test_contact_pressure_is_scaled_by_what_touches(quantity, unit):
    mesh = box((20, 30, 20))
    figures = [
        scalar_maps({"run": {28.0: (mesh, values)}}, quantity=quantity, views=("left",))
        for values in (np.array([0.0] * 6 + [100.0, 300.0]), np.zeros(8))
    ]
    ends = [next(axes for axes in figure.axes if unit in axes.get_xlabel()).get_xlim()[1] for figure in figures]
    assert ends == pytest.approx([round_up(np.quantile([100.0, 300.0], 0.995)), 1.0])


def test_a_surface_that_nothing_touches_is_grey_in_the_map_of_pressure():
    mesh = box((20, 30, 20))
    # the upper face is in contact, the side is not
    values = np.where(mesh.vertices[:, 2] > 0, 100.0, 0.0)
    values[(mesh.vertices[:, 0] < 0) & (mesh.vertices[:, 2] > 0)] = 0.0
    figure = scalar_maps({"run": {28.0: (mesh, values)}}, quantity="contact_pressure_pa", views=("left", "right"))
    left, right = (image[covered(image)].astype(float) for image in (picture(figure, 0), picture(figure, 1)))
    assert np.ptp(left.mean(axis=0)) < 3
    assert np.ptp(right.mean(axis=0)) > 30
    assert "no contact" in words(figure)


def test_every_zone_has_its_own_colour():
    assert len({colour for _, colour in ZONES.values()}) == len(ZONE_NAMES)


@pytest.mark.parametrize(("limit", "length"), [(55, 50), (50, 50), (49, 20), (0.7, 0.5), (9.9, 5)])
def test_scale_bars_have_round_lengths(limit, length):
    assert round_length(limit) == pytest.approx(length)
