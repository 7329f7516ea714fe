"""The outline of a surface lies on the edge that the volume under it shows."""

import numpy as np
import pytest
from matplotlib.collections import LineCollection
from scipy.spatial.transform import Rotation

from gyriflow.geometry.triangles import TriangleMesh, transformed
from gyriflow.report.overlay import surface_overlay
from gyriflow.surface.extraction import isosurface


@pytest.fixture(scope="module")
def figure():
    """An ellipsoid in a volume stored obliquely, and the figure with both turned upright."""
    centre, half = np.array([12.0, -7.0, 3.0]), np.array([15.0, 21.0, 12.0])
    oblique = np.eye(4)
    oblique[:3, :3] = Rotation.from_euler("xyz", [25, -10, 40], degrees=True).as_matrix() * 0.8
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
