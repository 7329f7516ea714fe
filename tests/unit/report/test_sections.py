"""Sections lie where they say, and outlines on the edges that the volumes under them show."""

import numpy as np
import pytest
from matplotlib.collections import LineCollection
from pictures import words
from shapes import ellipsoid_mesh, rigid

from gyriflow.anatomy.extraction import isosurface
from gyriflow.geometry.tetrahedra import boundary_surface
from gyriflow.geometry.triangles import TriangleMesh, transformed
from gyriflow.report.quality import Brain, quality_page
from gyriflow.report.sections import outlines_chart

BALL = ellipsoid_mesh(8, (20.0, 26.0, 18.0))
SURFACE, _ = boundary_surface(BALL)


def test_outlines_are_those_of_both_brains_at_one_scale():
    bigger = TriangleMesh(1.1 * SURFACE.vertices, SURFACE.faces)
    figure = outlines_chart({"thin": {21.0: SURFACE, 22.0: SURFACE}}, {21.0: SURFACE, 22.0: bigger}, planes=("axial",))
    first, second = figure.axes
    assert np.ptp(first.get_xlim()) == np.ptp(second.get_xlim())
    real, simulated = (np.concatenate(lines.get_segments()) for lines in second.collections)
    assert np.ptp(real[:, 0]) == pytest.approx(44.0, rel=0.01)
    assert np.ptp(simulated[:, 0]) == pytest.approx(40.0, rel=0.01)
    assert {"thin", "real brain", "21 GW", "22 GW"} <= words(figure)


@pytest.fixture(scope="module")
def figure():
    """An ellipsoid in a volume stored obliquely, and the page of quality with both turned upright."""
    centre, half = np.array([12.0, -7.0, 3.0]), np.array([15.0, 21.0, 12.0])
    oblique = np.eye(4)
    oblique[:3, :3] = rigid(25, -10, 40)[:3, :3] * 0.8
    oblique[:3, 3] = centre - oblique[:3, :3] @ np.full(3, 40.0)
    index = np.stack(np.indices((81, 81, 81)), axis=-1)
    away = np.linalg.norm((index @ oblique[:3, :3].T + oblique[:3, 3] - centre) / half, axis=-1)
    surface = isosurface((1.5 - away).astype(np.float32), oblique)
    pose = np.eye(4)
    pose[:3, 3] = 1, 2, 3
    centre = centre + pose[:3, 3]
    brain = Brain(transformed(surface, pose), centre[0], image=(100.0 * (away < 1), pose @ oblique))
    return quality_page(brain, title="a", verdict="fine", facts={}, warnings=[]), centre, half


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
