"""Matching points of surfaces, their distance, the voxels inside, and smoothing."""

import igl
import numpy as np
import pytest
from shapes import box, box_mesh, inner, rigid, sphere

from gyriflow.geometry.deformations import (
    transform_points,
)
from gyriflow.geometry.diffusion import diffuse, vertex_sizes
from gyriflow.geometry.matching import (
    match_layers,
    match_points,
    match_surface,
    nearest_on,
    surface_mask,
    values_at,
)
from gyriflow.geometry.triangles import (
    TriangleMesh,
    merged,
    transformed,
)


def walls() -> TriangleMesh:
    """Return two boxes with a gap of 1 mm between their facing walls x = -0.5 and x =
    0.5."""
    return merged(*(box((10, 10, 10), (side * 5.5, 0, 0), 2) for side in (-1, 1)))


def test_the_other_wall_is_not_matched():
    mesh = walls()
    # beyond the middle of the gap, nearer to the other wall
    point, normal = np.array([[0.3, 0.4, 0.7]]), np.array([[1.0, 0.0, 0.0]])
    match = match_points(point, normal, mesh)
    assert match.agrees.all()
    assert values_at(match, mesh.vertices)[0, 0] == pytest.approx(-0.5)
    assert match_points(point, -normal, mesh).distance_mm == pytest.approx([0.2])
    # so are the walls of a body that moved as far
    moved_walls = TriangleMesh(mesh.vertices + [0.8, 0.0, 0.0], mesh.faces)
    match = match_surface(moved_walls, mesh)
    assert match.distance_mm.max() <= 0.8 + 1e-9
    assert match.agrees.all()
    inside = np.isclose(mesh.vertices[:, 0], -0.5)
    inside &= (np.abs(mesh.vertices[:, 1:]) < 4.0).all(axis=1)
    assert inside.any()
    assert values_at(match, mesh.vertices)[inside, 0] == pytest.approx(-0.5)


@pytest.mark.parametrize(("degrees", "agrees"), [(55, True), (65, False)])
def test_normals_agree_up_to_60_degrees(degrees, agrees):
    mesh = box((10, 10, 10), subdivisions=2)
    normal = rigid(0, degrees, 0)[:3, :3] @ [0.0, 0.0, 1.0]
    # above the middle of the upper wall; no wall but the right one agrees more, 5 mm
    # away
    match = match_points(np.array([[0.3, 0.4, 5.5]]), normal[None], mesh)
    assert match.agrees.all()
    assert (match.distance_mm[0] < 1.0) == agrees


@pytest.mark.parametrize("wall", [-0.5, 0.5])
def test_the_tissue_below_tells_the_wall(wall):
    mesh = walls()
    point, normal = np.array([[0.3, 0.0, 0.0]]), np.array([[-1.0, 0.0, 0.0]])
    # the tissue of a point lies behind one wall, 0.4 mm lower than the point
    below = np.array([[5.0 * wall, 0.0, -0.4]])
    match = match_layers(point, normal, below, mesh, inner(mesh, 2.0).vertices)
    place = values_at(match, mesh.vertices)
    assert place[0, 0] == pytest.approx(wall)
    assert match.agrees.all()
    assert match.distance_mm == pytest.approx(np.linalg.norm(place - point))


def test_diffusion_in_a_bar_has_the_variance_of_the_gaussian_and_keeps_the_integral():
    bar = box_mesh((80, 2, 2), (80.0, 2.0, 2.0))
    peak = (np.abs(bar.vertices[:, 0]) < 0.1).astype(float)
    mass = vertex_sizes(bar.vertices, bar.tets)
    smooth = diffuse(bar.vertices, bar.tets, peak, 5.0)
    assert smooth @ mass == pytest.approx(peak @ mass)
    assert (smooth * mass) @ bar.vertices[:, 0] ** 2 / (smooth @ mass) == pytest.approx(
        25.0, rel=0.02
    )


@pytest.mark.parametrize("turn", [0, 17])
def test_a_mask_is_the_inside_even_where_lines_of_voxels_meet_vertices_and_edges(turn):
    ball = transformed(sphere(8.0, 1), rigid(0, 0, turn))
    for mesh in (ball, TriangleMesh(ball.vertices[:, [1, 0, 2]], ball.faces[:, ::-1])):
        # a box 2 mm larger than this, which cuts the ball at all ends but one
        mask, affine = surface_mask(mesh, 0.5, np.array([[-8.0, -5, -3], [4, 5, 3]]))
        places = transform_points(np.argwhere(mask >= 0), affine)
        winding = igl.winding_number(mesh.vertices, mesh.faces, places)
        clear = nearest_on(places, mesh)[0] > 1e-6
        np.testing.assert_array_equal(mask.ravel()[clear] > 0, winding[clear] > 0.5)
