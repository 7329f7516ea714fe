"""Surfaces from files: what is broken is repaired and counted, or refused."""

import tracemalloc

import numpy as np
import pytest
from facts import Facts
from shapes import box, moved, scaling, sphere, torus

from gyriflow.anatomy.extraction import isosurface, smooth_mask
from gyriflow.anatomy.repair import (
    clean,
    make_sound,
    pieces,
    sound_pieces,
    surface_of_mask,
)
from gyriflow.errors import MeshError
from gyriflow.geometry.alignment import MIRROR
from gyriflow.geometry.remeshing import (
    in_meshlab,
    pymeshlab,
    remesh,
    self_intersecting_faces,
)
from gyriflow.geometry.triangles import (
    TriangleMesh,
    area,
    corners,
    euler_number,
    flipped,
    is_closed,
    mean_edge_length,
    merged,
    signed_volume,
    submesh,
    transformed,
)

RADIUS = 10.0
VOLUME = 4 / 3 * np.pi * RADIUS**3


def ball(centre=(0.0, 0.0, 0.0), radius=RADIUS):
    return sphere(radius, centre=centre)


WHOLE = ball()


def test_small_hole_is_closed_and_reported_and_a_large_one_refused():
    z = corners(WHOLE)[:, :, 2].max(axis=1)
    mesh, report, _ = clean(submesh(WHOLE, z < 9.95)[0])
    assert is_closed(mesh)
    assert report["holes_closed"] == 1
    assert 1.5 < report["largest_hole_mm"] < 3.0
    assert signed_volume(mesh) == pytest.approx(VOLUME, rel=0.01)
    with pytest.raises(MeshError, match=r"1[12]\.\d mm", check=Facts(1, "3 mm")):
        clean(submesh(WHOLE, z < 8.0)[0])


def with_spike(ball, factor):
    """Return a ball with a vertex so many radii from the middle."""
    vertices = ball.vertices.copy()
    vertices[7] *= factor
    return TriangleMesh(vertices, ball.faces)


@pytest.mark.parametrize(
    ("subdivisions", "factor", "edge"),
    # 10 mm, or ten times the usual edge
    [
        (4, 1.95, []),
        (4, 2.1, [Facts("11 mm")]),
        (1, 5.0, []),
        (1, 9.0, [Facts("82 mm")]),
    ],
)
def test_an_edge_that_is_long_for_the_surface_and_for_a_brain_is_reported(
    subdivisions, factor, edge
):
    found = sound_pieces(with_spike(sphere(RADIUS, subdivisions), factor)).warnings
    assert [text for text in found if "edge" in text] == edge


def test_a_part_on_a_stalk_is_reported_with_its_volume_and_the_stalk_s_area():
    x, y, z = (0.8 * np.indices((50, 50, 70)).T - [20.0, 20.0, 32.0]).T
    mask = x**2 + y**2 + z**2 < 15.0**2
    mask |= (np.hypot(x, y) < 1.4) & (np.abs(z + 12.0) < 12.0)
    mask |= x**2 + y**2 + (z + 24.0) ** 2 < 4.0**2
    mesh = isosurface(smooth_mask(mask, 0.7), scaling(0.8))
    found = sound_pieces(mesh)
    (stalk,) = found.report["stalks"]
    texts = f"{stalk['volume_mm3']:.0f} mm³", f"{stalk['stalk_mm2']:.0f} mm²"
    assert found.warnings == [Facts(*texts)]
    # a ball of 4 mm, and a stalk of 1.4 mm
    assert stalk["volume_mm3"] == pytest.approx(4 / 3 * np.pi * 4.0**3, rel=0.2)
    assert stalk["stalk_mm2"] == pytest.approx(np.pi * 1.4**2, rel=0.6)
    # the other part is what is left, and the cut is closed
    left = signed_volume(mesh) - stalk["volume_mm3"]
    assert signed_volume(found.mesh) == pytest.approx(left, rel=0.02)
    assert euler_number(found.mesh) == 2
    assert len(found.is_cap) == len(found.mesh.faces)


def test_dropped_pieces_are_reported_with_their_share_of_the_area():
    # a ninth and a 900th of the area
    far, farther = ball((0, 40, 0), RADIUS / 3), ball((0, 40, 30), RADIUS / 30)
    found = sound_pieces(merged(far, WHOLE, farther))
    dropped = area(far) + area(farther)
    share = 100 * dropped / (area(WHOLE) + dropped)
    assert found.warnings == [Facts("2 pieces", f"{share:.1f} %")]
    assert found.report["repair"]["area_dropped_mm2"] == pytest.approx(dropped)
    assert area(found.mesh) == pytest.approx(area(WHOLE))
    assert sound_pieces(merged(farther, WHOLE)).warnings == []


COUNT = len(WHOLE.faces)
SOUP = WHOLE.vertices[WHOLE.faces].reshape(-1, 3), np.arange(3 * COUNT).reshape(-1, 3)
FIN = [[*WHOLE.faces[0, :2], len(WHOLE.vertices)]]
WITH_FIN = (
    np.vstack([WHOLE.vertices, WHOLE.vertices[WHOLE.faces[0, 0]] * 1.02]),
    np.vstack([WHOLE.faces, FIN]),
)
TWICE = np.vstack([WHOLE.faces, WHOLE.faces[:5], [[7, 7, 8]]])
SOME_TURNED = WHOLE.faces.copy()
SOME_TURNED[100:300] = SOME_TURNED[100:300, ::-1]


@pytest.mark.parametrize(
    ("vertices", "faces", "counts"),
    [
        (
            WHOLE.vertices,
            WHOLE.faces[:, ::-1],
            {"faces_turned_to_agree": 0, "pieces_turned_outward": 1},
        ),
        (
            WHOLE.vertices,
            SOME_TURNED,
            {"faces_turned_to_agree": 200, "pieces_turned_outward": 0},
        ),
        (
            *SOUP,
            {
                "duplicate_vertices_joined": 3 * COUNT - len(WHOLE.vertices),
                "faces_that_cut_others": 0,
            },
        ),
        (
            WHOLE.vertices,
            TWICE,
            {"double_faces_removed": 5, "degenerate_faces_removed": 1},
        ),
        (*WITH_FIN, {"non_manifold_edges_opened": 1}),
    ],
    ids=["inside out", "some inside out", "separate triangles", "doubles", "a fin"],
)
def test_what_is_wrong_with_triangles_is_repaired_and_counted(vertices, faces, counts):
    mesh, report, _ = clean(TriangleMesh(vertices, faces))
    assert is_closed(mesh)
    assert signed_volume(mesh) == pytest.approx(signed_volume(WHOLE), rel=1e-6)
    assert (len(mesh.vertices), len(mesh.faces)) == (len(WHOLE.vertices), COUNT)
    assert counts.items() <= report.items()


def test_crumbs_and_inner_pieces_are_dropped_hemispheres_kept():
    hemispheres = ball((-11, 0, 0)), ball((11, 0, 0), 9.5)
    crumb, cavity = ball((0, 30, 0), 1.0), flipped(ball((-11, 0, 0), 7.0))
    mesh, report, _ = clean(merged(*hemispheres, crumb, cavity))
    assert (report["pieces"], report["pieces_dropped"]) == (2, 2)
    assert signed_volume(mesh) == pytest.approx(VOLUME * (1 + 0.95**3), rel=0.01)
    assert all(signed_volume(piece) > 0 for piece in pieces(mesh))


BLOCK = box((10.0, 20.0, 16.0), (5.0, 0.0, 0.0), 2)
NEIGHBOURS = {
    "the same triangles": transformed(BLOCK, MIRROR),
    "the same vertices, other triangles": moved(BLOCK, -10.0),
    "half of the wall": moved(BLOCK, -10.0, 10.0),
    "one edge": moved(BLOCK, -10.0, 20.0),
    "one vertex": moved(BLOCK, -10.0, 20.0, 16.0),
}


@pytest.mark.parametrize("shared", NEIGHBOURS)
@pytest.mark.parametrize(
    "kind", ["vertices in common", "one inside out", "all inside out"]
)
def test_closed_pieces_that_share_a_wall_are_separated(shared, kind):
    neighbour = NEIGHBOURS[shared]
    both = merged(BLOCK, flipped(neighbour) if kind == "one inside out" else neighbour)
    if kind == "vertices in common":
        # as readers of STL join them
        vertices, places = np.unique(
            both.vertices.round(9), axis=0, return_inverse=True
        )
        both = TriangleMesh(vertices, places[both.faces])
    mesh, report, _ = clean(flipped(both) if kind == "all inside out" else both)
    assert is_closed(mesh)
    assert [euler_number(piece) for piece in pieces(mesh)] == [2, 2]
    volumes = [signed_volume(piece) for piece in pieces(mesh)]
    assert volumes == pytest.approx([3200.0, 3200.0])
    assert (report["double_faces_removed"], report["holes_closed"]) == (0, 0)


def test_a_surface_with_every_face_in_both_directions_is_one():
    mesh, report, _ = clean(merged(WHOLE, flipped(WHOLE)))
    assert (len(pieces(mesh)), report["double_faces_removed"]) == (1, COUNT)
    assert area(mesh) == pytest.approx(area(WHOLE))


def test_remeshing_gives_the_edge_length_and_keeps_the_volume():
    # after a part of a surface was remeshed, as a cap is
    document = in_meshlab(WHOLE)
    document.meshing_isotropic_explicit_remeshing(
        targetlen=pymeshlab.PureValue(2.0), selectedonly=True
    )
    even = make_sound(WHOLE, 1.0).mesh
    assert mean_edge_length(even) == pytest.approx(1.0, rel=0.1)
    assert signed_volume(even) == pytest.approx(VOLUME, rel=0.01)


def test_overlapping_balls_are_made_one_surface():
    both = merged(ball((-6, 0, 0)), ball((6, 0, 0)))
    crossing = self_intersecting_faces(both).sum()
    assert clean(both)[1]["faces_that_cut_others"] == crossing > 0
    found = make_sound(both, 2.0)
    one = found.mesh
    assert is_closed(one)
    assert euler_number(one) == 2
    # two balls less the lens that they share: two caps of height 4
    cap = np.pi * 4.0**2 * (3 * RADIUS - 4.0) / 3
    assert signed_volume(one) == pytest.approx(2 * VOLUME - 2 * cap, rel=0.02)
    assert found.report["remade"]["handles_left"] == 0


def test_one_long_face_does_not_fill_the_memory_of_a_rebuilt_surface():
    spiked = merged(moved(with_spike(WHOLE, 21.0), -6.0), ball((6, 0, 0)))
    tracemalloc.start()
    found = make_sound(spiked, 2.0)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < 500e6
    assert "remade" in found.report


@pytest.mark.parametrize(("length", "warnings"), [(19, []), (21, [Facts("105 mm³")])])
def test_a_filled_gap_of_a_tenth_of_a_millilitre_is_warned_of(length, warnings):
    # a hole 5 mm wide through a plate, which one layer of voxels closes
    mask = np.pad(np.ones((24, 40, 12), dtype=bool), 4)
    mask[14:19, 14 : 14 + length] = False
    field = mask.astype(np.float32)
    surface = surface_of_mask(field, np.eye(4), float(mask.sum()), 2.0)
    assert surface.report["topology"]["tunnels_filled"] == 1
    assert [text for text in surface.warnings if "handles" in text] == warnings


def test_handle_of_a_torus_is_closed_when_remade():
    mesh, _, _ = clean(torus(10.0, 7.5, 60, 40))
    assert euler_number(mesh) == 0
    found = make_sound(remesh(mesh, 1.0), 1.6)
    assert euler_number(found.mesh) == 2
    remade = found.report["remade"]
    assert remade["tunnels_filled"] + remade["bridges_cut"] == 1


@pytest.mark.parametrize(("lacks", "is_warned"), [(0.03, False), (0.09, True)])
def test_a_volume_that_smoothing_has_changed_much_is_reported_in_percent(
    lacks, is_warned
):
    # a little is restored, more than 5 % is not
    mask = np.linalg.norm(np.indices((30, 30, 30)).T - 14.5, axis=-1) < 10.0
    smooth, affine = smooth_mask(mask), np.eye(4)
    full = signed_volume(surface_of_mask(smooth, affine, mask.sum(), 1.5).mesh)
    found = surface_of_mask(smooth, affine, full / (1 - lacks), 1.5)
    changed = [text for text in found.warnings if "smoothing" in text]
    left = lacks if is_warned else 0.0
    change = found.report["smoothing"]["volume_change"]
    assert change == pytest.approx(-left, abs=2e-3)
    assert changed == [Facts(f"{100 * change:.1f} %")] * is_warned
