"""Broken surfaces and meshers that fail, in the real program: mended and reported, or refused with nothing left."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from shapes import HALF_AXES, ellipsoid_mesh, hemisphere, save_gifti

from gyriflow.geometry.tetrahedra import TetrahedralMesh
from gyriflow.geometry.triangles import TriangleMesh, euler_number, flipped, is_closed, merged, signed_volume
from gyriflow.io.files import read_json, write_json
from gyriflow.io.surfaces import read_surface
from gyriflow.io.tetmeshes import write_tetrahedral_mesh
from gyriflow.surface.extraction import isosurface, smoothed_mask
from gyriflow.surface.remeshing import self_intersecting_faces
from gyriflow.surface.repair import pieces

from .conftest import Workflow

VOLUME_ML = 4 / 3 * np.pi * HALF_AXES.prod() / 1e3
BALL = trimesh.creation.icosphere(subdivisions=4)
LEFT, RIGHT = hemisphere(-1), hemisphere(1)


def without(mesh, faces):
    return TriangleMesh(mesh.vertices, mesh.faces[~faces])


def with_more(mesh, vertices, faces):
    return TriangleMesh(np.vstack([mesh.vertices, vertices]), np.vstack([mesh.faces, faces]))


def holed():
    """Returns the left hemisphere without the faces of its leftmost vertex."""
    return without(LEFT, (LEFT.faces == LEFT.vertices[:, 0].argmin()).any(axis=1))


def with_a_fin():
    a, b = RIGHT.faces[0, :2]
    return with_more(RIGHT, RIGHT.vertices[[a]] * 1.02, [[a, b, len(RIGHT.vertices)]])


def with_a_crumb_and_inner_piece():
    crumb = TriangleMesh(BALL.vertices + [-12.5, 40.0, 0.0], BALL.faces)
    inner = TriangleMesh(BALL.vertices * 5.0 + [-12.5, 0.0, 0.0], BALL.faces)
    return merged(LEFT, crumb, inner)


def soup():
    """Returns the right hemisphere, inside out, each face with its own vertices, three of them twice and one flat."""
    faces = flipped(RIGHT).faces
    faces = np.vstack([faces, faces[:3]])
    mesh = TriangleMesh(RIGHT.vertices[faces].reshape(-1, 3), np.arange(faces.size).reshape(-1, 3))
    return with_more(mesh, mesh.vertices[:0], [[7, 7, 8]])


def partly_turned():
    faces = LEFT.faces.copy()
    faces[100:300] = faces[100:300, ::-1]
    return TriangleMesh(LEFT.vertices, faces)


def tangled():
    """Returns the right hemisphere with its uppermost vertex pushed through its base."""
    vertices = RIGHT.vertices.copy()
    vertices[vertices[:, 2].argmax(), 2] = -20.0
    return TriangleMesh(vertices, RIGHT.faces)


def pierced(side):
    """Returns a hemisphere through which a tunnel of 4 mm leads from top to bottom."""
    voxel_mm = 1.0
    middle = np.array([14, 27, 19])
    place = (np.stack(np.indices(2 * middle + 1), axis=-1) - middle) * voxel_mm
    mask = ((place / HALF_AXES) ** 2).sum(axis=-1) < 1
    mask &= np.hypot(place[..., 0], place[..., 1]) > 2.0
    affine = np.diag([voxel_mm, voxel_mm, voxel_mm, 1.0])
    affine[:3, 3] = [12.5 * side, 0.0, 0.0] - middle * voxel_mm
    return isosurface(smoothed_mask(mask, 0.7), affine)


# brains that are mended
GOOD = {
    "open": (holed, with_a_fin),
    "messy": (with_a_crumb_and_inner_piece, soup),
    "tangled": (partly_turned, tangled),
    "pierced": (lambda: pierced(-1), lambda: pierced(1)),
}
# brains that are refused
BAD = {
    "gaping": (
        lambda: without(LEFT, LEFT.vertices[LEFT.faces][:, :, 2].max(axis=1) > 10.0),
        lambda: RIGHT,
        "the surface has holes that are too large to close; found 1 of 1 holes, up to 3",
    ),
}
STUDY = {
    "brains": [
        {
            "id": name,
            "week": 21,
            "coordinates": "ras",
            "hemispheres": {"left": f"{name}.l.gii", "right": f"{name}.r.gii"},
        }
        for name in (*GOOD, *BAD)
    ],
    "start": "open",
    "surface": {"edge_length_mm": 3.0, "max_hole_mm": 5.0},
    "mesh": {"surface_edge_mm": 4.0, "core_edge_mm": 10.0, "envelope_mm": 0.3, "max_surface_distance_mm": 1.0},
    "folding": {"end_week": 22},
}
MESH = "results/open/mesh/brain.xdmf"
QUALITY = "results/study/figures/mesh_quality.png"


@pytest.fixture(scope="module")
def study(checkout_copy, tmp_path_factory):
    """One run of the surface stage over broken hemispheres, and the mesh of one that is mended."""
    workflow = Workflow(checkout_copy, tmp_path_factory.mktemp("broken"))
    for name, (left, right, *_) in (GOOD | BAD).items():
        save_gifti(workflow.directory / f"{name}.l.gii", left())
        save_gifti(workflow.directory / f"{name}.r.gii", right())
    targets = [f"results/{name}/surface/pial.surf.gii" for name in (*GOOD, *BAD)]
    config = workflow.write("study.yaml", STUDY)
    outcome = workflow.run(*targets, MESH, QUALITY, "--cores", "2", "--keep-going", "--configfile", config)
    return SimpleNamespace(workflow=workflow, outcome=outcome, results=workflow.directory / "results")


def files_in(folder):
    return [path for path in folder.rglob("*") if path.is_file()]


def repairs(study, name):
    """Returns what the report says of both hemispheres, without what did not occur, and the whole report."""
    report = read_json(study.results / name / "surface" / "surface.json")
    sides = [{key: n for key, n in report[f"repair_{side}"].items() if n} for side in ("left", "right")]
    return *sides, report


def test_the_run_ends_in_3_without_a_traceback(study):
    assert study.outcome.returncode == 3, study.outcome.stderr
    assert "Traceback" not in study.outcome.stderr


@pytest.mark.parametrize("name", GOOD)
def test_a_mended_brain_is_two_closed_outward_spheres_of_its_size(study, name):
    surface = read_surface(study.results / name / "surface" / "pial.surf.gii")
    assert is_closed(surface)
    assert not self_intersecting_faces(surface).any()
    assert [euler_number(piece) for piece in pieces(surface)] == [2, 2]
    for piece in pieces(surface):
        assert signed_volume(piece) / 1e3 == pytest.approx(VOLUME_ML, rel=0.05)


@pytest.mark.parametrize("name", BAD)
def test_a_broken_surface_is_refused_with_a_message_and_nothing_is_left(study, name):
    expected = BAD[name][2]
    assert expected in (study.results / name / "logs" / "pial_surface.log").read_text()
    assert expected in study.outcome.stderr
    assert f"{name}.l.gii, {study.workflow.directory / name}.r.gii: the surface" in study.outcome.stderr
    assert not files_in(study.results / name / "surface")


def test_a_small_hole_and_a_non_manifold_edge_are_mended_and_reported(study):
    left, right, _ = repairs(study, "open")
    assert left.pop("largest_hole_mm") == pytest.approx(3.2, abs=0.1)
    assert left == {"pieces": 1, "holes_closed": 1}
    assert right == {"pieces": 1, "non_manifold_edges_opened": 1}


def test_further_pieces_double_and_flat_faces_are_dropped_and_all_turned_outward(study):
    left, right, _ = repairs(study, "messy")
    # balls with radii of 1 and 5 mm
    assert left.pop("area_dropped_mm2") == pytest.approx(4 * np.pi * (1 + 25), rel=0.01)
    assert left == {"pieces": 1, "pieces_dropped": 2}
    joined = 3 * (len(RIGHT.faces) + 3) - len(RIGHT.vertices)
    assert right == {
        "pieces": 1,
        "pieces_turned_outward": 1,
        "duplicate_vertices_joined": joined,
        "double_faces_removed": 3,
        "degenerate_faces_removed": 1,
    }


def test_faces_that_disagree_or_cut_others_are_counted(study):
    left, right, _ = repairs(study, "tangled")
    assert left == {"pieces": 1, "faces_turned_to_agree": 200}
    # the needle's faces and those of the base around it
    assert 6 < right["faces_that_cut_others"] < 20


def test_a_handle_of_each_hemisphere_is_closed_and_reported(study):
    *_, report = repairs(study, "pierced")
    assert report["euler_number"] == 4
    for side in ("left", "right"):
        assert report[f"remade_{side}"]["tunnels_filled"] == 1
        assert report[f"remade_{side}"]["handles_left"] == 0
    assert sum("made anew through voxels, since it had Euler numbers [0]" in text for text in report["warnings"]) == 2


def test_the_quality_of_the_mesh_is_told_and_drawn(study):
    quality = read_json(study.results / "open" / "mesh" / "quality.json")
    assert quality["volume_mm3"] / 1e3 == pytest.approx(2 * VOLUME_ML, rel=0.05)
    assert {sum(kind["counts"]) for kind in quality["histogram"].values()} == {quality["tets"]}
    assert (study.workflow.directory / QUALITY).stat().st_size > 10_000


def remeshing(study, **settings):
    """Runs the mesh of the study again with other settings and returns the outcome and the log."""
    name = study.workflow.write("changed.yaml", STUDY | {"mesh": STUDY["mesh"] | settings})
    outcome = study.workflow.run(MESH, "--cores", "1", "--configfile", name)
    return outcome, (study.results / "open" / "logs" / "tetrahedralise.log").read_text()


def refused(study, outcome, log, message):
    """Checks that the mesher's failure ended in 3 and left nothing but its message."""
    assert outcome.returncode == 3, outcome.stderr
    assert message in log
    assert message in outcome.stderr
    assert "Traceback" not in outcome.stderr
    assert not files_in(study.results / "open" / "mesh")


def test_a_mesh_below_the_gate_is_refused(study):
    outcome, log = remeshing(study, min_radius_ratio=0.9)
    refused(study, outcome, log, "elements with radius ratio to")
    assert "at least 0.9" in log


FAILURES = {
    "hangs": ("time.sleep(60)", "the mesher pytetwild was stopped after 8 s; found its last words: half of it is done"),
    "dies": ("os.kill(os.getpid(), signal.SIGKILL)", "failed with exit code -9; found half of it is done"),
}


@pytest.mark.parametrize("failure", FAILURES)
def test_a_mesher_that_fails_ends_in_3_with_its_last_words(study, tmp_path, failure):
    end, message = FAILURES[failure]
    (tmp_path / "pytetwild.py").write_text(
        "import os, signal, time\n"
        "def tetrahedralize(*arrays, **settings):\n"
        "    os.write(1, b'half of it is done')\n"
        f"    {end}\n"
    )
    broken = replace(study.workflow, packages=tmp_path)
    outcome, log = remeshing(SimpleNamespace(workflow=broken, results=study.results), time_limit_s=8.0)
    refused(study, outcome, log, message)


FOLDED = {
    "brains": [{"id": "a", "week": 21, "phantom": {}}],
    "start": "a",
    "folding": {"end_week": 21.25, "output_every_gw": 0.25, "thickness_mm": 4.0},
    "runs": {
        # reaches the hemispheres from above
        "floating": {"no_growth": {"shift_z": 0.45, "semi_axes": [0.35, 0.40, 0.30]}},
        # within the fissure
        "drifting": {"no_growth": {"semi_axes": [0.05, 0.05, 0.05]}},
        # one step, in which nothing moves
        "thin": {"thickness_mm": 0.5, "contact": {"kind": "none"}, "growth_rate_per_s": 0, "step_s": 151_200},
    },
}


@pytest.fixture(scope="module")
def meshed(checkout_copy, tmp_path_factory):
    """A study whose mesh counts as made: two hemispheres, and a cerebellum that was left in."""
    workflow = Workflow(checkout_copy, tmp_path_factory.mktemp("meshed"))
    name = workflow.write("study.yaml", FOLDED)
    listed = workflow.run("mesh", "--configfile", name, "--forceall", "--summary").stdout
    for file in [line.split("\t")[0] for line in listed.splitlines()[1:]]:
        (workflow.directory / file).parent.mkdir(parents=True, exist_ok=True)
        (workflow.directory / file).touch()
    results = workflow.directory / "results" / "a"
    write_json(results / "surface" / "surface.json", {"fissure_x_mm": 0.0})
    parts = [
        (ellipsoid_mesh(10, HALF_AXES), [-12.5, 0, 0]),
        (ellipsoid_mesh(10, HALF_AXES), [12.5, 0, 0]),
        (ellipsoid_mesh(8, (12.0, 12.0, 12.0)), [0, -10, -32]),
    ]
    first = np.cumsum([0, *(len(part.vertices) for part, _ in parts)])
    brain = TetrahedralMesh(
        np.vstack([part.vertices + place for part, place in parts]),
        np.vstack([part.tets + start for (part, _), start in zip(parts, first, strict=False)]),
    )
    write_tetrahedral_mesh(results / "mesh" / "brain.xdmf", brain)
    touched = workflow.run("--touch", "--cores", "1", "mesh", "--configfile", name)
    assert touched.returncode == 0, touched.stderr
    return workflow


def test_a_part_that_floats_is_refused_before_the_solve(meshed):
    target = "results/a/folding/floating/summary.json"
    outcome = meshed.run(target, "--cores", "1", "--configfile", "study.yaml")
    assert outcome.returncode == 3, outcome.stderr
    message = "parts of the brain have no clamped facet and would float; found 1 of 3 parts, the largest with 729"
    assert message in outcome.stderr
    assert message in (meshed.directory / "results/a/logs/regions.floating.log").read_text()
    assert {path.name for path in files_in(meshed.directory / "results/a/folding/floating")} == {"params.yaml"}


@pytest.fixture(scope="module")
def folded(meshed):
    """A run that cannot be solved, and one that can."""
    targets = [f"results/a/folding/{run}/summary.json" for run in ("drifting", "thin")]
    return meshed.run(*targets, "--cores", "1", "--keep-going", "--configfile", "study.yaml")


def test_a_brain_that_nothing_clamps_is_refused_before_the_solve(meshed, folded):
    assert folded.returncode == 2, folded.stderr
    message = "no facet is clamped, so the brain would drift"
    assert message in folded.stderr
    assert message in (meshed.directory / "results/a/logs/regions.drifting.log").read_text()
    assert {path.name for path in files_in(meshed.directory / "results/a/folding/drifting")} == {"params.yaml"}


@pytest.mark.usefixtures("folded")
def test_a_cortex_thinner_than_an_element_is_warned_of_with_the_ratio(meshed):
    log = (meshed.directory / "results/a/logs/simulate.thin.log").read_text()
    before, _, _ = log.partition("step    1")
    ratio = read_json(meshed.directory / "results/a/folding/thin/zones.json")["elements_through_cortex"]
    assert 0.1 < ratio < 0.5
    assert f"fewer than two elements through the cortex ({ratio:.2f}): folds may be mesh noise" in before
