"""Hemispheres in any pose: found again by their shape or their files, or refused."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from shapes import LPS, ellipsoid, phantom_halves

from gyriflow.anatomy import pose as posing
from gyriflow.anatomy.fissure import least_gap
from gyriflow.anatomy.pial import from_hemispheres
from gyriflow.anatomy.plausible import Limits
from gyriflow.anatomy.pose import about_x, pair_by_shape, pairs_by_shape, pitch_deg, poses
from gyriflow.anatomy.repair import pieces
from gyriflow.errors import InputError
from gyriflow.geometry.alignment import motion
from gyriflow.geometry.triangles import TriangleMesh, euler_number, flipped, is_closed, signed_volume, transformed
from gyriflow.io.surfaces import declared, read_surface, write_surface
from gyriflow.parameters.terms import SIDES

DATA = Path(os.environ.get("GYRIFLOW_DATA", Path(__file__).parents[4] / "shared" / "data"))


@pytest.fixture(scope="module")
def halves():
    return phantom_halves()


def rigid(seed):
    random = np.random.default_rng(seed)
    turn = Rotation.random(random_state=random).as_matrix()
    return motion(turn, random.normal(0, 30, 3))


def linear(mesh, matrix):
    return transformed(mesh, motion(matrix))


def found(left, right):
    return poses([pair_by_shape(left, right)], [False])[0]


def errors(pose, moved, halves):
    """Returns the angles (degrees) of what is left of the motions, and by how much (mm) both halves are apart more."""
    rest = [side @ motion for side, motion in zip((pose.of_file(side) for side in SIDES), moved, strict=True)]
    angles = [np.degrees(Rotation.from_matrix(motion[:3, :3]).magnitude()) for motion in rest]
    left, right = (
        transformed(half, motion).vertices.mean(axis=0) - half.vertices.mean(axis=0)
        for half, motion in zip(halves, rest, strict=True)
    )
    return angles, right - left


def test_separately_moved_hemispheres_are_posed(halves):
    moved = [rigid(1), rigid(101)]
    pose = found(*(transformed(half, motion) for half, motion in zip(halves, moved, strict=True)))
    angles, apart = errors(pose, moved, halves)
    assert max(angles) < 3.0
    assert np.abs(apart[1:]).max() < 1.0
    assert not pose.together
    assert min(pose.evidence["confidence"].values()) > 1.5


def test_hemispheres_of_one_pose_keep_their_distance(halves):
    turn = rigid(3)
    pose = found(*(transformed(half, turn) for half in halves))
    angles, apart = errors(pose, [turn, turn], halves)
    assert pose.together
    assert max(angles) < 3.0
    np.testing.assert_allclose(apart, 0.0, atol=0.1)


@pytest.mark.parametrize("frame", ["ras", "lps"])
def test_exact_axes_of_the_file_are_kept(halves, frame):
    axes = LPS if frame == "lps" else np.eye(4)
    pose = found(*(transformed(half, axes) for half in halves))
    assert (pose.by, pose.evidence["coordinates"]) == ("file", frame)
    np.testing.assert_array_equal(pose.of_file("left"), axes)


def test_tilted_axes_are_kept_where_the_file_names_them(halves):
    tilt = Rotation.from_euler("y", 5, degrees=True).as_matrix()
    tilted = pair_by_shape(*(linear(half, tilt) for half in halves))
    assert poses([tilted], [False])[0].by == "shape"
    assert poses([tilted], [True])[0].by == "file"


def test_other_brains_follow_the_one_whose_file_is_right(halves):
    # a pitch of the convention that no shape tells
    pitched = [linear(half, about_x(8.0)) for half in halves]
    moved = [rigid(5), rigid(6)]
    larger = [transformed(linear(half, 1.1 * np.eye(3)), motion) for half, motion in zip(halves, moved, strict=True)]
    first, second = poses([pair_by_shape(*pitched), pair_by_shape(*larger)], [False, False])
    assert first.by == "file"
    for side, turn in zip((second.of_file(side) for side in SIDES), moved, strict=True):
        assert pitch_deg((side @ turn)[:3, :3]) == pytest.approx(8.0, abs=1.0)


def bent(mesh, rms_mm, seed):
    """Returns the surface in smooth random waves as long as a hemisphere, without what of them is a rigid motion."""
    random = np.random.default_rng(seed)
    centre = mesh.vertices.mean(axis=0)
    points, size = mesh.vertices - centre, signed_volume(mesh) ** (1 / 3)
    phases = points @ random.normal(0.0, 2.0 / size, (60, 3)).T + random.uniform(0.0, 2 * np.pi, 60)
    waves = np.cos(phases) @ random.normal(0.0, 1.0, (60, 3))
    waves -= waves.mean(axis=0)
    there = points + waves * rms_mm / np.sqrt((waves**2).sum(axis=1).mean())
    back, _ = Rotation.align_vectors(points, there)
    return TriangleMesh(back.apply(there) + centre, mesh.faces)


@pytest.mark.parametrize(
    "change",
    [3.0 * np.diag([1.05, 0.95, 1.03]), [[1, 0.03, 0], [0.05, 1, 0], [0, 0.03, 1]]],
    ids=["stretched, of adult size", "sheared"],
)
def test_other_sizes_and_asymmetric_brains_are_posed(halves, change):
    # the right hemisphere only: a brain that is not its own mirror image
    size = np.cbrt(np.linalg.det(change))
    changed = [linear(halves[0], size * np.eye(3)), linear(halves[1], np.array(change))]
    moved = [rigid(7), rigid(8)]
    pose = found(*(transformed(half, motion) for half, motion in zip(changed, moved, strict=True)))
    angles, apart = errors(pose, moved, changed)
    assert max(angles) < 4.0
    assert np.linalg.norm(apart[1:]) < 1.5 * size


def test_hemispheres_of_an_asymmetric_brain_come_to_lie_alike(halves):
    # the bent medial wall alone would turn the right one by 4°
    asymmetric = [halves[0], bent(halves[1], 1.5, 3)]
    moved = [rigid(3), rigid(53)]
    pose = found(*(transformed(half, motion) for half, motion in zip(asymmetric, moved, strict=True)))
    angles, apart = errors(pose, moved, asymmetric)
    assert max(angles) < 2.0
    assert np.linalg.norm(apart[1:]) < 1.0


def test_deformed_hemispheres_of_one_pose_keep_their_distance(halves):
    turn = rigid(13)
    pose = found(*(transformed(half, turn) for half in (halves[0], bent(halves[1], 1.5, 4))))
    assert pose.together


def test_swapped_hemispheres_are_refused(halves):
    left, right = (transformed(half, rigid(seed)) for half, seed in zip(halves, (9, 10), strict=True))
    with pytest.raises(InputError, match="seem to be swapped"):
        pair_by_shape(right, left)
    with pytest.raises(InputError, match="of one side"):
        pair_by_shape(left, left)


@pytest.mark.parametrize("half_lengths", [(20, 20, 20), (9, 24, 16)])
def test_shapes_without_a_pose_are_refused(half_lengths):
    shape = ellipsoid(half_lengths)
    with pytest.raises(InputError, match="cannot be determined from its shape"):
        pair_by_shape(shape, shape)


def test_surface_of_hemispheres_inside_out_in_any_pose_is_one_brain(halves):
    left, right = (flipped(transformed(half, rigid(seed))) for half, seed in zip(halves, (11, 12), strict=True))
    surface = from_hemispheres(left, right, week=24.0, coordinates="auto", edge_length_mm=1.6)
    assert is_closed(surface.whole)
    sides = pieces(surface.whole)
    assert [euler_number(side) for side in sides] == [2, 2]
    assert all(signed_volume(side) > 0 for side in sides)
    assert least_gap(*sides) > 0.4
    assert surface.left.vertices[:, 0].mean() < surface.fissure_x_mm < surface.right.vertices[:, 0].mean()
    for name, file in (("left", left), ("right", right)):
        there, ended = transformed(file, surface.pose.of_file(name)).vertices, getattr(surface, name).vertices
        for edge in (np.min, np.max):
            np.testing.assert_allclose(edge(there, axis=0), edge(ended, axis=0), atol=1.0)


def test_files_say_their_axes_and_side(tmp_path, halves):
    write_surface(tmp_path / "left.surf.gii", halves[0], "CortexLeft")
    assert declared(tmp_path / "left.surf.gii") == ("NIFTI_XFORM_SCANNER_ANAT", "CortexLeft")
    write_surface(tmp_path / "left.stl", halves[0])
    assert declared(tmp_path / "left.stl") == (None, None)


def test_a_pose_is_the_same_beside_other_brains(halves):
    def brain(size, seed):
        return pair_by_shape(*(transformed(linear(half, size * np.eye(3)), rigid(seed)) for half in halves))

    one = brain(1.0, 20)
    alone, beside = poses([one], [False])[0], poses([one, brain(1.1, 21)], [False, False])[0]
    assert alone.plain() == beside.plain()


@pytest.mark.skipif(not (DATA / "hemispheres").is_dir(), reason=f"no example hemispheres in {DATA}")
def test_real_hemispheres_in_different_poses_are_posed_alike():
    weeks = (21, 22)
    files = [
        [read_surface(DATA / "hemispheres" / f"fetal.week{week}.{side}.pial.surf.gii") for side in ("left", "right")]
        for week in weeks
    ]
    exact, tilted = poses([pair_by_shape(*sides) for sides in files], [False, False])
    # week 21 is in LPS; week 22, each hemisphere tilted on its own, has to come to lie like it
    assert exact.evidence["coordinates"] == "lps"
    assert tilted.by == "shape"
    posed = [[transformed(side, m) for side, m in zip(sides, (p.of_file(side) for side in SIDES), strict=True)]
             for sides, p in zip(files, (exact, tilted), strict=True)]  # fmt: skip
    for side in (0, 1):
        first, second = (brain[side].vertices for brain in posed)
        np.testing.assert_allclose(np.ptp(second, axis=0) / np.ptp(first, axis=0), 1.06, atol=0.05)


@pytest.fixture
def doubtful(monkeypatch):
    """Has another pose of every hemisphere fit the reference nearly as well."""
    by_shape = posing.hemisphere_by_shape
    monkeypatch.setattr(posing, "hemisphere_by_shape", lambda mesh: replace(by_shape(mesh), confidence=1.05))


@pytest.mark.usefixtures("doubtful")
@pytest.mark.parametrize("frame", ["ras", "lps"])
def test_a_doubtful_shape_near_the_axes_of_files_is_posed_as_these_say(halves, frame):
    axes = (LPS if frame == "lps" else np.eye(4))[:3, :3]
    turns = [axes @ Rotation.from_euler("xyz", tilt, degrees=True).as_matrix() for tilt in ((9, -14, 12), (-8, 10, 3))]
    pair = pair_by_shape(*(linear(half, turn) for half, turn in zip(halves, turns, strict=True)))
    mirrored = np.diag([-1.0, 1, 1]) @ turns[0] @ np.diag([-1.0, 1, 1])
    for hemisphere, turn in ((pair.left, mirrored), (pair.right, turns[1])):
        assert np.degrees(Rotation.from_matrix(hemisphere.rotation @ turn).magnitude()) < 5.0


@pytest.mark.slow
@pytest.mark.usefixtures("doubtful")
def test_a_doubtful_shape_in_any_pose_is_posed_like_the_studys_others_or_refused(halves):
    motions = rigid(31), rigid(32)
    moved = tuple(transformed(half, motion) for half, motion in zip(halves, motions, strict=True))
    with pytest.raises(InputError, match="cannot be determined from its shape"):
        pair_by_shape(*moved)
    pairs = pairs_by_shape([moved, tuple(halves)])
    posed, _ = poses(pairs, [False, False])
    for side, turn in zip((posed.of_file(side) for side in SIDES), motions, strict=True):
        assert np.degrees(Rotation.from_matrix((side @ turn)[:3, :3]).magnitude()) < 3.0


def test_declared_hemispheres_stay_together_however_they_lie(halves):
    lower = np.eye(4)
    lower[2, 3] = -4.0
    (pose,) = poses([pair_by_shape(transformed(halves[0], lower), halves[1])], [True])
    assert pose.together
    np.testing.assert_array_equal(pose.of_file("left"), np.eye(4))


def test_how_asymmetric_hemispheres_may_be_is_the_users_choice(halves):
    pair = [halves[0], linear(halves[1], np.diag([1.2, 1.0, 1.0]))]
    assert pair_by_shape(*pair).fit.residual > 0.02
    with pytest.raises(InputError, match=r"no mirror images.*surface\.max_asymmetry"):
        pair_by_shape(*pair, Limits(max_asymmetry=0.005))
