"""Pairs of hemispheres in the real program: bad ones are refused, those in any pose are posed."""

import numpy as np
import pytest
from atlas_brains import atlas_halves
from reliability import trying
from shapes import hemisphere, moved, rigid, save_gifti

from gyriflow.geometry.alignment import angle_deg
from gyriflow.geometry.triangles import flipped, transformed
from gyriflow.io.surfaces import read_surface

from .conftest import Workflow

pytestmark = pytest.mark.slow

LEFT, RIGHT = hemisphere(-1), hemisphere(1)
PAIR = "{0}.left.gii, {0}.right.gii"
# pairs, the files that the message names and what it says of them
BAD = {
    "swapped": (RIGHT, LEFT, PAIR, "the left hemisphere lies to the right of the right one"),
    # of one size, and where the other one is
    "overlapping": (LEFT, moved(RIGHT, -24.0), PAIR, "the hemispheres overlap too much"),
    "torn": (LEFT, RIGHT, "{0}.right.gii", "cannot be read as GIFTI"),
    # a good pair whose files change places
    "exchanged": (LEFT, RIGHT, PAIR, "the hemispheres seem to be swapped"),
}
REFUSED = trying({"swapped": 9, "overlapping": 14, "torn": 12, "exchanged": 9})
MATRIX = rigid(0, 0, 90, shift=(7.0, 8.0, 9.0))
MOTIONS = {
    "left": rigid(100, 40, -70, shift=(30.0, 0.0, -50.0)),
    "right": rigid(-20, 130, 60, shift=(0.0, 9.0, 0.0)),
}


@pytest.fixture(scope="module")
def study(checkout_copy, tmp_path_factory):
    """One run of the surface stage over bad pairs, one that a matrix puts in place, and one in two poses."""
    workflow = Workflow(checkout_copy, tmp_path_factory.mktemp("pairs"))
    pairs = {name: (left, right, None) for name, (left, right, *_) in BAD.items()}
    pairs["placed"] = (*(transformed(side, np.linalg.inv(MATRIX)) for side in (LEFT, RIGHT)), MATRIX)
    halves = zip(atlas_halves(), MOTIONS.values(), strict=True)
    pairs["posed"] = (*(flipped(transformed(half, turn)) for half, turn in halves), None)
    pairs["exchanged"] = (*reversed(pairs["posed"][:2]), None)
    brains = []
    for name, (left, right, matrix) in pairs.items():
        files = {side: f"{name}.{side}.gii" for side in ("left", "right")}
        for side, surface in (("left", left), ("right", right)):
            save_gifti(workflow.directory / files[side], surface, matrix)
        any_pose = name in ("posed", "exchanged")
        entry = {"id": name, "week": 24 if any_pose else 21, "coordinates": "auto" if any_pose else "ras"}
        brains.append(entry | {"hemispheres": files})
    torn = workflow.directory / "torn.right.gii"
    torn.write_bytes(torn.read_bytes()[: torn.stat().st_size // 2])
    config = {"brains": brains, "start": "placed", "surface": {"edge_length_mm": 2.0}, "folding": {"end_week": 25}}
    return workflow.surfaces(config)


@pytest.mark.parametrize("name", REFUSED)
def test_bad_hemispheres_are_refused_with_a_message_and_nothing_is_left(study, name):
    study.require_exit_code(2)
    *_, files, said = BAD[name]
    assert said in study.outcome.stderr
    if name != "exchanged":
        study.require_refused(name, f"{files.format(study.directory / name)}: {said}")
    assert not (study.results / name / "surface" / "pial.surf.gii").exists()


@pytest.mark.fault(11)
def test_coordinates_that_the_file_names_are_honoured(study):
    surface = read_surface(study.results / "placed" / "surface" / "pial.surf.gii")
    np.testing.assert_allclose(surface.vertices.min(axis=0), [-23.5, -24.0, -16.0], atol=0.6)
    assert "placed.left.gii: the coordinate-system matrix of the file was applied" in study.log("placed")


@pytest.mark.fault(10)
def test_hemispheres_in_any_pose_are_posed(study):
    report = study.report("posed")
    assert (report["euler_number"], report["pose"]["together"]) == (4, False)
    for side, turn in MOTIONS.items():
        assert angle_deg((np.array(report["pose"]["files"][side]) @ turn)[:3, :3]) < 5.0
