"""Sections lie where they say, and outlines on the edges that the volumes under them show."""

import numpy as np
import pytest
from matplotlib.collections import LineCollection
from pictures import words
from shapes import ellipsoid_mesh, rigid

from gyriflow.anatomy.extraction import isosurface
from gyriflow.errors import InputError
from gyriflow.geometry.tetrahedra import TetrahedralMesh, boundary_faces, boundary_surface
from gyriflow.geometry.triangles import TriangleMesh, transformed
from gyriflow.parameters.terms import FREE, LEFT_CONTACT
from gyriflow.report.sections import (
    Normals,
    barrier_law,
    contact_scheme,
    cross_sections,
    normal_arrows,
    outlines_chart,
    penalty_law,
    surface_overlay,
)

BALL = ellipsoid_mesh(8, (20.0, 26.0, 18.0))
SURFACE, _ = boundary_surface(BALL)
CORNER = TetrahedralMesh(
    [[0, 0, 0], [10, 0, 0], [0, 10, 0], [0, 0, 10], [10, 10, 10]], np.array([[0, 1, 2, 3], [1, 2, 3, 4]])
)


def test_a_field_that_is_the_same_everywhere_has_one_colour():
    values = np.full(5, 300.0) * (1 + 1e-15 * np.arange(5))
    figure = cross_sections(CORNER, {"modulus (Pa)": values}, planes=("axial",))
    drawn = figure.axes[0].collections[0]
    assert drawn.get_clim() == (0.0, pytest.approx(300.0))
    np.testing.assert_allclose(drawn.to_rgba(drawn.get_array()).std(axis=0), 0, atol=0.01)


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
    brain = BALL
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


def test_outlines_are_those_of_both_brains_at_one_scale():
    bigger = TriangleMesh(1.1 * SURFACE.vertices, SURFACE.faces)
    figure = outlines_chart({"thin": {21.0: SURFACE, 22.0: SURFACE}}, {21.0: SURFACE, 22.0: bigger}, planes=("axial",))
    first, second = figure.axes
    assert np.ptp(first.get_xlim()) == np.ptp(second.get_xlim())
    real, simulated = (np.concatenate(lines.get_segments()) for lines in second.collections)
    assert np.ptp(real[:, 0]) == pytest.approx(44.0, rel=0.01)
    assert np.ptp(simulated[:, 0]) == pytest.approx(40.0, rel=0.01)
    assert {"thin", "real brain", "21 GW", "22 GW"} <= words(figure)


def test_a_penalty_presses_only_beyond_the_plane():
    law = penalty_law(5e5)
    assert law.pressure[law.at <= 0].max() == 0
    assert law.pressure[-1] == pytest.approx(500.0)


def test_a_barrier_repels_more_the_nearer_and_not_beyond_its_distance():
    law = barrier_law(lambda squared, reach: -((squared - reach) ** 2) * np.log(squared / reach))
    assert (np.diff(law.pressure[law.at < 1]) < 0).all()
    assert law.pressure[law.at > 1].max() == 0
    assert np.interp(0.5, law.at, law.pressure) == pytest.approx(1.0, rel=1e-2)


def test_the_scheme_shows_the_planes_where_there_are_any():
    facets = boundary_faces(BALL)[0]
    mesh = TriangleMesh(BALL.vertices, facets)
    zones = np.where(mesh.vertices[facets][:, :, 0].mean(axis=1) < 0, LEFT_CONTACT, FREE)
    law = penalty_law(5e5)
    with_planes = contact_scheme(mesh, zones, law, planes_mm=(-0.5, 0.5))
    planes = [line.get_xdata()[0] for line in with_planes.axes[0].lines if line.get_linestyle() == "--"]
    assert planes == [-0.5, 0.5]
    assert "left contact" in words(with_planes)
    without = contact_scheme(mesh, zones, law, planes_mm=None, distance="d̂ = 0.2 mm")
    assert "left contact" not in words(without)
    # the walls are not that near: nothing acts between them
    arrows = [text for axes in without.axes for text in axes.texts if getattr(text, "arrow_patch", None)]
    assert arrows == []


@pytest.fixture(scope="module")
def figure():
    """An ellipsoid in a volume stored obliquely, and the figure with both turned upright."""
    centre, half = np.array([12.0, -7.0, 3.0]), np.array([15.0, 21.0, 12.0])
    oblique = np.eye(4)
    oblique[:3, :3] = rigid(25, -10, 40)[:3, :3] * 0.8
    oblique[:3, 3] = centre - oblique[:3, :3] @ np.full(3, 40.0)
    index = np.stack(np.indices((81, 81, 81)), axis=-1)
    away = np.linalg.norm((index @ oblique[:3, :3].T + oblique[:3, 3] - centre) / half, axis=-1)
    surface = isosurface((1.5 - away).astype(np.float32), oblique)
    pose = np.eye(4)
    pose[:3, 3] = 1, 2, 3
    posed: TriangleMesh = transformed(surface, pose)
    return (
        surface_overlay(
            100.0 * (away < 1),
            pose @ oblique,
            posed,
        ),
        centre + pose[:3, 3],
        half,
    )


@pytest.mark.parametrize(
    ("number", "name", "axes"), [(0, "coronal", (0, 2)), (1, "axial", (0, 1)), (2, "sagittal", (1, 2))]
)
def test_line_and_edge_agree_in_every_plane(figure, number, name, axes):
    drawn, centre, half = figure
    panel = drawn.axes[number]
    assert panel.get_title().startswith(name)
    (lines,) = [item for item in panel.collections if isinstance(item, LineCollection)]
    points = np.concatenate(lines.get_segments())
    # the sagittal plane is half-way to the right, where the ellipse is smaller
    share = np.sqrt(0.75) if name == "sagittal" else 1.0
    expected = share * half[list(axes)]
    np.testing.assert_allclose(np.ptp(points, axis=0) / 2, expected, atol=0.15)
    np.testing.assert_allclose((points.max(axis=0) + points.min(axis=0)) / 2, centre[list(axes)], atol=0.15)
    image = panel.images[0]
    left, right, low, high = image.get_extent()
    bright = np.asarray(image.get_array()) > 50
    rows, columns = (np.flatnonzero(bright.any(axis=axis)) for axis in (1, 0))
    size = (right - left) / bright.shape[1], (high - low) / bright.shape[0]
    found = np.array([left, low]) + (np.array([columns[[0, -1]].mean(), rows[[0, -1]].mean()]) + 0.5) * size
    np.testing.assert_allclose(found, centre[list(axes)], atol=0.4)
    spans = np.array([np.ptp(columns), np.ptp(rows)]) * size / 2
    np.testing.assert_allclose(spans, expected, atol=0.5)
