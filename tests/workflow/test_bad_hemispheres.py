"""Surfaces of hemispheres: bad ones end with a message in the real program and exit code 2, good ones are posed."""

import numpy as np
import pytest
from reliability import trying
from scipy.spatial.transform import Rotation
from shapes import hemisphere, save_gifti

from gyriflow.geometry.triangles import TriangleMesh, flipped, transformed
from gyriflow.io.files import read_json
from gyriflow.io.surfaces import read_surface, write_surface
from gyriflow.phantom.brain import CENTRE_MM, phantom_labels
from gyriflow.surface.extraction import isosurface, make_simple, smooth_mask

from .conftest import Workflow

pytestmark = pytest.mark.slow

LEFT, RIGHT = hemisphere(-1), hemisphere(1)


def motion(*degrees, shift=(0.0, 0.0, 0.0), size=1.0):
    matrix = np.eye(4)
    matrix[:3, :3] = size * Rotation.from_euler("xyz", degrees or (0, 0, 0), degrees=True).as_matrix()
    matrix[:3, 3] = shift
    return matrix


def without_place(mesh):
    """Returns the surface with three vertices that are nowhere."""
    vertices = mesh.vertices.copy()
    vertices[[3, 5, 8], 1] = np.nan
    return TriangleMesh(vertices, mesh.faces)


def both(matrix):
    return [transformed(side, matrix) for side in (LEFT, RIGHT)]


# pairs of hemispheres in RAS+, what the message names and what it says of it
PAIR = "{0}.left.gii, {0}.right.gii"
BAD = {
    "swapped": (RIGHT, LEFT, PAIR, "the left hemisphere lies to the right of the right one"),
    "unequal": (LEFT, transformed(RIGHT, motion(size=1.06)), PAIR, "the hemispheres are too different in size"),
    # of one size, and where the other one is
    "overlapping": (
        LEFT,
        transformed(RIGHT, motion(shift=(-24.0, 0.0, 0.0))),
        PAIR,
        "the hemispheres overlap too much",
    ),
    "microns": (*both(motion(size=1e3)), PAIR, "the cerebrum's size is not that of week 21"),
    "metres": (*both(motion(size=1e-3)), PAIR, "the cerebrum's size is not that of week 21"),
    "nowhere": (without_place(LEFT), RIGHT, "{0}.left.gii", "has NaN or infinite coordinates; found 3 vertices"),
    "torn": (LEFT, RIGHT, "{0}.right.gii", "cannot be read as GIFTI"),
    "named": (LEFT, RIGHT, "{0}.left.gii", "is of the other hemisphere; found CortexRight"),
}
REFUSED = trying(
    {"swapped": 9, "named": 9, "unequal": 14, "overlapping": 14, "microns": 4, "metres": 4, "nowhere": 13, "torn": 12}
)
GUESSES = {"microns": "The file seems to be in micrometres", "metres": "The file seems to be in metres"}
MATRIX = motion(0, 0, 90, shift=(7.0, 8.0, 9.0))
LPS = np.diag([-1.0, -1.0, 1.0, 1.0])


@pytest.fixture(scope="module")
def study(checkout_copy, tmp_path_factory):
    """One run of the surface stage over bad pairs, one in LPS, and one that a matrix of its files puts in place."""
    workflow = Workflow(checkout_copy, tmp_path_factory.mktemp("pairs"))
    pairs = {name: (left, right, None) for name, (left, right, *_) in BAD.items()}
    pairs |= {"placed": (*both(np.linalg.inv(MATRIX)), MATRIX), "lps": (*both(LPS), None)}
    brains = []
    for name, (left, right, matrix) in pairs.items():
        files = {side: f"{name}.{side}.gii" for side in ("left", "right")}
        for side, surface in (("left", left), ("right", right)):
            save_gifti(workflow.directory / files[side], surface, matrix)
        coordinates = "lps" if name == "lps" else "ras"
        brains.append({"id": name, "week": 21, "coordinates": coordinates, "hemispheres": files})
    write_surface(workflow.directory / "named.left.gii", LEFT, "CortexRight")
    torn = workflow.directory / "torn.right.gii"
    torn.write_bytes(torn.read_bytes()[: torn.stat().st_size // 2])
    config = {"brains": brains, "start": "placed", "surface": {"edge_length_mm": 2.0}, "folding": {"end_week": 23}}
    return workflow.surfaces(config)


def test_the_run_ends_in_2_without_a_traceback(study):
    assert study.outcome.returncode == 2
    assert "Traceback" not in study.outcome.stderr


@pytest.mark.parametrize("name", REFUSED)
def test_bad_hemispheres_are_refused_with_a_message_and_nothing_is_left(study, name):
    *_, files, said = BAD[name]
    expected = f"{files.format(study.directory / name)}: {said}"
    log = (study.results / name / "logs" / "pial_from_hemispheres.log").read_text()
    for text in (expected, GUESSES.get(name, expected)):
        assert text in log
        assert text in study.outcome.stderr
    assert not [path for path in (study.results / name / "surface").rglob("*") if path.is_file()]


@pytest.mark.parametrize("name", trying({"placed": 11, "lps": 10}))
def test_coordinates_that_the_file_or_the_configuration_names_are_honoured(study, name):
    surface = read_surface(study.results / name / "surface" / "pial.surf.gii")
    np.testing.assert_allclose(surface.vertices.min(axis=0), [-23.5, -24.0, -16.0], atol=0.6)
    log = (study.results / name / "logs" / "pial_from_hemispheres.log").read_text()
    applied = "placed.left.gii: the coordinate-system matrix of the file was applied" in log
    assert applied == (name == "placed")


def halves():
    """Returns a phantom's left and right hemisphere, a millimetre apart, with the fissure at x = 0."""
    labels, affine = phantom_labels(24.0, voxel_mm=1.2)
    x = affine[0, 2] * np.arange(labels.shape[2]) + affine[0, 3] - CENTRE_MM[0]
    affine[:3, 3] -= CENTRE_MM
    masks = [np.isin(labels, (1, 2, 5, 6, 8)) & side for side in (x < -0.6, x > 0.6)]
    return [isosurface(make_simple(smooth_mask(mask, 1.0))[0], affine) for mask in masks]


@pytest.mark.fault(9, 10)
def test_hemispheres_in_any_pose_are_posed_and_a_swapped_pair_alone_is_refused(workflow):
    motions = motion(100, 40, -70, shift=(30.0, 0.0, -50.0)), motion(-20, 130, 60, shift=(0.0, 9.0, 0.0))
    for side, half, turn in zip(("left", "right"), halves(), motions, strict=True):
        save_gifti(workflow.directory / f"{side}.gii", flipped(transformed(half, turn)))
    study = {"start": "a", "surface": {"edge_length_mm": 2.0}, "folding": {"end_week": 25}}
    good = {"id": "a", "week": 24, "coordinates": "auto", "hemispheres": {"left": "left.gii", "right": "right.gii"}}
    bad = good | {"id": "b", "hemispheres": {"left": "right.gii", "right": "left.gii"}}
    name = workflow.write("study.yaml", study | {"brains": [good, bad]})
    targets = [f"results/brains/{brain}/surface/pial.surf.gii" for brain in "ab"]
    outcome = workflow.run(*targets, "--cores", "2", "--keep-going", "--configfile", name)
    assert outcome.returncode == 2
    refusal = ", ".join(str(workflow.directory / f"{side}.gii") for side in ("right", "left"))
    refusal += ": the hemispheres seem to be swapped"
    assert refusal in outcome.stderr
    assert refusal in (workflow.directory / "results/study/logs/poses.log").read_text()
    assert not (workflow.directory / targets[1]).exists()
    report = read_json(workflow.directory / "results/brains/a/surface/surface.json")
    assert (report["euler_number"], report["posing"]["together"]) == (4, False)
    for side, turn in zip(("left", "right"), motions, strict=True):
        rest = np.array(report["posing"]["matrices"][side]) @ turn
        assert np.degrees(Rotation.from_matrix(rest[:3, :3]).magnitude()) < 3.0
    # with the poses found first, the brain whose pose is the same as before is left alone
    name = workflow.write("study.yaml", study | {"brains": [good, good | {"id": "b"}]})
    outcome = workflow.run("poses", "--cores", "1", "--configfile", name)
    assert outcome.returncode == 0, outcome.stderr
    assert workflow.jobs(*targets, "--configfile", name) == {"pial_from_hemispheres": 1}
