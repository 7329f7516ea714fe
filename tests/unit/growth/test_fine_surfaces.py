"""Surfaces of predictions: observed ones, moved by a mesh that is coarser."""

import numpy as np
import pandas as pd
import pytest
from facts import Facts
from shapes import ellipsoid_mesh, rigid, sphere

from gyriflow.geometry.deformations import transform_points
from gyriflow.geometry.matching import nearest_on
from gyriflow.geometry.tetrahedra import boundary_surface
from gyriflow.geometry.triangles import TriangleMesh, signed_volume
from gyriflow.growth.fine_surfaces import (
    ObservedSurface,
    finer_share,
    moved_surface,
    nearest_in_age,
)

COARSE, _ = boundary_surface(ellipsoid_mesh(8, (20.0, 20.0, 20.0)))


def folded(height_mm=0.8):
    """Return a fine surface with waves that the coarse mesh does not resolve."""
    ball = sphere(20.0, 4)
    x, y, z = ball.vertices.T
    waves = np.sin(1.2 * x) * np.cos(1.2 * y) + np.sin(1.2 * z)
    return TriangleMesh(
        ball.vertices * (1 + height_mm * waves / 40)[:, None], ball.faces
    )


def grown(points):
    """Grow (n, 3) points by a fifth, unevenly, and turn them."""
    x, y, z = points.T
    bent = 1.2 * x + 0.4 * np.sin(y / 9), 1.15 * y, 1.25 * z + 0.3 * np.cos(x / 8)
    pose = rigid(20, -10, 40, shift=(5.0, -3.0, 8.0))
    return transform_points(np.column_stack(bent), pose)


FINE = folded()
PLACES = nearest_on(COARSE.vertices, FINE)[2]
OBSERVED = ObservedSurface(FINE, PLACES)


def test_folds_finer_than_the_mesh_move_with_it():
    boundary = TriangleMesh(grown(PLACES), COARSE.faces)
    moved = moved_surface(OBSERVED, boundary)
    misses = np.linalg.norm(moved.vertices - grown(FINE.vertices), axis=1)
    assert misses.mean() < 0.25
    # the body's volume, which is that of the coarser surface
    assert signed_volume(moved) == pytest.approx(signed_volume(boundary))
    assert signed_volume(moved) < 0.99 * signed_volume(FINE) * 1.2 * 1.15 * 1.25
    # the mesh itself cuts the folds off
    missed_by_mesh, _, _ = nearest_on(grown(FINE.vertices), boundary)
    assert missed_by_mesh.mean() > 0.2


def test_a_surface_that_would_cross_itself_is_that_of_the_mesh(caplog):
    # of one size, since only the displacements matter
    ball = sphere(20.0, 3)
    places = nearest_on(COARSE.vertices, ball)[2]
    shaken = np.random.default_rng(0).normal(scale=40.0, size=places.shape)
    boundary = TriangleMesh(places + shaken, COARSE.faces)
    assert moved_surface(ObservedSurface(ball, places), boundary) is boundary
    assert Facts("crosses itself", "mesh") == caplog.text


@pytest.mark.parametrize(
    ("weeks", "week", "number"),
    [
        ([24.0, 25.0, 26.0], 25.0, 1),
        ([24.0, 25.0, 26.0], 24.5, 0),
        ([25.0, 26.0], 26.5, 1),
    ],
)
def test_the_brain_of_the_nearest_age_is_moved_whatever_its_stated_week(
    weeks, week, number
):
    ages = {"stated_week": [22.0, 24, 25, 26], "age_by_size": [22, 23.6, 25.9, 26.8]}
    assert nearest_in_age(pd.DataFrame(ages), weeks, week) == number


def test_the_share_of_finer_differences_begins_with_all_of_them():
    kept = pd.DataFrame({"week": [24.0, 26.0], "finer_share": [0.6, 0.2]})
    shares = [finer_share(kept, 22.0, week) for week in (22.0, 23.0, 24.0, 25.0, 30.0)]
    assert shares == pytest.approx([1.0, 0.8, 0.6, 0.4, 0.2])
