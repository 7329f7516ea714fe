"""The pose of a brain, which surfaces and volumes follow from their own axes, and how
it is found."""

import numpy as np
import pytest
from facts import Facts
from shapes import LPS, rigid, sphere

from gyriflow.errors import InputError
from gyriflow.geometry.alignment import (
    Planes,
    angle_deg,
    follow_planes,
)
from gyriflow.geometry.poses import Pose, turned

TURN = rigid(10, 20, 30, shift=(4.0, -3.0, 2.0))


@pytest.mark.parametrize(("coordinates", "flip"), [("lps", LPS), ("ras", np.eye(4))])
def test_surfaces_in_lps_are_flipped_once_and_volumes_never(coordinates, flip):
    pose = turned((TURN @ flip)[:3, :3], "configuration", coordinates)
    np.testing.assert_allclose(pose.of_file()[:3, :3], (TURN @ flip)[:3, :3])
    np.testing.assert_allclose(pose.of_volume("a.nii")[:3, :3], TURN[:3, :3])


def test_a_volume_cannot_follow_hemispheres_that_were_posed_separately():
    with pytest.raises(InputError, check=Facts("a.nii:", "GIFTI")):
        Pose(together=False).of_volume("a.nii")


def test_a_sphere_is_not_turned():
    random = np.random.default_rng(2)
    ball = sphere(1.0, 2).vertices
    planes = Planes(ball, ball, 0.01 * random.normal(size=len(ball)))
    rotation, _ = follow_planes(
        np.eye(3), np.zeros(3), lambda *_: planes, 1, lambda *_: True
    )
    assert angle_deg(rotation) < 1e-6
