"""Surfaces from files: what is broken is repaired and counted, or refused."""

import tracemalloc

import numpy as np
import pytest
from shapes import sphere, torus

from gyriflow.anatomy.repair import clean, make_even, pieces, rebuild, sound_pieces
from gyriflow.errors import MeshError
from gyriflow.geometry.remeshing import remesh, self_intersecting_faces
from gyriflow.geometry.triangles import TriangleMesh, euler_number, flipped, is_closed, merged, signed_volume, submesh

RADIUS = 10.0
VOLUME = 4 / 3 * np.pi * RADIUS**3


def ball(centre=(0.0, 0.0, 0.0), radius=RADIUS):
    return sphere(radius, centre=centre)


@pytest.mark.fault(17)
def test_small_hole_is_closed_and_reported():
    whole = ball()
    near = np.linalg.norm(whole.vertices[whole.faces].mean(axis=1) - [0, 0, RADIUS], axis=1) < 1.2
    mesh, report = clean(submesh(whole, ~near)[0], 3.0)
    assert is_closed(mesh)
    assert report["holes_closed"] == 1
    assert 1.5 < report["largest_hole_mm"] < 3.0
    assert signed_volume(mesh) == pytest.approx(VOLUME, rel=0.01)


@pytest.mark.fault(17)
def test_large_hole_is_refused_with_its_size():
    whole = ball()
    mesh, _ = submesh(whole, whole.vertices[whole.faces][:, :, 2].max(axis=1) < 8.0)
    with pytest.raises(MeshError, match=r"1 of 1 holes, up to 1[12]\.\d mm.*at most 3 mm.*raise surface\.max_hole_mm"):
        clean(mesh, 3.0)
    wide = TriangleMesh(3.0 * mesh.vertices, mesh.faces)
    with pytest.raises(MeshError, match=r"up to 3\d\.\d mm.*Give a closed surface: holes of this size"):
        clean(wide, 20.0)


def test_a_vertex_far_off_the_surface_is_told():
    whole = ball()
    assert sound_pieces(whole, 3.0).warnings == []
    vertices = whole.vertices.copy()
    vertices[7] *= 7.0
    assert "an edge is 60 mm long" in sound_pieces(TriangleMesh(vertices, whole.faces), 3.0).warnings[0]


def test_one_long_face_does_not_fill_the_memory_of_a_rebuilt_surface():
    whole = ball()
    vertices = whole.vertices.copy()
    vertices[7] *= 1.0 + 200.0 / RADIUS
    tracemalloc.start()
    mesh, _ = rebuild(TriangleMesh(vertices, whole.faces), 1.0)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < 500e6
    assert signed_volume(mesh) == pytest.approx(VOLUME, rel=0.1)


@pytest.mark.fault(19)
@pytest.mark.parametrize(
    ("turned", "counts"), [(slice(None), (1, 0)), (slice(100, 300), (0, 200))], ids=["all", "some"]
)
def test_faces_inside_out_are_turned(turned, counts):
    faces = ball().faces.copy()
    faces[turned] = faces[turned, ::-1]
    mesh, report = clean(TriangleMesh(ball().vertices, faces), 3.0)
    assert is_closed(mesh)
    assert signed_volume(mesh) == pytest.approx(signed_volume(ball()))
    assert (report["pieces_turned_outward"], report["faces_turned_to_agree"]) == counts


@pytest.mark.fault(22)
def test_soup_of_separate_triangles_is_joined():
    whole = ball()
    soup = TriangleMesh(whole.vertices[whole.faces].reshape(-1, 3), np.arange(3 * len(whole.faces)).reshape(-1, 3))
    mesh, report = clean(soup, 3.0)
    assert len(mesh.vertices) == len(whole.vertices)
    assert report["duplicate_vertices_joined"] == 3 * len(whole.faces) - len(whole.vertices)
    assert report["faces_that_cut_others"] == 0


@pytest.mark.fault(22)
def test_degenerate_and_double_faces_are_removed():
    whole = ball()
    faces = np.vstack([whole.faces, whole.faces[:5], [[7, 7, 8]]])
    mesh, report = clean(TriangleMesh(whole.vertices, faces), 3.0)
    assert len(mesh.faces) == len(whole.faces)
    assert (report["double_faces_removed"], report["degenerate_faces_removed"]) == (5, 1)


@pytest.mark.fault(18)
def test_non_manifold_fin_is_removed():
    whole = ball()
    vertices = np.vstack([whole.vertices, whole.vertices[whole.faces[0, 0]] * 1.02])
    fin = [[whole.faces[0, 0], whole.faces[0, 1], len(whole.vertices)]]
    mesh, report = clean(TriangleMesh(vertices, np.vstack([whole.faces, fin])), 3.0)
    assert is_closed(mesh)
    assert report["non_manifold_edges_opened"] == 1
    assert signed_volume(mesh) == pytest.approx(VOLUME, rel=0.01)


@pytest.mark.fault(21)
def test_crumbs_and_inner_pieces_are_dropped_hemispheres_kept():
    mesh, report = clean(
        merged(ball((-11, 0, 0)), ball((11, 0, 0), 9.5), ball((0, 30, 0), 1.0), flipped(ball((-11, 0, 0), 7.0))), 3.0
    )
    assert (report["pieces"], report["pieces_dropped"]) == (2, 2)
    assert signed_volume(mesh) == pytest.approx(VOLUME * (1 + 0.95**3), rel=0.01)
    assert all(signed_volume(piece) > 0 for piece in pieces(mesh))


def test_remeshing_gives_the_edge_length_and_keeps_the_volume():
    even, cutting = make_even(ball(), 1.0)
    assert is_closed(even)
    lengths = np.linalg.norm(np.diff(even.vertices[even.faces[:, :2]], axis=1), axis=-1)
    assert lengths.mean() == pytest.approx(1.0, rel=0.1)
    assert signed_volume(even) == pytest.approx(VOLUME, rel=0.01)
    assert cutting == 0


@pytest.mark.fault(20)
def test_overlapping_balls_are_made_one_surface():
    both = merged(ball((-6, 0, 0)), ball((6, 0, 0)))
    crossing = self_intersecting_faces(both).sum()
    assert clean(both, 3.0)[1]["faces_that_cut_others"] == crossing > 0
    one, report = rebuild(both, 0.7)
    assert is_closed(one)
    assert euler_number(one) == 2
    # two balls less the lens that they share: two caps of height 4
    cap = np.pi * 4.0**2 * (3 * RADIUS - 4.0) / 3
    assert signed_volume(one) == pytest.approx(2 * VOLUME - 2 * cap, rel=0.02)
    assert report["handles_left"] == 0


@pytest.mark.fault(21)
def test_handle_of_a_torus_is_closed_when_remade():
    mesh, _ = clean(torus(10.0, 7.5, 60, 40), 3.0)
    assert euler_number(mesh) == 0
    simple, report = rebuild(remesh(mesh, 1.0), 0.8)
    assert euler_number(simple) == 2
    assert report["tunnels_filled"] + report["bridges_cut"] == 1
