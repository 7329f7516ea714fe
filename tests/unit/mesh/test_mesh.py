"""Sizing, quality and tetrahedralisation; what is told when a mesher dies; distances,
crossings, widths of gaps."""

import os
from functools import partial

import numpy as np
import pytest
import shapes
from facts import Facts
from scripts import run_script
from shapes import box_mesh, inner_edges_of_the_surface, moved, sphere

from gyriflow.errors import MeshError
from gyriflow.geometry.matching import crossing_faces, nearest_on
from gyriflow.geometry.tetrahedra import (
    TetrahedralMesh,
    boundary_faces,
    boundary_surface,
    grid,
    radius_ratios,
    signed_volumes,
)
from gyriflow.geometry.triangles import (
    TriangleMesh,
    flipped,
    mean_edge_length,
    merged,
    signed_volume,
    transformed,
)
from gyriflow.io.files import read_json
from gyriflow.io.surfaces import write_surface
from gyriflow.io.tetmeshes import read_tetrahedral_mesh
from gyriflow.mesh.nodes import curve_edges
from gyriflow.mesh.quality import (
    dihedral_angles,
    fidelity,
    gap_kept,
    gap_summary,
    gap_walls,
    jacobian_ratios,
    quality_summary,
    refuse_bad_mesh,
)
from gyriflow.mesh.tetrahedralisation import (
    edge_length_at,
    even_surface,
    tetrahedralise,
)

REGULAR = TetrahedralMesh(
    [[1.0, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1]], [[0, 1, 2, 3]]
)
GATES = {
    "min_radius_ratio": 0.02,
    "max_volume_change": 0.02,
    "max_surface_distance_mm": 0.1,
}
SIZES = {
    "surface_edge_mm": 1.5,
    "core_edge_mm": 3.0,
    "time_limit_s": 120,
}
OUTPUTS = {
    "mesh": "brain.xdmf",
    "data": "brain.h5",
    "surface": "pial.stl",
    "quality": "quality.json",
}
STAND_INS = {"pytetwild": "pytetwild.py", "tetgen": "igl/copyleft/tetgen.py"}
MESHERS = list(STAND_INS)
BALL = sphere(8.0, 3)


def test_the_corner_element_has_its_known_quality():
    corner = TetrahedralMesh(
        [[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 1, 2, 3]]
    )
    inscribed, circumscribed = 1 / (3 + np.sqrt(3)), np.sqrt(3) / 2
    assert radius_ratios(corner)[0] == pytest.approx(
        3 * inscribed / circumscribed, rel=1e-12
    )
    # edges of 1, 2 and 3 mm: inradius 1/3, circumradius half the diagonal
    uneven = TetrahedralMesh(corner.vertices * [1.0, 2.0, 3.0], corner.tets)
    assert radius_ratios(uneven)[0] == pytest.approx(2 / np.sqrt(14), rel=1e-12)
    angles = np.sort(dihedral_angles(corner)[0])
    np.testing.assert_allclose(
        angles, [np.degrees(np.arccos(1 / np.sqrt(3)))] * 3 + [90] * 3, rtol=1e-12
    )


NO_GAP = {"percentile1": None, "median": None, "area_mm2": 0.0}


def summary_of(mesh):
    return quality_summary(mesh, boundary_surface(mesh)[0])


def test_the_quality_of_a_box_of_uneven_cells_is_known():
    mesh = grid(
        [np.array([0.0, 1, 3]), np.array([0.0, 1, 2, 4]), np.array([0.0, 3, 6])]
    )
    larger = boundary_surface(box_mesh((2, 3, 2), (3.0, 4.0, 8.0)))[0]
    found = quality_summary(mesh, moved(larger, 1.5, 2.0, 4.0))
    ratios, angles = radius_ratios(mesh), dihedral_angles(mesh)
    boundary = boundary_surface(mesh)[0]
    expected = {
        "order": 1,
        "tets": 72,
        "vertices": 36,
        "pial_faces": 2 * 2 * (2 * 3 + 3 * 2 + 2 * 2),
        "pial_edge_mm": mean_edge_length(boundary),
        "pial_area_mm2": 2 * (3 * 4 + 4 * 6 + 3 * 6),
        "smallest_pial_face_mm2": 0.5,
        "crossing_faces": 0,
        "gap_kept": None,
        "volume_mm3": 72.0,
        "volume_change": 72.0 / 96.0 - 1.0,
        "min_radius_ratio": ratios.min(),
        "mean_radius_ratio": ratios.mean(),
        "median_radius_ratio": np.median(ratios),
        "min_dihedral_deg": angles.min(),
        "max_dihedral_deg": angles.max(),
        "min_volume_mm3": 0.5,
        "min_jacobian_ratio": 1.0,
    }
    assert found.pop("gap_mm") == {"input": NO_GAP, "mesh": NO_GAP}
    assert found.pop("surface_distance_mm")["hausdorff"] == pytest.approx(2.0)
    assert set(found) == set(expected)
    for name, value in expected.items():
        assert found[name] == pytest.approx(value), name


def test_a_good_mesh_passes_every_gate():
    refuse_bad_mesh(
        REGULAR, summary_of(REGULAR), **(GATES | {"min_radius_ratio": 0.99})
    )


@pytest.mark.parametrize(
    ("change", "facts"),
    [
        ({}, None),
        ({"gap_kept": 0.951}, None),
        ({"gap_kept": 0.949}, ["95 %"]),
        ({"gap_kept": None}, None),
        ({"volume_change": 0.0199}, None),
        ({"volume_change": -0.0201}, ["-2.0 %", "2 %"]),
        ({"surface_distance_mm": {"hausdorff99": 0.099}}, None),
        ({"surface_distance_mm": {"hausdorff99": 0.101}}, ["0.101 mm", "0.1 mm"]),
        ({"crossing_faces": 2}, ["2 faces"]),
    ],
)
def test_a_mesh_is_good_enough_within_its_gates(change, facts):
    summary = summary_of(REGULAR) | change
    if facts is None:
        refuse_bad_mesh(REGULAR, summary, **GATES)
    else:
        with pytest.raises(MeshError, check=Facts(*facts)):
            refuse_bad_mesh(REGULAR, summary, **GATES)


@pytest.mark.parametrize(("degrees", "is_gap"), [(20.0, True), (30.0, False)])
def test_walls_of_a_gap_are_parallel_to_25_degrees(degrees, is_gap):
    wall = box((1.0, 6.0, 6.0))
    turned = transformed(wall, shapes.rigid(0, 0, degrees))
    apart = moved(turned, 2.6)
    found = gap_summary(gap_walls(merged(wall, apart)))
    assert (found["area_mm2"] > 10.0) == is_gap


def test_flat_elements_are_refused_with_their_place_and_all_gates_they_fail():
    flat = TetrahedralMesh(
        [[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0.3, 0.3, 1e-3]], [[0, 1, 2, 3]]
    )
    with pytest.raises(
        MeshError,
        match=r"7\.1\d*e-06",
        check=Facts("1 of 1", "[0.3, 0.3, 0.0] mm", 0.02),
    ):
        refuse_bad_mesh(flat, summary_of(flat), **GATES)


def test_a_surface_that_left_the_given_one_is_refused():
    box = box_mesh((2, 2, 2), (4.0, 4.0, 4.0))
    larger = box_mesh((2, 2, 2), (5.0, 5.0, 5.0))
    summary = quality_summary(box, boundary_surface(larger)[0])
    # the corner of the larger box is √3/2 from the smaller one, its faces 0.5
    assert summary["surface_distance_mm"]["hausdorff"] == pytest.approx(
        0.5 * np.sqrt(3)
    )
    with pytest.raises(
        MeshError,
        match=r"0\.\d+ mm",
        check=Facts("0.1 mm", "mesh.max_surface_distance_mm"),
    ):
        refuse_bad_mesh(box, summary, **GATES)
    refuse_bad_mesh(
        box,
        summary,
        **(GATES | {"max_surface_distance_mm": 1.0, "max_volume_change": 0.9}),
    )


@pytest.mark.parametrize(("size", "change"), [(4.1, "-7.1 %"), (3.9, "+7.9 %")])
def test_a_mesh_that_lost_or_won_volume_is_refused_with_the_share(size, change):
    box = box_mesh((2, 2, 2), (4.0, 4.0, 4.0))
    summary = quality_summary(
        box, boundary_surface(box_mesh((2, 2, 2), (size,) * 3))[0]
    )
    with pytest.raises(MeshError, check=Facts("64 mm3", change, "2 %")):
        refuse_bad_mesh(box, summary, **GATES)
    refuse_bad_mesh(box, summary, **(GATES | {"max_volume_change": 0.08}))


def test_a_mesh_that_closes_the_fissure_is_refused():
    def halves(gap):
        parts = [box_mesh((4, 6, 6), (4.0, 6.0, 6.0)) for _ in range(2)]
        shifts = ([-2 - gap / 2, 0, 0], [2 + gap / 2, 0, 0])
        first = len(parts[0].vertices)
        return TetrahedralMesh(
            np.vstack(
                [
                    part.vertices + shift
                    for part, shift in zip(parts, shifts, strict=True)
                ]
            ),
            np.vstack([parts[0].tets, parts[1].tets + first]),
        )

    shut, surface = halves(0.1), boundary_surface(halves(0.3))[0]
    summary = quality_summary(shut, surface)
    assert summary["gap_kept"] == 0.0
    assert summary["surface_distance_mm"]["hausdorff"] == pytest.approx(0.1)
    with pytest.raises(MeshError, check=Facts("0 %", "95 %")):
        refuse_bad_mesh(shut, summary, **(GATES | {"max_surface_distance_mm": 0.2}))
    refuse_bad_mesh(halves(0.3), quality_summary(halves(0.3), surface), **GATES)


def test_edge_lengths_grow_with_depth_and_end_at_that_of_the_core():
    lengths = edge_length_at(np.array([0.0, 2.0, 4.0, 100.0]), 0.8, 2.5)
    np.testing.assert_allclose(lengths, [0.8, 0.8, 1.8, 2.5])
    # nodes of quadratic elements are as far apart
    np.testing.assert_allclose(
        edge_length_at(np.array([0.0, 2.0, 4.0, 100.0]), 1.6, 5.0, 2), 2 * lengths
    )


def test_a_ball_is_filled_within_the_envelope_by_elements_that_are_coarser_inside():
    mesh = tetrahedralise(BALL, **SIZES)
    surface, volumes = boundary_surface(mesh)[0], signed_volumes(mesh)
    assert nearest_on(surface.vertices, BALL)[0].max() <= 0.11
    assert (volumes > 0).all()
    assert mean_edge_length(surface) == pytest.approx(1.5, rel=0.25)
    centre = np.linalg.norm(mesh.vertices[mesh.tets].mean(axis=1), axis=1)
    assert np.median(volumes[centre < 3]) > 2 * np.median(volumes[centre > 7])


def test_two_hemispheres_stay_two():
    halves = merged(sphere(4.0, 2), moved(sphere(4.0, 2), 9.0))
    mesh = tetrahedralise(halves, **SIZES)
    assert quality_summary(mesh, halves)["gap_kept"] > 0.95
    assert signed_volumes(mesh).sum() == pytest.approx(2 * 4 / 3 * np.pi * 64, rel=0.05)


def test_an_open_or_inverted_surface_is_refused():
    shape = sphere(4.0, 2)
    for wrong in (TriangleMesh(shape.vertices, shape.faces[1:]), flipped(shape)):
        with pytest.raises(MeshError):
            tetrahedralise(wrong, **SIZES)


@pytest.fixture
def stand_in(tmp_path, monkeypatch):
    """Put code in the place of a mesher's function, in the mesher's process."""

    def put(mesher, *code):
        path = tmp_path / STAND_INS[mesher]
        path.parent.mkdir(parents=True, exist_ok=True)
        for folder in path.relative_to(tmp_path).parents[:-1]:
            (tmp_path / folder / "__init__.py").touch()
        body = "\n".join(f"    {line}" for line in code)
        path.write_text(
            "import os, signal, time\n"
            f"def tetrahedralize(*arrays, **settings):\n{body}\n"
        )
        # the mesher's process is given this path
        monkeypatch.syspath_prepend(tmp_path)

    return put


DYING = (
    "os.write(1, b'99 % of the elements are inverted')",
    "os.kill(os.getpid(), signal.SIGKILL)",
)
HANGING = ("os.write(2, b'thinking')", "time.sleep(600)")


def test_the_folder_of_a_mesher_is_its_users_only(stand_in):
    stand_in(
        "tetgen",
        "mode = os.stat('.').st_mode & 0o777",
        "os.write(1, f'mode {mode:o}'.encode())",
        DYING[1],
    )
    before = os.umask(0)
    try:
        with pytest.raises(MeshError, match="mode 700"):
            tetrahedralise(BALL, mesher="tetgen", **SIZES)
    finally:
        os.umask(before)


def test_a_mesher_that_hangs_is_stopped_and_leaves_its_last_words(stand_in):
    mesher = "pytetwild"
    stand_in(mesher, *HANGING)
    said = ""
    # on a busy machine its process has not begun when a short time is over
    for limit_s in (4, 20, 100):
        if "thinking" not in said:
            with pytest.raises(
                MeshError, check=Facts(mesher, f"{limit_s} s")
            ) as caught:
                tetrahedralise(
                    BALL, mesher=mesher, **(SIZES | {"time_limit_s": limit_s})
                )
            said = str(caught.value)
    assert "thinking" in said


def test_a_mesher_that_is_not_installed_is_said_so(stand_in):
    mesher = "tetgen"
    stand_in(mesher, "raise ImportError('cannot find its library')")
    with pytest.raises(
        MeshError,
        check=Facts(mesher, "cannot find its library", "envs/requirements.txt"),
    ):
        tetrahedralise(BALL, mesher=mesher, **SIZES)


def mesh_in(folder, mesher, gates=GATES):
    """Run the workflow's script on a ball; return the exit code and the files that it
    wrote for good."""
    write_surface(folder / "pial.surf.gii", BALL)
    settings = SIZES | {"mesher": mesher, "surface_edge_mm": 2.5}
    params = {"settings": settings, "gates": gates, "refused": str(folder / "refused")}
    code = 0
    try:
        run_script("tetrahedralise.py", folder, {0: "pial.surf.gii"}, OUTPUTS, params)
    except SystemExit as end:
        code = end.code
    return code, [name for name, file in OUTPUTS.items() if (folder / file).exists()]


@pytest.mark.parametrize("mesher", MESHERS)
def test_the_step_of_a_mesher_that_dies_exits_with_three_and_logs_all_that_it_printed(
    stand_in, tmp_path, capsys, mesher
):
    stand_in(
        mesher,
        "for i in range(300):",
        "    os.write(2, b'pass %d of the mesher\\n' % i)",
        *DYING,
    )
    assert mesh_in(tmp_path, mesher) == (3, [])
    said, log = capsys.readouterr().err, (tmp_path / "log").read_text()
    assert "inverted" in said
    # the message has the last words, the log all of them
    assert "pass 0 of the mesher" not in said
    assert [f"{mesher}: pass {i} of the mesher\n" in log for i in range(300)] == [
        True
    ] * 300
    assert f"{mesher}: 99 % of the elements are inverted\n" in log


def test_a_mesh_that_is_refused_is_kept_aside_with_its_quality_until_the_next_attempt(
    tmp_path, capsys
):
    refused = tmp_path / "refused"
    coarse = GATES | {"max_surface_distance_mm": 1.0, "max_volume_change": 0.1}
    strict = {"min_radius_ratio": 0.99, "max_surface_distance_mm": 1e-3}
    assert mesh_in(tmp_path, "tetgen", coarse | strict) == (3, [])
    said, log = capsys.readouterr().err, (tmp_path / "log").read_text()
    assert said == Facts(
        refused / "brain.xdmf", 0.99, "0.001 mm", "mesh.max_surface_distance_mm"
    )
    assert said.removeprefix("gyriflow: ") in log
    quality = read_json(refused / "quality.json")
    mesh = read_tetrahedral_mesh(refused / "brain.xdmf")
    assert quality["tets"] == len(mesh.tets)
    assert quality["min_radius_ratio"] == pytest.approx(radius_ratios(mesh).min())
    assert mesh_in(tmp_path, "tetgen", coarse) == (0, list(OUTPUTS))
    assert not refused.exists()


@pytest.fixture(scope="module")
def filled():
    return tetrahedralise(BALL, mesher="tetgen", **(SIZES | {"surface_edge_mm": 1.2}))


def test_tetgen_keeps_the_remeshed_surface_exactly(filled):
    own, even = boundary_surface(filled)[0], even_surface(BALL, 1.2)
    assert len(own.faces) == len(even.faces)
    np.testing.assert_array_equal(
        *(np.unique(surface.vertices, axis=0) for surface in (own, even))
    )
    assert signed_volumes(filled).sum() == pytest.approx(signed_volume(even), rel=1e-12)
    assert (signed_volumes(filled) > 0).all()


def test_elements_of_tetgen_grow_inwards_up_to_the_core(filled):
    depth = 8 - np.linalg.norm(filled.vertices[filled.tets].mean(axis=1), axis=1)
    volumes = signed_volumes(filled)
    assert np.median(volumes[depth > 4]) > 1.5 * np.median(volumes[depth < 1])
    # the regular element with edges of core_edge_mm; a few that touch the surface can't
    # be divided
    largest = 1.5**3 / (6 * np.sqrt(2))
    fine = tetrahedralise(
        BALL, mesher="tetgen", **(SIZES | {"surface_edge_mm": 1.2, "core_edge_mm": 1.5})
    )
    assert (
        np.quantile(signed_volumes(fine), 0.99) <= largest < np.quantile(volumes, 0.7)
    )


def test_a_narrow_gap_between_two_parts_stays_open():
    half = sphere(4.0, 3)
    apart = moved(half, 8.2)
    mesh = tetrahedralise(
        merged(half, apart), mesher="tetgen", **(SIZES | {"surface_edge_mm": 0.6})
    )
    left, right = (
        mesh.vertices[side]
        for side in (mesh.vertices[:, 0] < 4.1, mesh.vertices[:, 0] > 4.1)
    )
    assert right[:, 0].min() - left[:, 0].max() == pytest.approx(0.2, abs=0.03)
    assert radius_ratios(mesh).min() > 0.02


def test_a_surface_that_cuts_itself_is_refused():
    half = sphere(4.0, 2)
    into = moved(half, 5.0)
    with pytest.raises(MeshError, match=r"335 mm3 .*518|\d .*1\.50 mm"):
        tetrahedralise(merged(half, into), mesher="tetgen", **SIZES)


@pytest.mark.parametrize("mesher", ["pytetwild", "tetgen"])
def test_quadratic_elements_follow_the_surface_on_as_many_nodes(mesher):
    surface = sphere(8.0, 4)
    meshes = [
        tetrahedralise(
            surface, mesher=mesher, order=order, **(SIZES | {"surface_edge_mm": 1.2})
        )
        for order in (1, 2)
    ]
    linear, bent = (quality_summary(mesh, surface) for mesh in meshes)
    # pytetwild makes more where its surface is strongly curved, as this one is for
    # elements of 2.4 mm
    assert 0.5 < bent["vertices"] / linear["vertices"] < 2.6
    assert bent["tets"] < linear["tets"] / 2
    assert bent["min_jacobian_ratio"] >= 0.3
    assert bent["crossing_faces"] == 0
    assert (
        bent["surface_distance_mm"]["hausdorff99"]
        < 1.2 * linear["surface_distance_mm"]["hausdorff99"]
    )
    assert abs(bent["volume_change"]) < 0.002


def test_no_side_of_a_quadratic_element_joins_two_corners_on_the_surface():
    surface = box((8.0, 6.0, 2.0))
    linear, bent = (
        tetrahedralise(
            surface,
            mesher="tetgen",
            order=order,
            **(SIZES | {"surface_edge_mm": 2.0 / order}),
        )
        for order in (1, 2)
    )
    # elements of the same size have such sides until these are split
    assert inner_edges_of_the_surface(linear)
    corners = TetrahedralMesh(bent.vertices, bent.corners)
    assert not inner_edges_of_the_surface(corners)


def test_a_node_that_would_fold_its_element_over_stays_back():
    # a flat corner of a box that is to become round: elements with two faces outside
    # cannot follow
    cube = box_mesh((3, 3, 3), (2.0, 2.0, 2.0))
    length = np.linalg.norm(cube.vertices, axis=1, keepdims=True)
    outer = np.unique(boundary_faces(cube)[0])
    vertices = cube.vertices.copy()
    vertices[outer] = 8.0 * vertices[outer] / length[outer]
    vertices[np.setdiff1d(np.arange(len(vertices)), outer)] *= 4.0
    mesh = curve_edges(TetrahedralMesh(vertices, cube.tets), sphere(8.0, 4))
    ratios = jacobian_ratios(mesh)
    assert 0 < ratios.min() < 0.5
    assert ratios.max() <= 1.0


box = partial(shapes.box, subdivisions=3)


def pair(gap):
    return merged(
        box((4.0, 6.0, 6.0), (-2 - gap / 2, 0, 0)),
        box((4.0, 6.0, 6.0), (2 + gap / 2, 0, 0)),
    )


def test_concentric_spheres_are_as_far_apart_as_their_radii():
    distance = fidelity(sphere(10.0), sphere(10.5))
    assert distance["hausdorff99"] == pytest.approx(0.5, abs=0.01)
    assert distance["hausdorff"] == pytest.approx(0.5, abs=0.01)


def test_the_distance_within_which_most_lies_is_no_mean():
    # a ball shifted by 0.5 mm: distances are evenly distributed from 0 to 0.5
    distance = fidelity(sphere(10.0, 5), moved(sphere(10.0, 5), 0.5))
    assert distance["hausdorff99"] == pytest.approx(0.495, abs=0.01)
    assert distance["hausdorff"] == pytest.approx(0.5, abs=0.01)


def test_both_directions_count():
    small = box((4.0, 4.0, 4.0))
    both = merged(small, box((4.0, 4.0, 4.0), (7.0, 0.0, 0.0)))
    # all of the small one lies on the other surface, whose second box is up to 7 mm
    # from it
    forth, back = fidelity(small, both), fidelity(both, small)
    assert forth == back
    assert forth["hausdorff"] == pytest.approx(7.0)


def test_a_small_bump_counts_in_the_largest_distance_only():
    flat = box((10.0, 10.0, 10.0), subdivisions=4)
    vertices = np.array(flat.vertices)
    top = np.argmin(np.linalg.norm(vertices - [0, 0, 5], axis=1))
    vertices[top, 2] += 1.0
    distance = fidelity(TriangleMesh(vertices, flat.faces), flat)
    assert distance["hausdorff99"] < 1e-3
    assert distance["hausdorff"] == pytest.approx(1.0)


def test_faces_that_cross_are_counted_once_each():
    tetrahedron = TriangleMesh(
        [[0.0, 0, 0], [4, 0, 0], [0, 4, 0], [0, 0, 4]],
        [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
    )
    assert crossing_faces(tetrahedron) == 0
    assert crossing_faces(merged(tetrahedron, moved(tetrahedron, 10.0))) == 0
    # the tip of the second one, at (1, 1, 1.9), goes in through the slanted face of the
    # first: that face and three more
    pointed = TriangleMesh(
        [[1.0, 1, 1.9], [5, 5, 6], [6, 5, 5], [5, 6, 5]],
        [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]],
    )
    assert crossing_faces(merged(tetrahedron, pointed)) == 4


def test_the_gap_between_two_boxes_has_its_width_and_area():
    found = gap_summary(gap_walls(pair(0.5)))
    assert found["percentile1"] == pytest.approx(0.5, abs=1e-3)
    assert found["median"] == pytest.approx(0.5, abs=1e-3)
    assert found["area_mm2"] == pytest.approx(2 * 36.0)


def test_walls_far_apart_or_thin_tissue_are_no_gap():
    assert gap_summary(gap_walls(pair(4.0))) == NO_GAP
    assert gap_kept(gap_walls(pair(4.0)), pair(0.1)) is None
    plate = box((0.5, 6.0, 6.0))
    assert gap_summary(gap_walls(plate))["area_mm2"] == 0.0
    # inside out, the same plate is a gap
    assert gap_summary(gap_walls(flipped(plate)))["median"] == pytest.approx(
        0.5, abs=1e-3
    )


# half of the width is the limit: 0.3 of 0.5 mm is open, 0.2 is not, nor are walls that
# overlap
@pytest.mark.parametrize(
    ("left_open", "kept"), [(0.5, 1.0), (0.7, 1.0), (0.3, 1.0), (0.2, 0.0), (-0.1, 0.0)]
)
def test_a_gap_is_kept_where_half_of_its_width_is(left_open, kept):
    assert gap_kept(gap_walls(pair(0.5)), pair(left_open)) == kept


def test_the_share_of_a_gap_that_is_bridged_is_not_kept():
    # tissue fills the upper third of the gap
    bridged = merged(pair(0.5), box((0.5, 6.0, 2.0), (0, 0, 2.0)))
    assert gap_kept(gap_walls(pair(0.5)), bridged) == pytest.approx(2 / 3, abs=0.05)
