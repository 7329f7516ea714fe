"""Sizing, quality and tetrahedralisation; what is told when a mesher dies; distances
and widths of gaps."""

import os
from functools import partial

import numpy as np
import pytest
import shapes
from facts import Facts
from scripts import run_script
from shapes import box_mesh, inner_edges_of_the_surface, joined, moved, sphere

from gyriflow.errors import MeshError
from gyriflow.geometry.matching import nearest_on
from gyriflow.geometry.remeshing import remesh
from gyriflow.geometry.tetrahedra import (
    TetrahedralMesh,
    boundary_faces,
    boundary_surface,
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
from gyriflow.mesh.quality import jacobian_ratios, quality_summary, refuse_bad_mesh
from gyriflow.mesh.tetrahedralisation import tetrahedralise

CORNER = TetrahedralMesh([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 1, 2, 3]])
GATES = {
    "min_radius_ratio": 0.02,
    "max_volume_change": 0.02,
    "max_surface_distance_mm": 0.1,
}
SIZES = {"surface_edge_mm": 1.5, "core_edge_mm": 3.0, "time_limit_s": 120}
OUTPUTS = {
    "mesh": "brain.xdmf",
    "data": "brain.h5",
    "surface": "pial.stl",
    "quality": "quality.json",
}
STAND_INS = {"pytetwild": "pytetwild.py", "tetgen": "igl/copyleft/tetgen.py"}
BALL = sphere(8.0, 3)
box = partial(shapes.box, subdivisions=3)
BOX = shapes.box((3.0, 3.0, 3.0))


def summary_of(mesh):
    return quality_summary(mesh, boundary_surface(mesh)[0])


def test_the_corner_element_has_its_known_quality():
    found = summary_of(CORNER)
    inscribed, circumscribed = 1 / (3 + np.sqrt(3)), np.sqrt(3) / 2
    assert found["min_radius_ratio"] == pytest.approx(3 * inscribed / circumscribed)
    angles = found["min_dihedral_deg"], found["max_dihedral_deg"]
    assert angles == pytest.approx((np.degrees(np.arccos(1 / np.sqrt(3))), 90.0))
    # edges of 1, 2 and 3 mm: inradius 1/3, circumradius half the diagonal
    uneven = TetrahedralMesh(CORNER.vertices * [1.0, 2.0, 3.0], CORNER.tets)
    assert radius_ratios(uneven)[0] == pytest.approx(2 / np.sqrt(14), rel=1e-12)


@pytest.mark.parametrize(
    ("change", "facts"),
    [
        ({}, None),
        ({"gap_kept": 0.951}, None),
        ({"gap_kept": 0.949}, ["95 %"]),
        ({"gap_kept": None}, None),
        ({"volume_change": 0.0199}, None),
        ({"volume_change": 0.0201}, ["+2.0 %", "2 %"]),
        ({"volume_change": -0.0201}, ["-2.0 %", "2 %"]),
        ({"surface_distance_mm": {"hausdorff99": 0.099}}, None),
        (
            {"surface_distance_mm": {"hausdorff99": 0.101}},
            ["0.101 mm", "0.1 mm", "mesh.max_surface_distance_mm"],
        ),
        ({"crossing_faces": 2}, ["2 faces"]),
    ],
)
def test_a_mesh_is_good_enough_within_its_gates(change, facts):
    summary = summary_of(CORNER) | change
    if facts is None:
        refuse_bad_mesh(CORNER, summary, **GATES)
    else:
        with pytest.raises(MeshError, check=Facts(*facts)):
            refuse_bad_mesh(CORNER, summary, **GATES)


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


def with_a_bump(flat):
    """Return a surface with the vertex in the middle of its top raised by 1 mm."""
    vertices = np.array(flat.vertices)
    top = np.argmin(np.linalg.norm(vertices - [0, 0, vertices[:, 2].max()], axis=1))
    vertices[top, 2] += 1.0
    return TriangleMesh(vertices, flat.faces)


@pytest.mark.parametrize(
    ("surface", "of_most", "largest"),
    [
        # a third of the area is that far away
        (lambda cube: moved(cube, 0.5, 0.0, 0.0), 0.5, 0.5),
        # all of the mesh lies on the surface, whose second box is up to 17 mm
        # away
        (lambda cube: merged(cube, moved(cube, 17.0)), 17.0, 17.0),
        # a bump is small
        (with_a_bump, 0.0, 1.0),
    ],
    ids=["shifted", "second part", "bump"],
)
def test_the_distance_of_surfaces_counts_both_directions(surface, of_most, largest):
    mesh = box_mesh((16, 16, 16), (10.0, 10.0, 10.0))
    cube = boundary_surface(mesh)[0]
    found = quality_summary(mesh, surface(cube))["surface_distance_mm"]
    assert found["hausdorff99"] == pytest.approx(of_most, abs=0.02)
    assert found["hausdorff"] == pytest.approx(largest)


def gap_of(surface):
    """Return the gap of a surface in the summary of a mesh that fills it."""
    return quality_summary(CORNER, surface)["gap_mm"]["input"]


def two_boxes(gap_mm):
    sides = [box((4.0, 6.0, 6.0), (side * (2 + gap_mm / 2), 0, 0)) for side in (-1, 1)]
    return merged(*sides)


PLATE = box((0.5, 6.0, 6.0))


@pytest.mark.parametrize(
    ("surface", "width_mm", "area_mm2"),
    [
        (two_boxes(0.5), 0.5, 2 * 36.0),
        # walls far apart, and thin tissue, are no gap; a plate inside out is one
        (two_boxes(4.0), None, 0.0),
        (PLATE, None, 0.0),
        (flipped(PLATE), 0.5, 2 * 36.0),
    ],
    ids=["gap", "far apart", "thin tissue", "inside out"],
)
def test_a_gap_has_its_width_and_area(surface, width_mm, area_mm2):
    found = gap_of(surface)
    assert found["percentile1"] == pytest.approx(width_mm, abs=1e-3)
    assert found["median"] == pytest.approx(width_mm, abs=1e-3)
    assert found["area_mm2"] == pytest.approx(area_mm2)


@pytest.mark.parametrize(("degrees", "is_gap"), [(20.0, True), (30.0, False)])
def test_walls_of_a_gap_are_parallel_to_25_degrees(degrees, is_gap):
    wall = box((1.0, 6.0, 6.0))
    turned = transformed(wall, shapes.rigid(0, 0, degrees))
    found = gap_of(merged(wall, moved(turned, 2.6)))
    assert (found["area_mm2"] > 10.0) == is_gap


BRIDGE = box_mesh((1, 6, 2), (0.5, 6.0, 2.0))


# half of the width is the limit: 0.3 of 0.5 mm is open, 0.2 is not, nor are walls that
# overlap
@pytest.mark.parametrize(
    ("left_open", "parts", "kept"),
    [
        (0.7, [], 1.0),
        (0.3, [], 1.0),
        (0.2, [], 0.0),
        (-0.1, [], 0.0),
        # tissue fills the upper third of the gap
        (0.5, [BRIDGE], 2 / 3),
    ],
)
def test_a_gap_is_kept_where_half_of_its_width_is(left_open, parts, kept):
    half = box_mesh((4, 6, 6), (4.0, 6.0, 6.0))
    shift = np.array([2 + left_open / 2, 0, 0])
    bridges = [(part, [0, 0, 2.0]) for part in parts]
    mesh = joined((half, -shift), (half, shift), *bridges)
    found = quality_summary(mesh, two_boxes(0.5))["gap_kept"]
    assert found == pytest.approx(kept, abs=0.05)
    assert quality_summary(mesh, two_boxes(4.0))["gap_kept"] is None


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


def test_a_mesher_that_hangs_is_stopped_and_leaves_its_last_words(stand_in):
    stand_in("pytetwild", "os.write(2, b'thinking')", "time.sleep(600)")
    said = ""
    # on a busy machine its process has not begun when a short time is over
    for limit_s in (1, 20, 100):
        if "thinking" not in said:
            facts = Facts("pytetwild", f"{limit_s} s")
            with pytest.raises(MeshError, check=facts) as caught:
                tetrahedralise(BOX, **(SIZES | {"time_limit_s": limit_s}))
            said = str(caught.value)
    assert "thinking" in said


def test_a_mesher_that_is_not_installed_is_said_so(stand_in):
    stand_in("tetgen", "raise ImportError('cannot find its library')")
    facts = Facts("tetgen", "cannot find its library", "envs/requirements.txt")
    with pytest.raises(MeshError, check=facts):
        tetrahedralise(BOX, mesher="tetgen", **SIZES)


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


def test_the_step_of_a_mesher_that_dies_exits_with_three_and_logs_all_that_it_printed(
    stand_in, tmp_path, capsys
):
    stand_in(
        "pytetwild",
        "for i in range(300):",
        "    os.write(2, b'pass %d of the mesher\\n' % i)",
        "mode = os.stat('.').st_mode & 0o777",
        "os.write(1, f'99 % of the elements are inverted; mode {mode:o}'.encode())",
        "os.kill(os.getpid(), signal.SIGKILL)",
    )
    umask = os.umask(0)
    try:
        assert mesh_in(tmp_path, "pytetwild") == (3, [])
    finally:
        os.umask(umask)
    said, log = capsys.readouterr().err, (tmp_path / "log").read_text()
    # the message has the last words, the log all of them; the mesher's folder is its
    # user's only
    assert "inverted; mode 700" in said
    assert "pass 0 of the mesher" not in said
    printed = [f"pytetwild: pass {i} of the mesher\n" for i in range(300)]
    printed.append("pytetwild: 99 % of the elements are inverted; mode 700\n")
    assert [line for line in printed if line not in log] == []


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


def test_tetgen_keeps_the_remeshed_surface_exactly_and_its_elements_grow_to_the_cores():
    mesh = tetrahedralise(
        BALL,
        mesher="tetgen",
        surface_edge_mm=1.2,
        core_edge_mm=1.5,
    )
    own, even = boundary_surface(mesh)[0], remesh(BALL, 1.2)
    assert len(own.faces) == len(even.faces)
    found, expected = (np.unique(mesh.vertices, axis=0) for mesh in (own, even))
    np.testing.assert_array_equal(found, expected)
    volumes = signed_volumes(mesh)
    assert (volumes > 0).all()
    assert volumes.sum() == pytest.approx(signed_volume(even), rel=1e-12)
    # the regular element with edges of core_edge_mm; a few that touch the surface can't
    # be divided
    largest = 1.5**3 / (6 * np.sqrt(2))
    assert 0.6 * largest < np.quantile(volumes, 0.99) <= largest


def test_tetgen_keeps_a_narrow_gap_between_two_parts_open():
    half = sphere(4.0, 3)
    sizes = SIZES | {"surface_edge_mm": 0.6}
    mesh = tetrahedralise(
        merged(half, moved(half, 8.2)),
        mesher="tetgen",
        **sizes,
    )
    x = mesh.vertices[:, 0]
    assert x[x > 4.1].min() - x[x < 4.1].max() == pytest.approx(0.2, abs=0.03)
    assert radius_ratios(mesh).min() > 0.02


def test_linear_elements_of_pytetwild_have_a_surface_within_the_envelope():
    both = merged(sphere(5.0, 2), moved(sphere(3.0, 2), 9.0))
    mesh = tetrahedralise(both, **SIZES)
    surface = boundary_surface(mesh)[0]
    assert nearest_on(surface.vertices, both)[0].max() <= 0.11
    assert (signed_volumes(mesh) > 0).all()
    assert mean_edge_length(surface) == pytest.approx(1.5, rel=0.25)
    assert quality_summary(mesh, both)["gap_kept"] > 0.95


def test_a_surface_that_cuts_itself_is_refused():
    half = sphere(4.0, 2)
    with pytest.raises(MeshError, match=r"334 mm3 .*518|\d .*1\.50 mm"):
        tetrahedralise(merged(half, moved(half, 5.0)), mesher="tetgen", **SIZES)


@pytest.mark.parametrize(
    ("mesher", "radius_mm", "surface", "max_tets"),
    [
        # two parts 0.4 mm apart; if they were as fine inside as linear elements, they
        # would be 5400
        (
            "pytetwild",
            12.0,
            merged(sphere(12.0, 2), moved(sphere(3.0, 2), 15.4)),
            4000,
        ),
        # with as many nodes TetGen makes 3400 linear ones
        ("tetgen", 8.0, sphere(8.0, 4), 800),
    ],
)
def test_few_quadratic_elements_follow_the_surface(
    mesher, radius_mm, surface, max_tets
):
    sizes = SIZES | {"surface_edge_mm": 1.2}
    mesh = tetrahedralise(surface, mesher=mesher, order=2, **sizes)
    found = quality_summary(mesh, surface)
    assert found["tets"] < max_tets
    assert found["min_jacobian_ratio"] >= 0.3
    assert found["crossing_faces"] == 0
    # hardly further than the linear elements
    assert found["surface_distance_mm"]["hausdorff99"] < 1.2 * 0.045
    assert abs(found["volume_change"]) < 0.002
    if mesher == "pytetwild":
        assert found["gap_kept"] > 0.95
    # nodes have the distance asked for at the surface, and a larger one inside
    straight = TetrahedralMesh(mesh.vertices, mesh.corners)
    assert mean_edge_length(boundary_surface(straight)[0]) == pytest.approx(
        2.4, rel=0.25
    )
    centre = np.linalg.norm(mesh.vertices[mesh.corners].mean(axis=1), axis=1)
    is_outer = (centre > 0.9 * radius_mm) & (centre < radius_mm)
    volumes = signed_volumes(straight)
    inner = np.median(volumes[centre < 0.4 * radius_mm])
    assert inner > 2 * np.median(volumes[is_outer])


def test_no_side_of_a_quadratic_element_joins_two_corners_on_the_surface():
    surface = box((8.0, 6.0, 2.0))
    linear, bent = (
        tetrahedralise(
            surface,
            mesher="tetgen",
            order=order,
            **SIZES | {"surface_edge_mm": 2.0 / order},
        )
        for order in (1, 2)
    )
    # elements of the same size have such sides until these are split
    assert inner_edges_of_the_surface(linear)
    straight = TetrahedralMesh(bent.vertices, bent.corners)
    assert not inner_edges_of_the_surface(straight)


def test_a_node_that_would_fold_its_element_over_stays_back():
    # a flat corner of a box that is to become round: elements with two faces outside
    # cannot follow
    cube = box_mesh((3, 3, 3), (2.0, 2.0, 2.0))
    length = np.linalg.norm(cube.vertices, axis=1, keepdims=True)
    outer = np.unique(boundary_faces(cube)[0])
    vertices = 4.0 * cube.vertices
    vertices[outer] = 8.0 * cube.vertices[outer] / length[outer]
    mesh = curve_edges(TetrahedralMesh(vertices, cube.tets), sphere(8.0, 4))
    ratios = jacobian_ratios(mesh)
    assert 0 < ratios.min() < 0.5
    assert ratios.max() <= 1.0
