import igl
import numpy as np
import pytest
from shapes import FAR, LONG_MM, box, box_mesh, rigid, scaling, sphere, uneven

from gyriflow.geometry.deformations import (
    Deformation,
    MatchedSurfaces,
    between_moved,
    carry,
    transform_points,
    volume_changes,
)
from gyriflow.geometry.diffusion import diffuse, harmonic_continuation, vertex_sizes
from gyriflow.geometry.matching import (
    labels_at,
    layer_labels,
    match_layers,
    match_points,
    match_surface,
    nearest_on,
    surface_mask,
    values_at,
)
from gyriflow.geometry.tetrahedra import boundary_surface
from gyriflow.geometry.triangles import (
    TriangleMesh,
    merged,
    transformed,
    vertex_normals,
)

GRID = scaling(2.0, -30.0)


def bent(amplitude: float) -> Deformation:
    """Return a map with u = (a sin(y/8), 0, 0) before a scaling by 1.1 and a shift."""
    index = np.moveaxis(np.indices((31, 31, 31)), 0, -1).reshape(-1, 3)
    points = transform_points(index, GRID)
    displacement = np.zeros((31, 31, 31, 3))
    displacement[..., 0] = (amplitude * np.sin(points[:, 1] / 8)).reshape(31, 31, 31)
    return Deformation(scaling(1.1, (3.0, -2.0, 1.0)), displacement, GRID)


POINTS = np.random.default_rng(3).uniform(-20, 20, (200, 3))


def test_points_go_through_displacement_and_then_the_matrix():
    expected = 1.1 * (
        POINTS + np.stack([3 * np.sin(POINTS[:, 1] / 8), *np.zeros((2, 200))], axis=1)
    ) + [3, -2, 1]
    assert carry(bent(3.0), POINTS) == pytest.approx(expected, abs=0.03)


def test_a_correspondence_of_moved_brains_says_the_same_of_the_same_places():
    rng = np.random.default_rng(3)
    matrix = rigid(20, 0, 5, shift=(1, 2, 3)) @ np.diag([1.1, 1.2, 1.3, 1.0])
    first = rigid(10, -70, 150, shift=(4.0, 5.0, 6.0))
    second = rigid(80, 20, -30, shift=(-9.0, 0.0, 1.0))
    points = rng.uniform(-6, 6, (50, 3))
    found = Deformation(
        matrix, rng.normal(size=(9, 6, 9, 3)), scaling((2.0, 3.0, 2.0), -8.0)
    )
    moved = between_moved(found, first, second)
    at_second = transform_points(carry(found, points), second)
    assert carry(moved, transform_points(points, first)) == pytest.approx(at_second)
    surface = TriangleMesh(points, np.array([[0, 1, 2], [3, 4, 5]]))
    pair = between_moved(MatchedSurfaces(surface, 2 * points), first, second)
    assert pair.first.vertices == pytest.approx(transform_points(points, first))
    assert pair.second == pytest.approx(transform_points(2 * points, second))


def test_determinant_is_the_growth_of_volume():
    # a shear keeps the volume, the matrix does not
    assert volume_changes(bent(3.0)) == pytest.approx(np.full((31, 31, 31), 1.1**3))
    squeezed = Deformation(np.eye(4), -0.5 * bent(0.0).displacement, GRID)
    assert volume_changes(squeezed) == pytest.approx(np.ones((31, 31, 31)))
    # long voxels of a turned grid, and different growth along x, y and z
    affine = FAR[0] @ scaling(LONG_MM)
    index = np.moveaxis(np.indices((5, 7, 6)), 0, -1)
    points = transform_points(index.reshape(-1, 3), affine).reshape(5, 7, 6, 3)
    growth = np.array([[-1.5, 0.3, 0.0], [0.0, 0.2, -0.1], [0.4, 0.0, 0.5]])
    grown = Deformation(np.eye(4), points @ growth.T, affine)
    expected = np.linalg.det(np.eye(3) + growth)
    assert volume_changes(grown) == pytest.approx(np.full((5, 7, 6), expected))


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


def test_the_tissue_below_tells_the_wall():
    mesh = walls()
    inner = mesh.vertices - 2.0 * vertex_normals(mesh)
    point, normal = np.array([[0.3, 0.0, 0.0]]), np.array([[-1.0, 0.0, 0.0]])
    for wall in (-0.5, 0.5):
        # the tissue of a point lies behind one wall, 0.4 mm lower than the point
        match = match_layers(
            point, normal, np.array([[5.0 * wall, 0.0, -0.4]]), mesh, inner
        )
        assert values_at(match, mesh.vertices)[0, 0] == pytest.approx(wall)
        assert match.agrees.all()
        assert match.distance_mm == pytest.approx(
            np.linalg.norm(values_at(match, mesh.vertices) - point)
        )


def test_values_are_linear_in_faces_and_labels_those_of_the_nearest_corner():
    mesh = sphere()
    directions = mesh.vertices[mesh.faces[:100]].mean(axis=1)
    match = match_points(
        directions, directions / np.linalg.norm(directions, axis=1)[:, None], mesh
    )
    assert values_at(match, mesh.vertices @ [1.0, 2.0, 3.0]) == pytest.approx(
        directions @ [1.0, 2.0, 3.0], abs=1e-6
    )
    exact = match_points(mesh.vertices, vertex_normals(mesh), mesh)
    assert labels_at(exact, np.arange(len(mesh.vertices))).tolist() == list(
        range(len(mesh.vertices))
    )


def test_diffusion_on_a_sphere_damps_a_harmonic_as_the_heat_equation_does():
    ball = uneven(sphere())
    z = ball.vertices[:, 2] / 10
    second = 1.5 * z**2 - 0.5
    smooth = diffuse(
        ball.vertices, ball.faces, np.stack([second, np.ones(len(z))], 1), 4.0
    )
    weighted = second * vertex_sizes(ball.vertices, ball.faces)
    # eigenvalue l(l + 1)/R² = 0.06, time σ²/2 = 8; eight implicit steps instead of the
    # exponential
    assert smooth[:, 0] @ weighted / (second @ weighted) == pytest.approx(
        (1 + 0.06) ** -8, rel=0.01
    )
    assert smooth[:, 1] == pytest.approx(np.ones(len(z)))


def test_diffusion_in_a_bar_has_the_variance_of_the_gaussian_and_keeps_the_integral():
    bar = box_mesh((80, 2, 2), (80.0, 2.0, 2.0))
    peak = (np.abs(bar.vertices[:, 0]) < 0.1).astype(float)
    mass = vertex_sizes(bar.vertices, bar.tets)
    smooth = diffuse(bar.vertices, bar.tets, peak, 5.0)
    assert smooth @ mass == pytest.approx(peak @ mass)
    assert (smooth * mass) @ bar.vertices[:, 0] ** 2 / (smooth @ mass) == pytest.approx(
        25.0, rel=0.02
    )


def test_a_harmonic_continuation_of_a_gradient_is_the_gradient():
    bar = box_mesh((20, 4, 4), (20.0, 4.0, 4.0))
    surface, _ = boundary_surface(bar)
    for vertices, cells in (
        (bar.vertices, bar.tets),
        (surface.vertices, surface.faces),
    ):
        known = np.flatnonzero(np.abs(vertices[:, 0]) > 7.9)
        given = np.stack([3 * vertices[:, 0], np.ones(len(vertices))], axis=1)
        found = harmonic_continuation(vertices, cells, known, tolerance=1e-12)(
            given[known]
        )
        np.testing.assert_allclose(found, given, atol=1e-9)
        np.testing.assert_array_equal(found[known], given[known])


@pytest.mark.parametrize("turn", [0, 17])
def test_a_mask_is_the_inside_even_where_lines_of_voxels_meet_vertices_and_edges(turn):
    ball = transformed(sphere(8.0, 1), rigid(0, 0, turn))
    for mesh in (ball, TriangleMesh(ball.vertices[:, [1, 0, 2]], ball.faces[:, ::-1])):
        mask, affine = surface_mask(mesh, 0.5, np.array([[-8.0, -8, -8], [8, 8, 8]]))
        places = transform_points(np.argwhere(mask >= 0), affine)
        winding = igl.winding_number(mesh.vertices, mesh.faces, places)
        clear = nearest_on(places, mesh)[0] > 1e-6
        np.testing.assert_array_equal(mask.ravel()[clear] > 0, winding[clear] > 0.5)


@pytest.mark.parametrize("low", [0.25, -12.0])
def test_labels_of_a_layer_below_a_surface(low):
    """A ball of 10 mm with a layer of 2 mm above and 4 mm below, in a turned grid that
    holds half of it."""
    ball = sphere(10.0)
    thickness = np.where(ball.vertices[:, 2] > 0, 2.0, 4.0)
    affine = np.array(
        [[0.0, 0.5, 0, low], [-0.5, 0, 0, 12], [0, 0, 0.5, -12], [0, 0, 0, 1]]
    )
    labels = layer_labels(ball, thickness, (49, 24, 49), affine)
    places = transform_points(np.argwhere(labels >= 0), affine)
    radius = np.linalg.norm(places, axis=1).reshape(labels.shape)
    up = places[:, 2].reshape(labels.shape)
    assert np.abs(np.sign(places[:, 0]).sum()) == len(places)
    clear = (np.abs(radius - 10) > 0.3) & (np.abs(up) > 2)
    inner = np.where(up > 0, 8, 6)
    clear &= np.abs(radius - inner) > 0.3
    expected = np.where(radius > 10, 0, np.where(radius > inner, 2, 1))
    np.testing.assert_array_equal(labels[clear], expected[clear])
