"""Maps brought onto a mesh: linear functions come back, in the right place, and foreign
surfaces are refused."""

import numpy as np
import pytest
from facts import Facts
from shapes import FAR, LONG_MM, box_mesh, ellipsoid_mesh, rigid, scaling, sphere

from gyriflow.errors import InputError
from gyriflow.geometry.deformations import transform_points
from gyriflow.geometry.tetrahedra import TetrahedralMesh, boundary_faces
from gyriflow.geometry.triangles import TriangleMesh, merged, transformed
from gyriflow.mesh.maps import (
    move_to_mesh,
    require_within,
    vertex_map_on_mesh,
    volume_map_on_mesh,
)

RADIUS = 20.0
SLOPE = np.array([0.3, -0.7, 0.2])
SHIFT = (4.0, -3.0, 2.0)
SPHERE = sphere(RADIUS, 3)


def linear(points):
    return 5.0 + points @ SLOPE


@pytest.fixture(scope="module")
def ball():
    return ellipsoid_mesh(8, (RADIUS, RADIUS, RADIUS))


def test_a_linear_function_on_a_sphere_comes_back_at_pial_vertices(ball):
    facets, _ = boundary_faces(ball)
    surface = sphere(RADIUS, 4)
    mapped = vertex_map_on_mesh(
        ball.vertices, facets, surface, linear(surface.vertices)
    )
    pial = np.unique(facets)
    # chords of the surface lie up to 0.03 mm inside the sphere
    assert mapped[pial] == pytest.approx(linear(ball.vertices[pial]), abs=0.03)
    assert mapped.shape == (len(ball.vertices),)


def test_values_are_linear_in_a_triangle():
    surface = TriangleMesh([[0, 0, 0], [3, 0, 0], [0, 3, 0]], [[0, 1, 2]])
    mesh = TetrahedralMesh(
        [[1, 1, 0], [0.5, 0.25, 0], [2, 0.75, 1], [4, 0, 0]], [[0, 1, 2, 3]]
    )
    mapped = vertex_map_on_mesh(
        mesh.vertices, mesh.tets[:, :3], surface, np.array([10.0, 40.0, 70.0])
    )
    # the last vertex is no pial one: (2, 0.75, 1) is the nearest
    assert mapped == pytest.approx([40.0, 20.0, 45.0, 45.0])


def test_inner_vertices_take_the_value_of_the_nearest_pial_vertex(ball):
    facets, _ = boundary_faces(ball)
    pial = np.unique(facets)
    inner = np.setdiff1d(np.arange(len(ball.vertices)), pial)
    surface = SPHERE
    mapped = vertex_map_on_mesh(ball.vertices, facets, surface, surface.vertices[:, 2])
    for vertex in inner:
        gaps = np.linalg.norm(ball.vertices[pial] - ball.vertices[vertex], axis=1)
        nearest = gaps <= gaps.min() * (1 + 1e-9)
        assert mapped[vertex] in mapped[pial[nearest]]


def test_equally_near_pial_vertices_are_chosen_by_coordinates_not_by_order():
    # nine vertices, of which the middle one is as near to all corners
    mesh = box_mesh((2, 2, 2), (2.0, 2.0, 2.0))
    centre = int(np.flatnonzero((mesh.vertices == 0).all(axis=1))[0])
    surface = TriangleMesh(mesh.vertices, boundary_faces(mesh)[0])
    shuffled = np.random.default_rng(0).permutation(len(mesh.vertices))
    back = np.argsort(shuffled)
    for vertices, tets in (
        (mesh.vertices, mesh.tets),
        (mesh.vertices[shuffled], back[mesh.tets]),
    ):
        facets, _ = boundary_faces(TetrahedralMesh(vertices, tets))
        mapped = vertex_map_on_mesh(
            vertices, facets, surface, surface.vertices @ [1.0, 10.0, 100.0]
        )
        at = centre if vertices is mesh.vertices else back[centre]
        # of the middles of the six sides the one at the smallest x
        assert mapped[at] == pytest.approx(-1.0)


def test_two_hemispheres_count_as_one_surface():
    left = box_mesh((2, 4, 4), (8.0, 20.0, 20.0))
    right = box_mesh((2, 4, 4), (8.0, 20.0, 20.0))
    vertices = np.concatenate([left.vertices - [6, 0, 0], right.vertices + [6, 0, 0]])
    mesh = TetrahedralMesh(
        vertices, np.concatenate([left.tets, right.tets + len(left.vertices)])
    )
    facets, _ = boundary_faces(mesh)
    sides = [
        TriangleMesh(side.vertices + shift, boundary_faces(side)[0])
        for side, shift in ((left, [-6, 0, 0]), (right, [6, 0, 0]))
    ]
    values = [
        np.full(len(side.vertices), value)
        for side, value in zip(sides, (1.0, 2.0), strict=True)
    ]
    mapped = vertex_map_on_mesh(
        vertices, facets, merged(*sides), np.concatenate(values)
    )
    assert (mapped == np.where(vertices[:, 0] < 0, 1.0, 2.0)).all()


@pytest.mark.parametrize(
    ("surface", "found"),
    [
        (transformed(SPHERE, rigid(shift=(30.0, 0, 0))), r"28\.\d mm .*16\.\d mm "),
        (
            TriangleMesh(
                SPHERE.vertices,
                SPHERE.faces[SPHERE.vertices[SPHERE.faces][:, :, 0].mean(axis=1) < 0],
            ),
            r"20\.\d mm .*0\.\d mm ",
        ),
        (sphere(100.0, 3), r"79\.\d mm .*79\.\d mm "),
    ],
    ids=["elsewhere", "one hemisphere", "inflated"],
)
def test_a_surface_that_is_not_this_brains_is_refused_with_its_distance(
    ball, surface, found
):
    facets, _ = boundary_faces(ball)
    with pytest.raises(InputError, match=found, check=Facts("a.shape.gii", "5 mm")):
        vertex_map_on_mesh(
            ball.vertices,
            facets,
            surface,
            np.ones(len(surface.vertices)),
            "a.shape.gii",
        )


@pytest.mark.parametrize(("mm", "is_refused"), [(4.8, False), (5.2, True)])
def test_a_surface_of_a_map_may_lie_5_mm_from_the_mesh(ball, mm, is_refused):
    facets, _ = boundary_faces(ball)
    surface = sphere(RADIUS + mm, 3)
    values = linear(surface.vertices)
    if is_refused:
        with pytest.raises(InputError, check=Facts("5 mm")):
            vertex_map_on_mesh(ball.vertices, facets, surface, values)
    else:
        vertex_map_on_mesh(ball.vertices, facets, surface, values)


@pytest.mark.parametrize(
    "given_posed", [False, True], ids=["input's coordinates", "posed already"]
)
def test_a_turned_brain_takes_its_map_in_either_coordinates(given_posed):
    matrix = rigid(5, 0, 8, shift=SHIFT)
    brain = ellipsoid_mesh(8, (15.0, 20.0, 12.0))
    facets, _ = boundary_faces(brain)
    surface = TriangleMesh(brain.vertices, facets)
    values = linear(surface.vertices)
    turned = transform_points(brain.vertices, matrix)
    given = transformed(surface, matrix) if given_posed else surface
    there = move_to_mesh(turned[np.unique(facets)], given, matrix)
    assert vertex_map_on_mesh(turned, facets, there, values)[
        np.unique(facets)
    ] == pytest.approx(values[np.unique(facets)])


def test_a_linear_field_comes_back_through_an_oblique_affine(ball):
    shape = (24, 26, 28)
    affine = (
        rigid(20, -30, 40)
        @ scaling((2.0, 2.2, 1.9))
        @ [[1, 0.1, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
    )
    affine[:3, 3] = -affine[:3, :3] @ ((np.array(shape) - 1) / 2)
    index = np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1)
    data = linear(transform_points(index.reshape(-1, 3), affine)).reshape(shape)
    assert volume_map_on_mesh(ball.vertices, data, affine) == pytest.approx(
        linear(ball.vertices)
    )


def test_the_outermost_voxels_are_covered_to_their_rim():
    data = np.arange(4.0)[:, None, None] * np.ones((4, 5, 6))
    affine = FAR[0] @ scaling(LONG_MM)
    corners = np.array([[-0.5, 1, 1], [0.25, 1, 1], [3.5, 4.5, 5.5]])
    assert volume_map_on_mesh(
        transform_points(corners, affine), data, affine
    ) == pytest.approx([0.0, 0.25, 3.0])


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("is_first", [True, False])
def test_a_vertex_outside_a_volume_is_refused_at_each_of_its_ends(axis, is_first):
    data = np.ones((4, 5, 6))
    affine = FAR[0] @ scaling(LONG_MM)
    indices = np.ones((2, 3))
    # 0.7 voxels beyond the rim
    indices[1, axis] = -1.2 if is_first else data.shape[axis] + 0.2
    outside = f"{0.7 * LONG_MM[axis]:.1f} mm"
    with pytest.raises(InputError, check=Facts("a.nii", 1, outside, 2)):
        volume_map_on_mesh(transform_points(indices, affine), data, affine, "a.nii")


@pytest.mark.parametrize("nothing", [np.nan, np.inf])
def test_vertices_without_a_number_are_counted(ball, nothing):
    data, affine = np.ones((50, 50, 50)), scaling(1.0, -24.5)
    # eight voxels, between whose centres lies one vertex
    data[24:26, 24:26, 24:26] = nothing
    with pytest.raises(InputError, check=Facts("a.nii", 1, "NaN")):
        volume_map_on_mesh(ball.vertices, data, affine, "a.nii")


def test_values_that_a_parameter_cannot_have_are_refused_with_their_count():
    bounds = {"gt": 0.0, "le": 10.0}
    require_within(np.array([0.1, 10.0]), bounds, "thickness.shape.gii")
    with pytest.raises(
        InputError, check=Facts("thickness.shape.gii", 2, 3, 0, 1500, "> 0", "≤ 10")
    ):
        require_within(np.array([0.0, 1.5, 1500.0]), bounds, "thickness.shape.gii")
