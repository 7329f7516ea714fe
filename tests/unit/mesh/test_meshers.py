"""The meshers' own processes: what comes back, and what a user is told when they die, hang or are missing."""

import os
import runpy
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from shapes import box_mesh

from gyriflow.errors import MeshError
from gyriflow.geometry.tetrahedra import TetrahedralMesh, boundary_faces, boundary_surface, signed_volumes
from gyriflow.geometry.triangles import TriangleMesh, merged, signed_volume, transformed
from gyriflow.io.files import read_json
from gyriflow.io.surfaces import write_surface
from gyriflow.io.tetmeshes import read_tetrahedral_mesh
from gyriflow.mesh.curving import curve_edges
from gyriflow.mesh.gates import refuse_bad_mesh
from gyriflow.mesh.quality import jacobian_ratios, quality_summary, radius_ratios
from gyriflow.mesh.tetrahedralisation import even_surface, tetrahedralise

SCRIPT = Path(__file__).parents[3] / "workflow" / "scripts" / "tetrahedralise.py"
OUTPUTS = {"mesh": "brain.xdmf", "data": "brain.h5", "surface": "pial.stl", "quality": "quality.json"}
GATES = {
    "min_radius_ratio": 0.02,
    "min_dihedral_deg": 1.0,
    "max_dihedral_deg": 178.0,
    "min_volume_mm3": 1e-6,
    "min_jacobian_ratio": 0.1,
    "max_volume_change": 0.01,
    "max_surface_distance_mm": 0.1,
    "min_gap_kept": 0.95,
}
SIZES = {"surface_edge_mm": 1.5, "core_edge_mm": 3.0, "envelope_mm": 0.1, "time_limit_s": 120}
STAND_INS = {
    "pytetwild": ("pytetwild.py", "tetrahedralize"),
    "tetgen": ("igl/copyleft/tetgen.py", "tetrahedralize"),
}
MESHERS = list(STAND_INS)


def egg():
    """A surface whose edges have no single length, so that remeshing can make any number of faces of it."""
    shape = trimesh.creation.icosphere(subdivisions=4, radius=1.0)
    return TriangleMesh(shape.vertices * [9.0, 8.0, 6.0], shape.faces)


def ball(radius=8.0, subdivisions=3):
    shape = trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius)
    return TriangleMesh(shape.vertices, shape.faces)


@pytest.fixture
def stand_in(tmp_path, monkeypatch):
    """Puts code in the place of a mesher's function, in the mesher's process."""

    def put(mesher, *code):
        file, function = STAND_INS[mesher]
        path = tmp_path / file
        path.parent.mkdir(parents=True, exist_ok=True)
        for folder in path.relative_to(tmp_path).parents[:-1]:
            (tmp_path / folder / "__init__.py").touch()
        body = "\n".join(f"    {line}" for line in code)
        path.write_text(f"import os, signal, time\ndef {function}(*arrays, **settings):\n{body}\n")
        # the mesher's process is given this path
        monkeypatch.syspath_prepend(tmp_path)

    return put


DYING = ("os.write(1, b'99 % of the elements are inverted')", "os.kill(os.getpid(), signal.SIGKILL)")
HANGING = ("os.write(2, b'thinking')", "time.sleep(60)")


@pytest.mark.parametrize("mesher", MESHERS)
def test_a_mesher_that_dies_leaves_its_last_words(stand_in, mesher):
    stand_in(mesher, *DYING)
    with pytest.raises(
        MeshError,
        match=rf"{mesher} failed with exit code -9; found 99 % of the elements are inverted\. .*memory ran out",
    ):
        tetrahedralise(ball(), mesher=mesher, **SIZES)


@pytest.mark.promise(12)
@pytest.mark.parametrize("mesher", MESHERS)
def test_the_folder_of_a_mesher_is_its_users_only(stand_in, mesher):
    stand_in(mesher, "mode = os.stat('.').st_mode & 0o777", "os.write(1, f'mode {mode:o}'.encode())", DYING[1])
    before = os.umask(0)
    try:
        with pytest.raises(MeshError, match="found mode 700"):
            tetrahedralise(ball(), mesher=mesher, **SIZES)
    finally:
        os.umask(before)


@pytest.mark.parametrize("mesher", MESHERS)
def test_a_mesher_that_hangs_is_stopped_and_leaves_its_last_words(stand_in, mesher):
    stand_in(mesher, *HANGING)
    # a process starts in less, on a busy machine too
    with pytest.raises(MeshError, match=rf"{mesher} was stopped after 4 s; found its last words: thinking"):
        tetrahedralise(ball(), mesher=mesher, **(SIZES | {"time_limit_s": 4}))


@pytest.mark.parametrize("mesher", MESHERS)
def test_a_mesher_that_is_not_installed_is_said_so(stand_in, mesher):
    stand_in(mesher, "raise ImportError('cannot find its library')")
    with pytest.raises(MeshError, match=rf"{mesher} is not installed; found cannot find its library\. Install"):
        tetrahedralise(ball(), mesher=mesher, **SIZES)


def mesh_in(folder, mesher, gates=GATES):
    """Runs the workflow's script on a ball; returns the exit code and the files that it wrote for good."""
    write_surface(folder / "pial.surf.gii", ball())
    outputs = {name: str(folder / file) for name, file in OUTPUTS.items()}
    settings = SIZES | {"mesher": mesher, "surface_edge_mm": 2.5, "pial_faces": None}
    job = SimpleNamespace(
        input=[str(folder / "pial.surf.gii")],
        output=SimpleNamespace(**outputs),
        params=SimpleNamespace(settings=settings, gates=gates, refused=str(folder / "refused"), stretched=None),
        log=[str(folder / "log")],
    )
    code = 0
    try:
        runpy.run_path(str(SCRIPT), init_globals={"snakemake": job})
    except SystemExit as end:
        code = end.code
    return code, [name for name, path in outputs.items() if Path(path).exists()]


@pytest.mark.parametrize("mesher", MESHERS)
def test_the_step_of_a_mesher_that_dies_ends_in_three_with_all_that_it_printed_in_the_log(
    stand_in, tmp_path, capsys, mesher
):
    stand_in(mesher, "for i in range(300):", "    os.write(2, b'pass %d of the mesher\\n' % i)", *DYING)
    assert mesh_in(tmp_path, mesher) == (3, [])
    said, log = capsys.readouterr().err, (tmp_path / "log").read_text()
    assert "inverted" in said
    # the message has the last words, the log all of them
    assert "pass 0 of the mesher" not in said
    assert [f"{mesher}: pass {i} of the mesher\n" in log for i in range(300)] == [True] * 300
    assert f"{mesher}: 99 % of the elements are inverted\n" in log


def test_a_mesh_that_is_refused_is_kept_aside_with_its_quality_until_the_next_attempt(tmp_path, capsys):
    refused, coarse = tmp_path / "refused", GATES | {"max_surface_distance_mm": 1.0, "max_volume_change": 0.1}
    assert mesh_in(tmp_path, "tetgen", coarse | {"min_radius_ratio": 0.99}) == (3, [])
    assert f"{refused}/brain.xdmf: the mesh is not good enough" in capsys.readouterr().err
    quality, mesh = read_json(refused / "quality.json"), read_tetrahedral_mesh(refused / "brain.xdmf")
    assert quality["tets"] == len(mesh.tets) == sum(quality["histogram"]["radius_ratio"]["counts"])
    assert quality["min_radius_ratio"] == pytest.approx(radius_ratios(mesh).min())
    assert mesh_in(tmp_path, "tetgen", coarse) == (0, list(OUTPUTS))
    assert not refused.exists()


@pytest.fixture(scope="module")
def even():
    return even_surface(ball(), 1.2, None)


@pytest.fixture(scope="module")
def filled():
    return tetrahedralise(ball(), mesher="tetgen", **(SIZES | {"surface_edge_mm": 1.2}))


def test_tetgen_keeps_the_remeshed_surface_exactly(even, filled):
    own, _ = boundary_surface(filled)
    assert len(own.faces) == len(even.faces)
    np.testing.assert_array_equal(*(np.unique(surface.vertices, axis=0) for surface in (own, even)))
    assert signed_volumes(filled).sum() == pytest.approx(signed_volume(even), rel=1e-12)
    assert (signed_volumes(filled) > 0).all()


def test_a_mesh_of_tetgen_passes_the_gates(filled):
    summary = quality_summary(filled, ball())
    refuse_bad_mesh(filled, summary, **GATES)
    assert summary["median_radius_ratio"] > 0.6


def test_elements_of_tetgen_grow_inwards_up_to_the_core(filled):
    depth = 8 - np.linalg.norm(filled.vertices[filled.tets].mean(axis=1), axis=1)
    volumes = signed_volumes(filled)
    assert np.median(volumes[depth > 4]) > 1.5 * np.median(volumes[depth < 1])
    # the regular element with edges of core_edge_mm; a few that touch the surface can't be divided
    largest = 1.5**3 / (6 * np.sqrt(2))
    fine = tetrahedralise(ball(), mesher="tetgen", **(SIZES | {"surface_edge_mm": 1.2, "core_edge_mm": 1.5}))
    assert np.quantile(signed_volumes(fine), 0.99) <= largest < np.quantile(volumes, 0.7)


@pytest.mark.parametrize("wanted", [1500, 4000])
def test_tetgen_has_about_the_number_of_faces_asked_for(wanted):
    mesh = tetrahedralise(egg(), mesher="tetgen", pial_faces=wanted, **SIZES)
    assert len(boundary_surface(mesh)[0].faces) == pytest.approx(wanted, rel=0.03)


@pytest.mark.slow
def test_pytetwild_has_about_the_number_of_faces_asked_for():
    mesh = tetrahedralise(egg(), mesher="pytetwild", pial_faces=2000, **(SIZES | {"envelope_mm": 0.3}))
    assert len(boundary_surface(mesh)[0].faces) == pytest.approx(2000, rel=0.25)


def test_a_narrow_gap_between_two_parts_stays_open():
    half = ball(4.0, 3)
    apart = transformed(half, [[1, 0, 0, 8.2], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    mesh = tetrahedralise(merged(half, apart), mesher="tetgen", **(SIZES | {"surface_edge_mm": 0.6}))
    left, right = (mesh.vertices[side] for side in (mesh.vertices[:, 0] < 4.1, mesh.vertices[:, 0] > 4.1))
    assert right[:, 0].min() - left[:, 0].max() == pytest.approx(0.2, abs=0.03)
    assert radius_ratios(mesh).min() > 0.02


def test_a_surface_that_cuts_itself_is_refused():
    half = ball(4.0, 2)
    into = transformed(half, [[1, 0, 0, 5], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    with pytest.raises(MeshError, match=r"cuts itself and cannot be kept.*cross others|is not the inside of"):
        tetrahedralise(merged(half, into), mesher="tetgen", **SIZES)


@pytest.mark.parametrize("mesher", ["pytetwild", "tetgen"])
def test_quadratic_elements_follow_the_surface_on_as_many_nodes(mesher):
    surface = ball(8.0, 4)
    meshes = [
        tetrahedralise(surface, mesher=mesher, order=order, **(SIZES | {"surface_edge_mm": 1.2})) for order in (1, 2)
    ]
    linear, bent = (quality_summary(mesh, surface) for mesh in meshes)
    # pytetwild makes more where its surface is strongly curved, as this one is for elements of 2.4 mm
    assert 0.5 < bent["vertices"] / linear["vertices"] < 2.6
    assert bent["tets"] < linear["tets"] / 2
    assert bent["min_jacobian_ratio"] >= 0.3
    assert bent["crossing_faces"] == 0
    assert bent["surface_distance_mm"]["hausdorff99"] < 1.2 * linear["surface_distance_mm"]["hausdorff99"]
    assert abs(bent["volume_change"]) < 0.002


def test_a_node_that_would_fold_its_element_over_stays_back():
    # a flat corner of a box that is to become round: elements with two faces outside cannot follow
    cube = box_mesh((3, 3, 3), (2.0, 2.0, 2.0))
    length = np.linalg.norm(cube.vertices, axis=1, keepdims=True)
    outer = np.unique(boundary_faces(cube)[0])
    vertices = cube.vertices.copy()
    vertices[outer] = 8.0 * vertices[outer] / length[outer]
    vertices[np.setdiff1d(np.arange(len(vertices)), outer)] *= 4.0
    mesh = curve_edges(TetrahedralMesh(vertices, cube.tets), ball(8.0, 4))
    ratios = jacobian_ratios(mesh)
    assert 0 < ratios.min() < 0.5
    assert ratios.max() <= 1.0
