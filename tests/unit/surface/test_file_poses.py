"""Surfaces and volumes of a brain are moved onto its posed surface, each from its own axes."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gyriflow.errors import InputError
from gyriflow.surface.file_poses import LPS_TO_RAS, surface_pose, volume_pose


def turned(*degrees):
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_euler("xyz", degrees, degrees=True).as_matrix()
    matrix[:3, 3] = 4.0, -3.0, 2.0
    return matrix


def test_a_volume_follows_the_one_motion_of_a_brain():
    motion = turned(10, 20, 30)
    for posing in ({}, {"posing": {"together": True}}):
        assert volume_pose({"pose": motion.tolist()} | posing, "a.nii") == pytest.approx(motion)


@pytest.mark.parametrize("source", ["pial", "hemisphere", "hemispheres"])
@pytest.mark.parametrize("coordinates", ["lps", "ras"])
def test_surfaces_in_lps_are_flipped_once_and_volumes_never(source, coordinates):
    lps, turn = np.diag([-1.0, -1.0, 1.0, 1.0]), turned(0, 10, 0)
    flip = lps if coordinates == "lps" else np.eye(4)
    # the surface stage flips hemispheres before it poses them, other surfaces as part of their pose
    reported = turn if source == "hemispheres" else turn @ flip
    report = {"source": source, "coordinates": coordinates, "pose": reported.tolist()}
    assert surface_pose(report) == pytest.approx(turn @ flip)
    assert volume_pose(report, "a.nii") == pytest.approx(turn)


def test_a_volume_cannot_follow_hemispheres_that_were_posed_separately():
    report = {"pose": np.eye(4).tolist(), "posing": {"together": False}}
    with pytest.raises(InputError, match=r"a\.nii: a volume cannot belong.*posed separately.*per vertex \(GIFTI\)"):
        volume_pose(report, "a.nii")


def test_a_volume_follows_hemispheres_that_were_found_to_be_in_lps():
    turn = turned(0, 10, 0)
    report = {"source": "hemispheres", "coordinates": "auto", "pose": (turn @ LPS_TO_RAS).tolist()}
    posing = {"together": True, "coordinates": "lps"}
    assert volume_pose(report | {"posing": posing}, "a.nii") == pytest.approx(turn)
