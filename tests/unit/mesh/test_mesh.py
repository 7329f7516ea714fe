"""Sizing, quality and tetrahedralisation."""

import igl
import numpy as np
import pytest
import trimesh
from shapes import box_mesh

from gyriflow.errors import MeshError
from gyriflow.geometry.tetrahedra import TetrahedralMesh, boundary_surface, signed_volumes
from gyriflow.geometry.triangles import TriangleMesh, flipped, mean_edge_length, merged, transformed
from gyriflow.mesh.gates import refuse_bad_mesh
from gyriflow.mesh.quality import dihedral_angles, elements_through, quality_summary, radius_ratios
from gyriflow.mesh.sizing import background_mesh, edge_length_at, edge_length_for, finer
from gyriflow.mesh.tetrahedralisation import tetrahedralise

REGULAR = TetrahedralMesh([[1.0, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1]], [[0, 1, 2, 3]])
GATES = {
    "min_radius_ratio": 0.02,
    "min_dihedral_deg": 1.0,
    "max_dihedral_deg": 178.0,
    "min_volume_mm3": 1e-6,
    "min_jacobian_ratio": 0.1,
    "max_volume_change": 0.02,
    "max_surface_distance_mm": 0.1,
    "min_gap_kept": 0.95,
}
SIZES = {"surface_edge_mm": 1.5, "core_edge_mm": 3.0, "envelope_mm": 0.1, "time_limit_s": 120}


def ball(radius=8.0, subdivisions=3):
    shape = trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius)
    return TriangleMesh(shape.vertices, shape.faces)


def test_the_regular_element_is_best():
    assert radius_ratios(REGULAR)[0] == pytest.approx(1.0, rel=1e-12)
    np.testing.assert_allclose(dihedral_angles(REGULAR), np.degrees(np.arccos(1 / 3)), rtol=1e-12)


def test_the_corner_element_has_its_known_quality():
    corner = TetrahedralMesh([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 1, 2, 3]])
    inscribed, circumscribed = 1 / (3 + np.sqrt(3)), np.sqrt(3) / 2
    assert radius_ratios(corner)[0] == pytest.approx(3 * inscribed / circumscribed, rel=1e-12)
    angles = np.sort(dihedral_angles(corner)[0])
    np.testing.assert_allclose(angles, [np.degrees(np.arccos(1 / np.sqrt(3)))] * 3 + [90] * 3, rtol=1e-12)


def summary_of(mesh):
    return quality_summary(mesh, boundary_surface(mesh)[0])


def test_a_good_mesh_passes_every_gate():
    refuse_bad_mesh(REGULAR, summary_of(REGULAR), **(GATES | {"min_radius_ratio": 0.99, "min_dihedral_deg": 70.0}))


def test_flat_elements_are_refused_with_their_place_and_all_gates_they_fail():
    flat = TetrahedralMesh([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0.3, 0.3, 1e-3]], [[0, 1, 2, 3]])
    with pytest.raises(
        MeshError, match=r"1 of 1 elements with radius ratio to 7\.1\d*e-06 at \[0\.3, 0\.3, 0\.0\].* to 179"
    ) as error:
        refuse_bad_mesh(flat, summary_of(flat), **GATES)
    assert "dihedral angle in degrees at least 1" in str(error.value)


def test_a_surface_that_left_the_given_one_is_refused():
    box = box_mesh((2, 2, 2), (4.0, 4.0, 4.0))
    larger = box_mesh((2, 2, 2), (5.0, 5.0, 5.0))
    summary = quality_summary(box, boundary_surface(larger)[0])
    # the corner of the larger box is √3/2 from the smaller one, its faces 0.5
    assert summary["surface_distance_mm"]["hausdorff"] == pytest.approx(0.5 * np.sqrt(3))
    with pytest.raises(MeshError, match=r"surface 0\.\d+ mm from the one that was filled.*max_surface_distance_mm"):
        refuse_bad_mesh(box, summary, **GATES)
    refuse_bad_mesh(box, summary, **(GATES | {"max_surface_distance_mm": 1.0, "max_volume_change": 0.9}))


def test_a_mesh_that_lost_or_won_volume_is_refused_with_the_share():
    box = box_mesh((2, 2, 2), (4.0, 4.0, 4.0))
    for size, change in ((4.1, r"-7\.1 %"), (3.9, r"\+7\.9 %")):
        summary = quality_summary(box, boundary_surface(box_mesh((2, 2, 2), (size,) * 3))[0])
        message = (
            rf"a volume of 64 mm3, {change} against the surface's; expected at most 2 % \(mesh\.max_volume_change\)"
        )
        with pytest.raises(MeshError, match=message):
            refuse_bad_mesh(box, summary, **GATES)
        refuse_bad_mesh(box, summary, **(GATES | {"max_volume_change": 0.08}))


def test_tiny_elements_are_refused():
    small = TetrahedralMesh(1e-3 * REGULAR.vertices, REGULAR.tets)
    # the regular element in a cube with edges of 2e-3 mm has a third of its volume
    with pytest.raises(
        MeshError, match=r"1 of 1 elements with volume in mm3 to 2\.667e-09 .*; expected .*at least 1e-06"
    ):
        refuse_bad_mesh(small, summary_of(small), **GATES)


def test_a_mesh_that_shuts_the_fissure_is_refused():
    def halves(gap):
        parts = [box_mesh((4, 6, 6), (4.0, 6.0, 6.0)) for _ in range(2)]
        shifts = ([-2 - gap / 2, 0, 0], [2 + gap / 2, 0, 0])
        first = len(parts[0].vertices)
        return TetrahedralMesh(
            np.vstack([part.vertices + shift for part, shift in zip(parts, shifts, strict=True)]),
            np.vstack([parts[0].tets, parts[1].tets + first]),
        )

    shut, surface = halves(0.1), boundary_surface(halves(0.3))[0]
    summary = quality_summary(shut, surface)
    assert summary["gap_kept"] == 0.0
    assert summary["surface_distance_mm"]["hausdorff"] == pytest.approx(0.1)
    with pytest.raises(
        MeshError, match=r"open along 0 % of their walls; expected at least 95 % \(mesh\.min_gap_kept\)"
    ):
        refuse_bad_mesh(shut, summary, **(GATES | {"max_surface_distance_mm": 0.2}))
    refuse_bad_mesh(halves(0.3), quality_summary(halves(0.3), surface), **GATES)


def test_faces_that_cross_are_refused():
    box = box_mesh((2, 2, 2), (4.0, 4.0, 4.0))
    with pytest.raises(MeshError, match="7 faces of its surface that cross others"):
        refuse_bad_mesh(box, summary_of(box) | {"crossing_faces": 7}, **GATES)


def test_elements_through_a_layer_are_its_thickness_over_the_edge_length():
    # each of a cube's six tetrahedra has three edges of the cube, two diagonals of faces and that of the cube
    box = box_mesh((10, 10, 10), (10.0, 10.0, 10.0))
    mean = (3 + 2 * np.sqrt(2) + np.sqrt(3)) / 6
    assert elements_through(box, 3.0) == pytest.approx(3.0 / mean)


def test_the_summary_counts_every_element_once():
    summary = summary_of(box_mesh((3, 3, 3), (3.0, 3.0, 3.0)))
    assert summary["tets"] == 162
    assert summary["volume_mm3"] == pytest.approx(27.0)
    assert all(sum(h["counts"]) == 162 for h in summary["histogram"].values())
    assert summary["crossing_faces"] == 0
    assert summary["surface_distance_mm"]["hausdorff"] == pytest.approx(0.0, abs=1e-9)


def test_edge_lengths_grow_with_depth_and_end_at_that_of_the_core():
    lengths = edge_length_at(np.array([0.0, 2.0, 4.0, 100.0]), 0.8, 2.5, 2.5, 0.5)
    np.testing.assert_allclose(lengths, [0.8, 0.8, 1.8, 2.5])
    np.testing.assert_allclose(edge_length_at(np.array([0.0, 1.0]), 0.4, 2.5, 0.0, 0.6), [0.4, 1.0])


def test_the_edge_length_for_a_number_of_faces_is_that_of_equilateral_triangles():
    icosahedron = trimesh.creation.icosphere(subdivisions=0, radius=1.0)
    surface = TriangleMesh(icosahedron.vertices, icosahedron.faces)
    assert edge_length_for(surface, 20) == pytest.approx(mean_edge_length(surface))
    assert edge_length_for(surface, 80) == pytest.approx(mean_edge_length(surface) / 2)


def test_the_background_covers_the_surface_with_positive_elements():
    grid, lengths = background_mesh(ball(), 1.5, 3.0, 2.5, 0.5)
    assert (signed_volumes(grid) > 0).all()
    assert (grid.vertices.min(axis=0) < -8).all()
    assert (grid.vertices.max(axis=0) > 8).all()
    assert lengths.min() == 1.5


@pytest.fixture(scope="module")
def filled_ball():
    return tetrahedralise(ball(), **SIZES)


def test_a_ball_is_filled_within_the_envelope(filled_ball):
    surface, _ = boundary_surface(filled_ball)
    shape = ball()
    squared = igl.point_mesh_squared_distance(
        surface.vertices.copy(), shape.vertices.copy(), shape.faces.astype(np.int32).copy()
    )[0]
    assert np.sqrt(squared.max()) <= 0.11
    assert (signed_volumes(filled_ball) > 0).all()
    assert mean_edge_length(surface) == pytest.approx(1.5, rel=0.25)


def test_elements_are_coarser_inside(filled_ball):
    centre = np.linalg.norm(filled_ball.vertices[filled_ball.tets].mean(axis=1), axis=1)
    volumes = signed_volumes(filled_ball)
    assert np.median(volumes[centre < 3]) > 2 * np.median(volumes[centre > 7])


def test_two_hemispheres_stay_two():
    halves = merged(ball(4.0, 2), transformed(ball(4.0, 2), [[1, 0, 0, 10], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]))
    mesh = tetrahedralise(halves, **SIZES)
    assert signed_volumes(mesh).sum() == pytest.approx(2 * 4 / 3 * np.pi * 64, rel=0.05)


def test_an_open_or_inverted_surface_is_refused():
    shape = ball(4.0, 2)
    with pytest.raises(MeshError, match="closed and face outwards"):
        tetrahedralise(TriangleMesh(shape.vertices, shape.faces[1:]), **SIZES)
    with pytest.raises(MeshError, match="closed and face outwards"):
        tetrahedralise(flipped(shape), **SIZES)


def test_a_mesh_that_will_be_stretched_is_made_finer_by_as_much():
    settings = {"surface_edge_mm": 0.9, "core_edge_mm": 3.0, "pial_faces": None, "order": 2}
    assert finer(settings, 1.5) == pytest.approx(settings | {"surface_edge_mm": 0.6, "core_edge_mm": 2.0})
    assert finer(settings | {"pial_faces": 1000}, 1.5)["pial_faces"] == 2250
