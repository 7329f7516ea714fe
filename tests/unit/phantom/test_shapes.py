"""Simple shapes: volume and area of the analytic ones, closed, even, sharp and flat where they should be."""

import numpy as np
import pytest

from gyriflow.errors import InputError
from gyriflow.geometry.triangles import (
    area,
    corners,
    edges,
    euler_number,
    face_areas,
    face_normals,
    is_closed,
    mean_edge_length,
    signed_volume,
    unit,
)
from gyriflow.phantom.shapes import shape_surface

AXES = (10.0, 13.0, 8.0)
SIZES = {"sphere": (12.0, 12.0, 12.0), "ellipsoid": AXES, "half-ellipsoid": AXES, "slab": (20.0, 16.0, 6.0)}
VOLUMES = {
    "sphere": 4 / 3 * np.pi * 12**3,
    "ellipsoid": 4 / 3 * np.pi * np.prod(AXES),
    "half-ellipsoid": 2 / 3 * np.pi * np.prod(AXES),
    "slab": 20.0 * 16.0 * 6.0,
}


def ellipsoid_area(a, b, c):
    """Returns the area of an ellipsoid by midpoint quadrature over the unit sphere."""
    z = np.linspace(-1, 1, 4001)[:-1] + 1 / 4000
    turn = np.linspace(0, 2 * np.pi, 1001)[:-1]
    ring = np.sqrt(1 - z**2)[:, None]
    x, y = ring * np.cos(turn), ring * np.sin(turn)
    stretch = a * b * c * np.sqrt((x / a) ** 2 + (y / b) ** 2 + (z[:, None] / c) ** 2)
    return float(stretch.mean() * 4 * np.pi)


AREAS = {
    "sphere": 4 * np.pi * 12**2,
    "ellipsoid": ellipsoid_area(*AXES),
    "half-ellipsoid": 0.5 * ellipsoid_area(*AXES) + np.pi * AXES[0] * AXES[1],
    "slab": 2 * (20.0 * 16.0 + 20.0 * 6.0 + 16.0 * 6.0),
}


def made(kind, edge_mm=1.0, noise_mm=0.0, **others):
    return shape_surface(kind, SIZES[kind], edge_length_mm=edge_mm, noise_mm=noise_mm, **others)


def require_sound(mesh):
    assert is_closed(mesh)
    assert euler_number(mesh) == 2
    assert signed_volume(mesh) > 0


@pytest.mark.parametrize("kind", SIZES)
def test_volume_and_area_are_the_analytic_ones(kind):
    mesh = made(kind)
    require_sound(mesh)
    # vertices on the surface: a little is cut off, of the order of (edge / radius)²
    tolerance = 1e-9 if kind == "slab" else 0.01
    assert signed_volume(mesh) == pytest.approx(VOLUMES[kind], rel=tolerance)
    assert area(mesh) == pytest.approx(AREAS[kind], rel=tolerance)


@pytest.mark.parametrize("kind", ["sphere", "ellipsoid", "half-ellipsoid"])
def test_volume_converges_with_the_square_of_the_edge(kind):
    missing = [1 - signed_volume(made(kind, edge_mm)) / VOLUMES[kind] for edge_mm in (2.0, 1.0)]
    assert missing[0] / missing[1] == pytest.approx(4.0, rel=0.25)


@pytest.mark.parametrize("kind", SIZES)
@pytest.mark.parametrize("edge_mm", [0.8, 1.5])
def test_triangles_are_even_and_of_the_edge_length(kind, edge_mm):
    mesh = made(kind, edge_mm)
    pairs, _ = edges(mesh)
    lengths = np.linalg.norm(np.diff(mesh.vertices[pairs], axis=1), axis=-1)
    assert mean_edge_length(mesh) == pytest.approx(edge_mm, rel=0.1)
    assert lengths.min() > 0.2 * edge_mm
    assert lengths.max() < 2.2 * edge_mm


@pytest.mark.parametrize("kind", ["sphere", "ellipsoid"])
def test_all_vertices_of_a_curved_shape_lie_on_it_and_faces_look_outwards(kind):
    mesh = made(kind)
    size = np.array(SIZES[kind])
    assert np.linalg.norm(mesh.vertices / size, axis=1) == pytest.approx(1.0, abs=1e-12)
    normals = unit(corners(mesh).mean(axis=1) / size**2)
    assert np.einsum("ij,ij->i", normals, face_normals(mesh)).min() > 0.9


@pytest.mark.parametrize("noise_mm", [0.0, 0.1])
def test_half_ellipsoid_has_a_dome_on_a_flat_base(noise_mm):
    mesh = made("half-ellipsoid", noise_mm=noise_mm)
    size = np.array(AXES)
    require_sound(mesh)
    base = (corners(mesh)[:, :, 2] == 0.0).all(axis=1)
    assert mesh.vertices[:, 2].min() == 0.0
    assert face_normals(mesh)[base, 2].max() < -0.999999
    assert face_areas(mesh)[base].sum() == pytest.approx(np.pi * AXES[0] * AXES[1], rel=0.01 + 0.2 * noise_mm)
    dome = np.unique(mesh.faces[~base])
    level = np.linalg.norm(mesh.vertices[dome] / size, axis=1)
    assert level == pytest.approx(1.0, abs=1e-12 + noise_mm)
    # a sharp rim at a right angle: the lowest faces of the dome stand upright
    normals = unit(corners(mesh).mean(axis=1) / size**2)
    assert np.einsum("ij,ij->i", normals, face_normals(mesh))[~base].min() > 0.8


@pytest.mark.parametrize("noise_mm", [0.0, 0.1])
def test_slab_stands_on_z_0_with_sharp_edges_and_bumps_on_its_top_alone(noise_mm):
    mesh = made("slab", noise_mm=noise_mm)
    require_sound(mesh)
    x, y, z = mesh.vertices.T
    assert (x.min(), x.max(), y.min(), y.max(), z.min()) == (-10.0, 10.0, -8.0, 8.0, 0.0)
    for axis, end, wanted in ((0, 10.0, 16.0 * 6.0), (1, 8.0, 20.0 * 6.0)):
        for sign in (-1, 1):
            wall = (corners(mesh)[:, :, axis] == sign * end).all(axis=1)
            assert face_areas(mesh)[wall].sum() == pytest.approx(wanted, rel=1e-9 if noise_mm == 0 else 0.05)
    top = face_normals(mesh)[:, 2] > 0.7
    heights = z[np.unique(mesh.faces[top])]
    assert heights.mean() == pytest.approx(6.0, abs=1e-12 + noise_mm)
    assert heights.std() == pytest.approx(noise_mm, rel=0.5, abs=1e-12)


@pytest.mark.parametrize("kind", SIZES)
def test_shapes_are_centred_on_x_0(kind):
    mesh = made(kind)
    assert abs(mesh.vertices[:, 0].max() + mesh.vertices[:, 0].min()) < 0.05


def test_bumps_have_the_height_asked_for_and_the_pattern_of_their_seed_at_any_edge_length():
    size = (40.0, 40.0, 40.0)

    def heights(edge_mm, seed):
        mesh = shape_surface("sphere", size, edge_length_mm=edge_mm, noise_mm=0.2, seed=seed)
        return np.linalg.norm(mesh.vertices, axis=1) - 40.0, unit(mesh.vertices)

    fine, directions = heights(3.0, 1)
    assert np.sqrt((fine**2).mean()) == pytest.approx(0.2, rel=0.3)
    assert np.array_equal(fine, heights(3.0, 1)[0])
    assert not np.array_equal(fine, heights(3.0, 2)[0])
    coarse, coarse_directions = heights(4.0, 1)
    nearest = (directions @ coarse_directions.T).argmax(axis=1)
    assert np.corrcoef(fine, coarse[nearest])[0, 1] > 0.8


@pytest.mark.parametrize("kind", SIZES)
def test_the_same_settings_give_the_same_surface(kind):
    first, second = (made(kind, 1.5, noise_mm=0.05) for _ in range(2))
    assert np.array_equal(first.vertices, second.vertices)
    assert np.array_equal(first.faces, second.faces)


@pytest.mark.parametrize(("kind", "longest"), [("sphere", 6.0), ("ellipsoid", 64 / 26), ("slab", 1.5)])
def test_edges_too_long_for_the_shape_are_refused_with_the_bound(kind, longest):
    require_sound(made(kind, longest))
    with pytest.raises(InputError, match=rf"at most {longest:.3g} mm"):
        made(kind, 1.01 * longest)
