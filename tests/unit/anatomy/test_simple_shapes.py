"""Simple shapes through the surface stage: nothing is moved, left and right meet at x = 0."""

import numpy as np
import pytest

from gyriflow.anatomy.pial import from_shape
from gyriflow.errors import MeshError
from gyriflow.geometry.triangles import TriangleMesh, area, corners, submesh
from gyriflow.metrics.measure import measure_brain
from gyriflow.phantom.shapes import shape_surface


def ball(edge_mm=1.5):
    return shape_surface("sphere", (15.0, 15.0, 15.0), edge_length_mm=edge_mm, noise_mm=0.0)


def test_a_shape_is_left_as_it_is_and_cut_at_x_0():
    slab = shape_surface("slab", (20.0, 16.0, 6.0), edge_length_mm=1.0, noise_mm=0.05)
    surface = from_shape(slab, week=21.0)
    assert np.array_equal(surface.whole.vertices, slab.vertices)
    assert surface.fissure_x_mm == surface.report["fissure_x_mm"] == 0.0
    assert surface.pose.world.tolist() == np.eye(4).tolist()
    assert (surface.report["source"], surface.report["week"], surface.report["warnings"]) == ("shape", 21.0, [])
    assert corners(surface.left)[:, :, 0].mean(axis=1).max() < 0 < corners(surface.right)[:, :, 0].mean(axis=1).min()
    assert area(surface.left) + area(surface.right) == pytest.approx(area(slab))
    assert area(surface.left) == pytest.approx(area(slab) / 2, rel=0.02)


def test_a_sphere_is_measured_as_a_sphere():
    surface = from_shape(ball(1.0), week=21.0)
    table = measure_brain(surface.whole, surface.left, surface.right).table
    whole = table[table["hemisphere"] == "whole"].set_index("metric")["value"]
    assert whole["mean_shape_index"] == pytest.approx(1.0, abs=0.005)
    assert whole["mean_curvedness"] == pytest.approx(1 / 15, rel=0.02)
    assert whole["gyrification_index"] == pytest.approx(1.0, abs=0.001)
    assert whole["area"] == pytest.approx(4 * np.pi * 1.5**2, rel=0.01)


def test_a_shape_that_is_not_closed_or_cuts_itself_is_refused():
    mesh = ball()
    holed, _ = submesh(mesh, np.arange(len(mesh.faces)) > 0)
    with pytest.raises(MeshError, match="without two faces"):
        from_shape(holed, week=21.0)
    vertices = mesh.vertices.copy()
    vertices[0] *= -1.2
    with pytest.raises(MeshError, match="cut others"):
        from_shape(TriangleMesh(vertices, mesh.faces), week=21.0)
