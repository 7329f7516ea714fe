"""The pose of a brain, which surfaces and volumes follow from their own axes, and how
it is found."""

import numpy as np
import pytest
from facts import Facts
from scipy.spatial.transform import Rotation
from shapes import LPS, rigid

from gyriflow.errors import InputError
from gyriflow.geometry.alignment import (
    Planes,
    RigidFit,
    angle_deg,
    fits_from_all_sides,
    residual_ratio,
    step_towards_planes,
)
from gyriflow.geometry.poses import Pose, pose_from, turned

TURN = rigid(10, 20, 30, shift=(4.0, -3.0, 2.0))


def test_without_motions_of_files_these_are_in_the_world_of_the_volumes():
    pose = Pose(TURN)
    assert (
        pose.of_file("left") is pose.of_file() is pose.of_volume("a.nii") is pose.world
    )
    np.testing.assert_allclose(pose.inverse @ TURN, np.eye(4), atol=1e-15)


@pytest.mark.parametrize(("coordinates", "flip"), [("lps", LPS), ("ras", np.eye(4))])
def test_surfaces_in_lps_are_flipped_once_and_volumes_never(coordinates, flip):
    pose = turned((TURN @ flip)[:3, :3], "configuration", coordinates)
    np.testing.assert_allclose(pose.of_file()[:3, :3], (TURN @ flip)[:3, :3])
    np.testing.assert_allclose(pose.of_volume("a.nii")[:3, :3], TURN[:3, :3])


def test_a_motion_after_a_pose_moves_all_and_sides_may_have_their_own():
    pose = Pose(files={"left": TURN, "whole": LPS}, by="shape").then(rigid(0, 0, 90))
    np.testing.assert_allclose(pose.of_file("left"), rigid(0, 0, 90) @ TURN)
    np.testing.assert_allclose(pose.of_file("right"), rigid(0, 0, 90) @ LPS)
    np.testing.assert_allclose(pose.world, rigid(0, 0, 90))


def test_a_volume_cannot_follow_hemispheres_that_were_posed_separately():
    with pytest.raises(InputError, check=Facts("a.nii:", "GIFTI")):
        Pose(together=False).of_volume("a.nii")


def test_a_pose_is_the_same_after_writing():
    pose = Pose(TURN, {"left": LPS}, "file", False, {"pitch_deg": 2.0}, ("look",))
    assert pose_from(pose.plain()).plain() == pose.plain()


RANDOM = np.random.default_rng(2)
POINTS = RANDOM.normal(size=(200, 3)) * [3.0, 2.0, 1.0] + [10.0, -5.0, 2.0]
NORMALS = POINTS / np.linalg.norm(POINTS, axis=1, keepdims=True)
NORMALS = NORMALS[RANDOM.permutation(200)]


def about(degrees, axis=(0.0, 0.0, 1.0)):
    return Rotation.from_rotvec(np.array(axis) * degrees, degrees=True).as_matrix()


def test_a_small_motion_is_taken_back_in_one_step():
    turn, move = about(0.01, (0.6, 0.0, 0.8)), np.array([0.002, -0.001, 0.003])
    targets = POINTS @ turn.T + move
    distances = np.einsum("ij,ij->i", targets - POINTS, NORMALS)
    found, shift = step_towards_planes(Planes(POINTS, NORMALS, distances))
    np.testing.assert_allclose(POINTS @ found.T + shift, targets, atol=1e-5)


def test_a_sphere_is_not_turned():
    ball = NORMALS - NORMALS.mean(axis=0)
    distances = RANDOM.normal(size=200) * 0.01
    rotation, _ = step_towards_planes(Planes(ball, ball, distances))
    assert angle_deg(rotation) < 1e-6


def test_the_best_poses_that_differ_are_compared_and_the_first_start_always():
    # four poses, the second and third alike; the one that looks worse becomes the best
    rough = {0.0: 3.0, 90.0: 1.0, 95.0: 1.1, 180.0: 2.0, 270.0: 2.5}
    asked = []

    def roughly(start):
        return RigidFit(
            start,
            np.zeros(3),
            rough[round(float(np.degrees(np.arctan2(start[1, 0], start[0, 0])) % 360))],
        )

    def better(fit):
        asked.append(fit.residual)
        return RigidFit(
            fit.rotation, fit.shift, {3.0: 1.5, 1.0: 0.9, 2.0: 0.6}[fit.residual]
        )

    fits = fits_from_all_sides(
        [about(angle) for angle in rough],
        roughly,
        better,
        candidates=2,
        distinct_deg=30.0,
    )
    assert asked == [3.0, 1.0, 2.0]
    assert [fit.residual for fit in fits] == [1.5, 0.9, 0.6]
    assert residual_ratio(fits, fits[2], 30.0) == pytest.approx(1.5)
    assert residual_ratio(fits[2:], fits[2], 30.0) == np.inf
