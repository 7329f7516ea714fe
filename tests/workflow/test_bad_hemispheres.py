"""Surfaces of hemispheres: bad ones end with a message in the real program and exit code 2, good ones are posed."""

import numpy as np
import pytest
from reliability import trying
from shapes import hemisphere, moved, phantom_halves, rigid, save_gifti

from gyriflow.geometry.alignment import angle_deg
from gyriflow.geometry.triangles import flipped, transformed
from gyriflow.io.files import read_json
from gyriflow.io.surfaces import read_surface

from .conftest import Workflow

pytestmark = pytest.mark.slow

LEFT, RIGHT = hemisphere(-1), hemisphere(1)


# pairs of hemispheres in RAS+, what the message names and what it says of it
PAIR = "{0}.left.gii, {0}.right.gii"
BAD = {
    "swapped": (RIGHT, LEFT, PAIR, "the left hemisphere lies to the right of the right one"),
    # of one size, and where the other one is
    "overlapping": (LEFT, moved(RIGHT, -24.0), PAIR, "the hemispheres overlap too much"),
    "torn": (LEFT, RIGHT, "{0}.right.gii", "cannot be read as GIFTI"),
}
REFUSED = trying({"swapped": 9, "overlapping": 14, "torn": 12})
MATRIX = rigid(0, 0, 90, shift=(7.0, 8.0, 9.0))


@pytest.fixture(scope="module")
def study(checkout_copy, tmp_path_factory):
    """One run of the surface stage over bad pairs, and one that a matrix of its files puts in place."""
    workflow = Workflow(checkout_copy, tmp_path_factory.mktemp("pairs"))
    pairs = {name: (left, right, None) for name, (left, right, *_) in BAD.items()}
    pairs["placed"] = (*(transformed(side, np.linalg.inv(MATRIX)) for side in (LEFT, RIGHT)), MATRIX)
    brains = []
    for name, (left, right, matrix) in pairs.items():
        files = {side: f"{name}.{side}.gii" for side in ("left", "right")}
        for side, surface in (("left", left), ("right", right)):
            save_gifti(workflow.directory / files[side], surface, matrix)
        brains.append({"id": name, "week": 21, "coordinates": "ras", "hemispheres": files})
    torn = workflow.directory / "torn.right.gii"
    torn.write_bytes(torn.read_bytes()[: torn.stat().st_size // 2])
    config = {"brains": brains, "start": "placed", "surface": {"edge_length_mm": 2.0}, "folding": {"end_week": 23}}
    return workflow.surfaces(config, "surface")


def test_the_run_ends_in_2_without_a_traceback(study):
    study.require_exit_code(2)


@pytest.mark.parametrize("name", REFUSED)
def test_bad_hemispheres_are_refused_with_a_message_and_nothing_is_left(study, name):
    *_, files, said = BAD[name]
    study.require_refused(name, f"{files.format(study.directory / name)}: {said}")


@pytest.mark.fault(11)
def test_coordinates_that_the_file_names_are_honoured(study):
    surface = read_surface(study.results / "placed" / "surface" / "pial.surf.gii")
    np.testing.assert_allclose(surface.vertices.min(axis=0), [-23.5, -24.0, -16.0], atol=0.6)
    assert "placed.left.gii: the coordinate-system matrix of the file was applied" in study.log("placed")


@pytest.mark.fault(9, 10)
def test_hemispheres_in_any_pose_are_posed_and_a_swapped_pair_alone_is_refused(workflow):
    motions = rigid(100, 40, -70, shift=(30.0, 0.0, -50.0)), rigid(-20, 130, 60, shift=(0.0, 9.0, 0.0))
    for side, half, turn in zip(("left", "right"), phantom_halves(), motions, strict=True):
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
    assert (report["euler_number"], report["pose"]["together"]) == (4, False)
    for side, turn in zip(("left", "right"), motions, strict=True):
        assert angle_deg((np.array(report["pose"]["files"][side]) @ turn)[:3, :3]) < 3.0
    # with the poses found first, the brain whose pose is the same as before is left alone
    name = workflow.write("study.yaml", study | {"brains": [good, good | {"id": "b"}]})
    outcome = workflow.run("poses", "--cores", "1", "--configfile", name)
    assert outcome.returncode == 0, outcome.stderr
    assert workflow.jobs(*targets, "--configfile", name) == {"pial_from_hemispheres": 1}
