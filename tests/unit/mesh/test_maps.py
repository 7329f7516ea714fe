"""Maps brought onto a mesh: linear functions come back, in the right place, and foreign
surfaces are refused."""

import numpy as np
import pytest
from facts import Facts
from shapes import (
    FAR,
    LONG_MM,
    box_mesh,
    ellipsoid,
    ellipsoid_mesh,
    moved,
    rigid,
    scaling,
    sphere,
)

from gyriflow.errors import InputError
from gyriflow.geometry.deformations import transform_points
from gyriflow.geometry.tetrahedra import TetrahedralMesh, boundary_faces
from gyriflow.geometry.triangles import TriangleMesh, submesh, transformed
from gyriflow.mesh.maps import (
    move_to_mesh,
    require_within,
    vertex_map_on_mesh,
    volume_map_on_mesh,
)

RADIUS = 20.0
SPHERE = sphere(RADIUS, 3)


@pytest.fixture(scope="module")
def ball():
    return ellipsoid_mesh(8, (RADIUS, RADIUS, RADIUS))


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


def test_equally_near_pial_vertices_are_chosen_by_coordinates_not_by_order():
    # nine vertices, of which the middle one is as near to all corners
    mesh = box_mesh((2, 2, 2), (2.0, 2.0, 2.0))
    centre = int(np.flatnonzero((mesh.vertices == 0).all(axis=1))[0])
    surface = TriangleMesh(mesh.vertices, boundary_faces(mesh)[0])
    values = surface.vertices @ [1.0, 10.0, 100.0]
    count = len(mesh.vertices)
    for order in (np.arange(count), np.random.default_rng(0).permutation(count)):
        new_number = np.argsort(order)
        facets = new_number[boundary_faces(mesh)[0]]
        mapped = vertex_map_on_mesh(mesh.vertices[order], facets, surface, values)
        # of the middles of the six sides the one at the smallest x
        assert mapped[new_number[centre]] == pytest.approx(-1.0)


LEFT_HALF = SPHERE.vertices[SPHERE.faces][:, :, 0].mean(axis=1) < 0


@pytest.mark.parametrize(
    ("surface", "found"),
    [
        (sphere(RADIUS + 4.8, 3), None),
        (sphere(RADIUS + 5.2, 3), r"5\.\d mm .*5\.\d mm "),
        (moved(SPHERE, 30.0), r"28\.\d mm .*16\.\d mm "),
        (submesh(SPHERE, LEFT_HALF)[0], r"20\.\d mm .*0\.\d mm "),
    ],
    ids=["near", "inflated", "elsewhere", "one hemisphere"],
)
def test_a_surface_may_lie_5_mm_from_the_mesh(ball, surface, found):
    facets, _ = boundary_faces(ball)
    values = np.ones(len(surface.vertices))
    if found is None:
        vertex_map_on_mesh(ball.vertices, facets, surface, values)
    else:
        with pytest.raises(InputError, match=found, check=Facts("a.shape.gii", "5 mm")):
            vertex_map_on_mesh(ball.vertices, facets, surface, values, "a.shape.gii")


def test_a_turned_brain_takes_its_map_in_either_coordinates():
    matrix = rigid(5, 0, 8, shift=(4.0, -3.0, 2.0))
    surface = ellipsoid((15.0, 20.0, 12.0), 3)
    posed = transformed(surface, matrix)
    for given in (surface, posed):
        found = move_to_mesh(posed.vertices, given, matrix)
        np.testing.assert_allclose(found.vertices, posed.vertices)


def test_the_outermost_voxels_are_covered_to_their_rim():
    data = np.arange(4.0)[:, None, None] * np.ones((4, 5, 6))
    affine = FAR[0] @ scaling(LONG_MM)
    corners = np.array([[-0.5, 1, 1], [0.25, 1, 1], [3.5, 4.5, 5.5]])
    found = volume_map_on_mesh(transform_points(corners, affine), data, affine)
    assert found == pytest.approx([0.0, 0.25, 3.0])


@pytest.mark.parametrize(("axis", "is_first"), [(0, True), (2, False)])
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
