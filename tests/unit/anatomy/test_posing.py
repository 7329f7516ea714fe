"""Hemispheres and whole brains in any pose: told by shape, hindbrain, labelled sides or
file, or refused."""

import json
import os
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import odd_brains
import pytest
from atlas_brains import atlas_brain, atlas_halves
from facts import Facts
from scipy.spatial.transform import Rotation
from shapes import LPS, cerebrum_surface, ellipsoid, phantom, rigid

from gyriflow.anatomy import pose as posing
from gyriflow.anatomy.fissure import smallest_gap
from gyriflow.anatomy.pial import from_hemispheres
from gyriflow.anatomy.plausible import facing_warnings, require_left_and_right
from gyriflow.anatomy.pose import (
    PosedShape,
    axes_of_file,
    pose_from_rotation,
    pose_of_hemisphere,
    pose_of_labels,
    pose_of_pair,
    pose_of_surface,
    pose_of_volume_by_shape,
    require_coordinates,
)
from gyriflow.anatomy.repair import pieces
from gyriflow.anatomy.template import PointCloud, medial_wall, shape_of
from gyriflow.errors import InputError
from gyriflow.geometry.alignment import MIRROR, RigidFit, angle_deg, motion
from gyriflow.geometry.deformations import transform_points
from gyriflow.geometry.triangles import (
    TriangleMesh,
    euler_number,
    flipped,
    is_closed,
    signed_volume,
    transformed,
)
from gyriflow.io.surfaces import read_surface
from gyriflow.io.yaml_files import SCHEMES
from gyriflow.settings.terms import SIDES

DATA = (
    Path(os.environ.get("GYRIFLOW_DATA", Path(__file__).parents[4] / "shared" / "data"))
    / "hemispheres"
)


@pytest.fixture(scope="module")
def halves():
    return atlas_halves()


def drawn(seed):
    random = np.random.default_rng(seed)
    return motion(
        Rotation.random(random_state=random).as_matrix(), random.normal(0, 30, 3)
    )


def linear(mesh, matrix):
    return transformed(mesh, motion(matrix))


def require_upright(pose, moved, pitch=10.0, tilt=2.0):
    """Require that the pose takes the motions of both sides back, but for pitch and
    tilt in degrees."""
    for side, there in zip(SIDES, moved, strict=True):
        vector = Rotation.from_matrix((pose.of_file(side) @ there)[:3, :3]).as_rotvec(
            degrees=True
        )
        assert abs(vector[0]) < pitch
        assert np.hypot(*vector[1:]) < tilt


def test_separately_moved_hemispheres_are_posed(halves):
    moved = [drawn(1), drawn(101)]
    pose = pose_of_pair(
        *(transformed(half, there) for half, there in zip(halves, moved, strict=True))
    )
    require_upright(pose, moved, pitch=5.0)
    assert not pose.together
    assert min(pose.evidence["confidence"].values()) > 1.5
    assert min(pose.evidence["side_ratio"].values()) > 1.1
    # side by side as they were, but for the gap
    left, right = (
        transformed(half, pose.of_file(side) @ there).vertices.mean(axis=0)
        - half.vertices.mean(axis=0)
        for half, side, there in zip(halves, SIDES, moved, strict=True)
    )
    assert np.abs(right - left)[1:].max() < 1.0


@pytest.mark.parametrize(
    ("degrees", "has_frame"),
    [
        ((14.9, 0, 0), True),
        ((-14.9, 0, 0), True),
        ((15.2, 0, 0), False),
        ((0, 9.9, 0), True),
        ((0, 0, -9.9), True),
        ((0, 10.1, 0), False),
        ((0, 0, 10.1), False),
    ],
)
def test_a_pose_near_the_axes_of_a_convention_is_that_of_the_file(degrees, has_frame):
    for frame, axes in (("ras", np.eye(4)), ("lps", LPS)):
        found = posing._frame(rigid(*degrees) @ axes)
        assert found == (frame if has_frame else None)


@pytest.mark.parametrize(
    ("degrees", "has_sides", "by", "warnings"),
    [
        ((14.5, 0, 0), True, "file", []),
        ((15.6, 0, 0), True, "file", [Facts("16°", "hindbrain")]),
        ((30.0, 44.0, 0), True, "file", [Facts("53°")]),
        ((40.0, 55.0, 0), False, "hindbrain", [Facts("67°", "left", "right")]),
        ((40.0, 55.0, 0), True, "hindbrain", [Facts("67°")]),
        # a quarter turn, nearly and not nearly enough
        ((76.0, 0, 0), True, "hindbrain", [Facts("90°")]),
        ((74.0, 0, 0), True, "hindbrain", [Facts("74°")]),
    ],
)
def test_a_volume_is_turned_if_it_is_far_from_its_axes(
    degrees, has_sides, by, warnings
):
    turn = rigid(*degrees)[:3, :3]
    pose = pose_from_rotation(turn, "the hindbrain", has_sides)
    assert pose.by == by
    assert list(pose.warnings) == warnings
    if by == "file":
        assert np.array_equal(pose.world, np.eye(4))
    else:
        angle = 90.0 if degrees[0] == 76.0 else angle_deg(turn)
        assert angle_deg(pose.world[:3, :3]) == pytest.approx(angle, abs=1e-5)
        assert has_sides != ("left" in pose.warnings[0])


def posed_pair():
    """Return the shapes of a left hemisphere, mirrored, and a right one, whose centres
    and walls differ."""
    cloud = PointCloud(np.zeros((1, 3)), np.zeros((1, 3)), np.zeros(3), 20.0)
    turns = [rigid(10, 20, 30), rigid(-20, 5, 60)]
    centres = [np.array([-80.0, 20.0, 50.0]), np.array([90.0, -30.0, 10.0])]
    return [
        PosedShape(
            "hemisphere",
            replace(cloud, centre=centre),
            turn[:3, :3],
            wall_mm,
            0.05,
            2.0,
            1.2,
            np.eye(3),
        )
        for turn, centre, wall_mm in zip(turns, centres, (-8.0, -9.5), strict=True)
    ]


def test_sides_are_posed_as_far_from_the_middle_and_each_other_as_they_fit():
    left, right = posed_pair()
    shift = right.rotation.T @ [0.3, 0.1, -0.25]
    fit = RigidFit(np.eye(3), shift, 0.05)
    to_left, to_right = posing._motions(left, right, fit)
    found = transform_points(right.shape.centre, to_right)
    # the left hemisphere as it is in its file
    other = transform_points(MIRROR[:3, :3] @ left.shape.centre, to_left)
    assert (found[0], other[0]) == pytest.approx((10.0, -8.5))
    # half of the shift on either side: the left centre is in front of the right one
    assert other[1:] == pytest.approx([1.0, -2.5])
    assert found[1:] == pytest.approx([-1.0, 2.5])
    assert to_right[:3, :3] == pytest.approx(right.rotation)
    mirror = MIRROR[:3, :3]
    assert to_left[:3, :3] == pytest.approx(mirror @ left.rotation @ mirror)


@pytest.mark.parametrize(
    ("turn_deg", "shift_mm", "declared", "expected"),
    [
        (4.9, (0.0, 0.0, 0.0), False, True),
        (5.1, (0.0, 0.0, 0.0), False, False),
        # a size is 20 mm
        (0.0, (2.9, 0.0, 0.0), False, True),
        (0.0, (-3.1, 0.0, 0.0), False, False),
        (0.0, (0.0, 1.1, 1.1), False, True),
        (0.0, (0.0, -1.2, 1.2), False, False),
        (29.0, (0.0, 30.0, 0.0), True, True),
        (31.0, (0.0, 0.0, 0.0), True, False),
    ],
)
def test_files_of_nearly_one_pose_share_their_coordinates(
    turn_deg, shift_mm, declared, expected
):
    left, right = posed_pair()
    to_right = rigid(40.0, -70.0, 10.0, shift=(5.0, 6.0, 7.0))
    # about the centre of the left one in its file
    centre = MIRROR[:3, :3] @ left.shape.centre
    about = motion(shift=centre) @ rigid(0, 0, turn_deg) @ motion(shift=-centre)
    to_left = motion(shift=-np.array(shift_mm)) @ to_right @ about
    found = posing._share_coordinates(to_left, to_right, left, right, declared)
    assert found == expected
    angle, shift = posing._difference(to_left, to_right, left)
    assert angle == pytest.approx(turn_deg, abs=1e-5)
    assert shift == pytest.approx(shift_mm, abs=1e-9)
    # the mean of both motions, at the middle of both centres
    mean = posing._mean_motion(to_left, to_right, left, right)
    middle = 0.5 * (centre + right.shape.centre)
    places = [transform_points(middle, each) for each in (to_left, to_right)]
    assert transform_points(middle, mean) == pytest.approx(np.mean(places, axis=0))
    half = mean[:3, :3] @ to_right[:3, :3].T
    assert angle_deg(half) == pytest.approx(turn_deg / 2, abs=1e-5)


@pytest.mark.usefixtures("shapes_once")
def test_hemispheres_of_one_pose_keep_their_distance(halves):
    turn = drawn(3)
    pose = pose_of_pair(*(transformed(half, turn) for half in halves))
    assert pose.together
    np.testing.assert_array_equal(pose.of_file("left"), pose.of_file("right"))
    require_upright(pose, [turn, turn], pitch=5.0)


@pytest.mark.usefixtures("shapes_once")
@pytest.mark.parametrize(("frame", "axes"), [("ras", np.eye(4)), ("lps", LPS)])
def test_axes_of_the_file_are_kept(halves, frame, axes):
    pose = pose_of_pair(*(transformed(half, axes) for half in halves))
    assert (pose.by, pose.evidence["coordinates"]) == ("file", frame)
    np.testing.assert_array_equal(pose.of_file("left"), axes)


@pytest.mark.usefixtures("shapes_once")
def test_files_that_name_one_system_stay_together_however_they_lie(halves):
    lower = transformed(halves[0], motion(shift=[0.0, 0.0, -9.0]))
    apart = pose_of_pair(lower, halves[1])
    assert not apart.together
    (warning,) = apart.warnings
    assert 8.0 < float(re.search(r"([\d.]+) mm", warning)[1]) < 10.0
    assert facing_warnings(lower, halves[1], np.array([1.0, 0.0, 0.0])) == [
        Facts("9.0 mm")
    ]
    assert facing_warnings(*halves, np.array([1.0, 0.0, 0.0])) == []
    pose = pose_of_pair(lower, halves[1], declared=True)
    assert pose.together
    np.testing.assert_array_equal(pose.of_file("left"), np.eye(4))


@pytest.mark.usefixtures("shapes_once")
@pytest.mark.parametrize(
    "change",
    [3.0 * np.diag([1.05, 0.95, 1.03]), [[1, 0.03, 0], [0.05, 1, 0], [0, 0.03, 1]]],
    ids=["stretched, of adult size", "sheared"],
)
def test_other_sizes_and_asymmetric_brains_are_posed(halves, change):
    size = np.cbrt(np.linalg.det(change))
    changed = [linear(halves[0], size * np.eye(3)), linear(halves[1], np.array(change))]
    moved = [drawn(7), drawn(8)]
    pose = pose_of_pair(
        *(transformed(half, there) for half, there in zip(changed, moved, strict=True))
    )
    require_upright(pose, moved, tilt=4.0)


@pytest.mark.usefixtures("shapes_once")
def test_swapped_hemispheres_are_refused(halves):
    left, right = (
        transformed(half, drawn(seed))
        for half, seed in zip(halves, (9, 10), strict=True)
    )
    with pytest.raises(
        InputError,
        match=r"0\.\d\d .*0\.\d\d ",
        check=Facts("coordinates: ras", "mirrored"),
    ):
        pose_of_pair(right, left)
    with pytest.raises(InputError, match=r"1\.\d\d .*0\.\d\d "):
        pose_of_pair(left, left)


AXES = {
    "RAS": np.eye(3),
    "LAS": np.diag([-1.0, 1.0, 1.0]),
    "RPS": np.diag([1.0, -1.0, 1.0]),
    "RPI": np.diag([1.0, -1.0, -1.0]),
    "LPI": -np.eye(3),
    "SAR": np.eye(3)[[2, 1, 0]],
    "PIR": np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]]),
}
"""Coordinates of files as (3, 3) matrices from RAS+, by their axes; all but RAS, RPI
and PIR mirror."""


def test_the_axes_of_a_file_are_named():
    assert [axes_of_file(axes.T) for axes in AXES.values()] == list(AXES)
    oblique = Rotation.from_euler("xyz", (40, 0, 0), degrees=True).as_matrix()
    assert axes_of_file(oblique) == ""
    slight = Rotation.from_euler("xyz", (20, -9, 12), degrees=True).as_matrix()
    assert axes_of_file(slight) == "RAS"


@pytest.mark.usefixtures("shapes_once")
@pytest.mark.parametrize(
    ("axes", "is_exchanged", "facts"),
    [
        # each of a pair has one shape
        ("RAS", True, ["exchanged", "RAS", "LAS", "swap", "do not swap"]),
        ("LAS", False, ["exchanged", "RAS", "LAS", "swap", "do not swap"]),
        ("RPS", False, ["exchanged", "LPS", "RPS", "swap", "do not swap"]),
        # as of BrainVISA, and of an array in the order z, y, x
        ("LPI", False, ["mirrored", "LPI", "RPI", "Do not swap"]),
        ("SAR", False, ["mirrored", "SAR", "SAL", "Do not swap"]),
    ],
)
def test_mirrored_hemispheres_are_distinguished_from_exchanged_ones_or_both_are_named(
    halves, axes, is_exchanged, facts
):
    files = [linear(half, AXES[axes]) for half in halves]
    with pytest.raises(InputError, check=Facts(*facts)) as caught:
        pose_of_pair(*(files[::-1] if is_exchanged else files))
    # nobody is told to swap where mirrored coordinates are more likely
    assert ("If the files are exchanged, swap" in str(caught.value)) == (
        "swap" in facts
    )


@pytest.mark.usefixtures("shapes_once")
def test_of_unusual_axes_it_is_said_that_they_may_be_mirrored(halves):
    (doubt,) = pose_of_pair(*(linear(half, AXES["PIR"]) for half in halves)).warnings
    assert doubt == Facts("PIR", "left", "right")
    # exchanged and mirrored hemispheres have the shapes of others: these are not to be
    # told
    exchanged = [linear(half, AXES["LPI"]) for half in halves[::-1]]
    (doubt,) = pose_of_pair(*exchanged).warnings
    assert doubt == Facts("RPI", "left", "right")


@pytest.mark.parametrize("coordinates", ["ras", "lps"])
def test_no_swap_of_sides_is_advised_in_coordinates_that_do_not_fit(
    halves, coordinates
):
    # LPS named RAS, or the reverse
    left, right = (transformed(half, LPS) for half in halves)
    with pytest.raises(
        InputError, check=Facts("coordinates: auto", "do not swap")
    ) as caught:
        require_left_and_right(left, right, coordinates)
    assert "Swap" not in str(caught.value)


@pytest.mark.usefixtures("shapes_once")
def test_a_hemisphere_of_the_other_shape_is_mirrored_or_of_the_other_side(halves):
    mirrored = linear(halves[0], AXES["LAS"])
    facts = Facts("right", "mirrored", "set side: right", "keep the side")
    with pytest.raises(InputError, check=facts):
        pose_of_hemisphere(mirrored, "left", "auto")
    doubt, *_ = pose_of_hemisphere(mirrored, "left", "ras").warnings
    assert doubt == Facts("right", "left", "axis")


# of the axes mirrored by these, some are those of exchanged files in RAS and some are
# not; `benchmarks/sides.py` has all 48
@pytest.mark.slow
@pytest.mark.skipif(not DATA.is_dir(), reason=f"no example hemispheres in {DATA}")
@pytest.mark.usefixtures("shapes_once")
def test_no_axes_of_a_real_pair_have_a_wrong_answer_but_what_has_two_faults():
    truth = json.loads((DATA / "truth.json").read_text())
    halves = []
    for side in SIDES:
        file = f"fetal.week22.{side}.pial.surf.gii"
        mesh = transformed(read_surface(DATA / file), truth[file]["to_ras"])
        halves.append(flipped(mesh) if signed_volume(mesh) < 0 else mesh)
    for named in ("RAS", "RPI"):
        turn = AXES[named]
        pose = pose_of_pair(*(linear(half, turn) for half in halves))
        require_upright(pose, [motion(turn)] * 2)
        for pair, axes in ((halves[::-1], turn), (halves, -turn)):
            with pytest.raises(InputError, check=Facts("mirrored")) as caught:
                pose_of_pair(*(linear(half, axes) for half in pair))
            is_told = "Do not swap" in str(caught.value)
            # what is exchanged in these axes is mirrored in those of its mirror image
            exchanged = named if axes is turn else axes_of_file(AXES["LAS"] @ axes.T)
            assert is_told == (exchanged not in ("RAS", "LPS"))


@pytest.mark.usefixtures("shapes_once")
def test_shapes_without_a_pose_are_refused():
    shape = transformed(
        ellipsoid((9, 24, 16)),
        motion(Rotation.from_euler("xyz", (50, 40, 30), degrees=True).as_matrix()),
    )
    with pytest.raises(
        InputError, check=Facts("left hemisphere", 0.13, 1.07, "ras", "lps")
    ):
        pose_of_pair(shape, shape)


def test_a_wall_that_was_cut_is_found_to_half_a_degree():
    ball = ellipsoid((0.6, 1.0, 0.75), 5)
    half = TriangleMesh(np.maximum(ball.vertices, [0.0, -np.inf, -np.inf]), ball.faces)
    turn = Rotation.from_rotvec([0.0, 6.0, 8.0], degrees=True).as_matrix()
    normal, offset = medial_wall(
        shape_of(linear(half, turn)), np.array([-1.0, 0.0, 0.0])
    )
    assert -(normal @ turn)[0] > np.cos(np.radians(0.5))
    shape = shape_of(half)
    assert offset * shape.size_mm == pytest.approx(shape.centre[0], abs=0.01)


@pytest.mark.usefixtures("shapes_once")
def test_surface_of_hemispheres_inside_out_in_any_pose_is_one_brain(halves):
    left, right = (
        flipped(transformed(half, drawn(seed)))
        for half, seed in zip(halves, (11, 12), strict=True)
    )
    surface = from_hemispheres(
        left, right, week=24.0, coordinates="auto", edge_length_mm=2.5
    )
    assert is_closed(surface.whole)
    sides = pieces(surface.whole)
    assert [euler_number(side) for side in sides] == [2, 2]
    assert all(signed_volume(side) > 0 for side in sides)
    assert smallest_gap(*sides) > 0.4
    assert (
        surface.left.vertices[:, 0].mean()
        < surface.fissure_x_mm
        < surface.right.vertices[:, 0].mean()
    )
    for name, file in (("left", left), ("right", right)):
        there = transformed(file, surface.pose.of_file(name)).vertices
        ended = getattr(surface, name).vertices
        for edge in (np.min, np.max):
            np.testing.assert_allclose(
                edge(there, axis=0), edge(ended, axis=0), atol=1.0
            )


@pytest.mark.slow
@pytest.mark.skipif(not DATA.is_dir(), reason=f"no example hemispheres in {DATA}")
@pytest.mark.parametrize("week", range(21, 30))
def test_real_hemispheres_are_upright(week):
    truth = json.loads((DATA / "truth.json").read_text())
    files = [f"fetal.week{week}.{side}.pial.surf.gii" for side in SIDES]
    meshes = [read_surface(DATA / file) for file in files]
    meshes = [flipped(mesh) if signed_volume(mesh) < 0 else mesh for mesh in meshes]
    require_upright(
        pose_of_pair(*meshes), [np.linalg.inv(truth[file]["to_ras"]) for file in files]
    )


@pytest.mark.usefixtures("shapes_once")
def test_doubtful_shapes_are_taken_as_ras_or_refused(halves, monkeypatch):
    # as if another pose of every hemisphere fitted the template nearly as well
    by_shape = posing.hemisphere_by_shape
    monkeypatch.setattr(
        posing,
        "hemisphere_by_shape",
        lambda mesh: replace(by_shape(mesh), confidence=1.05),
    )
    turn = motion(Rotation.from_euler("xyz", (9, -14, 12), degrees=True).as_matrix())
    pose = pose_of_pair(*(transformed(half, turn) for half in halves))
    assert pose.by == "default"
    np.testing.assert_array_equal(pose.of_file("left"), np.eye(4))
    assert pose.warnings[0] == Facts("RAS+", "coordinates")
    with pytest.raises(InputError, check=Facts("left hemisphere", 1.05, 1.07)):
        pose_of_pair(*(transformed(half, drawn(31)) for half in halves))


TURNS = [(180, 0, 0), (0, 180, 0), (0, 0, 180), (90, 0, 0), (0, 0, -90), (0, 90, 0)]


@pytest.fixture(scope="module")
def brain():
    return phantom(24.0, 1.6)


def pose_when_turned(brain, degrees):
    return pose_of_labels(
        brain[0], rigid(*degrees) @ brain[1], SCHEMES["spina-bifida-atlas"]
    )


@pytest.mark.parametrize("degrees", TURNS)
def test_quarter_turns_of_a_volume_are_undone_exactly(brain, degrees):
    pose = pose_when_turned(brain, degrees)
    assert pose.by == "cerebellum and brainstem"
    np.testing.assert_allclose(
        pose.world[:3, :3] @ rigid(*degrees)[:3, :3], np.eye(3), atol=1e-9
    )
    assert pose.warnings[0] == Facts(
        "cerebellum and brainstem", f"{max(map(abs, degrees))}°", "left", "right"
    )


@pytest.mark.parametrize("degrees", [(0, 0, 0), (5, 0, 0), (-15, 0, 0), (-6, 5, 7)])
def test_small_tilts_are_the_files_own(brain, degrees):
    pose = pose_when_turned(brain, degrees)
    assert (pose.by, pose.warnings) == ("file", ())
    assert np.array_equal(pose.world[:3, :3], np.eye(3))


@pytest.mark.parametrize(
    ("degrees", "angle"),
    [
        ((25, 0, 0), 25),
        ((30, 0, 0), 30),
        ((45, 0, 0), 45),
        ((0, 45, 0), 45),
        ((-20, 25, 30), 46),
    ],
)
def test_larger_tilts_are_kept_and_reported(brain, degrees, angle):
    pose = pose_when_turned(brain, degrees)
    assert np.array_equal(pose.world[:3, :3], np.eye(3))
    (warning,) = pose.warnings
    assert warning == Facts("cerebellum and brainstem")
    # the hindbrain of this brain is pitched by 7° against that of the atlas
    assert abs(int(re.search(r"(\d+)°", warning)[1]) - angle) < 8


@pytest.mark.parametrize(
    "lost", [(), (10,), (11, 12)], ids=["nothing", "cerebellum", "brainstem"]
)
def test_sides_and_half_a_hindbrain_tell_a_mirrored_brain_from_a_turned_one(
    brain, lost
):
    labels, affine = odd_brains.add_sides(*brain), brain[1]
    labels = np.where(np.isin(labels, lost), 0, labels)
    for turn in TURNS:
        pose = pose_of_labels(labels, rigid(*turn) @ affine, SCHEMES["dhcp-19"])
        np.testing.assert_allclose(
            pose.world[:3, :3] @ rigid(*turn)[:3, :3], np.eye(3), atol=1e-9
        )
    tilts = ((0, 0, 0), (0, 10, 8), (0, -5, 12))
    for tilt in tilts:
        assert (
            pose_of_labels(labels, rigid(*tilt) @ affine, SCHEMES["dhcp-19"]).by
            == "file"
        )
    for turn in (*tilts, *TURNS) if not lost else tilts:
        with pytest.raises(InputError, check=Facts("left", "right", "affine")):
            pose_of_labels(
                labels,
                rigid(*turn) @ np.diag([-1.0, 1, 1, 1]) @ affine,
                SCHEMES["dhcp-19"],
            )


@pytest.mark.parametrize("degrees", [(0, 0, 0), (90, 0, 0)])
def test_volumes_without_a_hindbrain_are_posed_by_their_shape(degrees):
    mesh = transformed(atlas_brain(), rigid(*degrees))
    pose = pose_of_volume_by_shape(mesh, has_sides=False)
    np.testing.assert_allclose(
        pose.world[:3, :3] @ rigid(*degrees)[:3, :3], np.eye(3), atol=1e-9
    )
    assert list(pose.warnings) == [Facts(f"{max(degrees)}°", "left", "right")] * any(
        degrees
    )


@pytest.mark.usefixtures("shapes_once")
def test_a_volume_whose_shape_says_no_pose_keeps_its_own_and_is_reported():
    # neither front nor back, up nor down, and its axes are no file's
    mesh = transformed(ellipsoid((24, 33, 22)), rigid(50, 40, 30))
    with pytest.raises(InputError, check=Facts("brain", 0.13, 1.07)):
        pose_of_surface(mesh, "auto")
    pose = pose_of_volume_by_shape(mesh, has_sides=False)
    assert np.array_equal(pose.world, np.eye(4))
    assert len(pose.warnings) == 1


def test_a_brain_with_a_reversed_axis_may_be_mirrored_and_is_warned_of(brain):
    labels, affine = brain
    scheme = SCHEMES["spina-bifida-atlas"]
    assert pose_of_labels(labels[:, ::-1], affine, scheme).warnings[0] == Facts(
        "180°", "left", "right"
    )
    sided = odd_brains.add_sides(*brain)
    turned = pose_of_labels(sided, rigid(0, 0, 180) @ affine, SCHEMES["dhcp-19"])
    assert turned.warnings[0] == Facts("180°")
    assert turned.warnings[0] != Facts("left")


@pytest.mark.parametrize(
    ("turn", "most_deg", "warnings"),
    [
        (np.eye(4), 1e-6, []),
        (LPS, 1e-6, [Facts("LPS")]),
        (rigid(100, 40, -70), 5.0, [Facts("°")]),
    ],
    ids=["RAS", "LPS", "any"],
)
def test_the_shape_of_a_surface_tells_its_pose(turn, most_deg, warnings):
    pose = pose_of_surface(transformed(atlas_brain(), turn), "auto")
    assert angle_deg(pose.of_file()[:3, :3] @ turn[:3, :3]) < most_deg
    assert list(pose.warnings) == warnings


@pytest.mark.usefixtures("shapes_once")
def test_coordinates_that_are_named_are_kept_and_doubted():
    pose = pose_of_surface(transformed(atlas_brain(), rigid(180, 0, 0)), "ras")
    assert np.array_equal(pose.world[:3, :3], np.eye(3))
    assert re.search(r"1[78]\d° .*\bras\b", pose.warnings[0])
    assert pose_of_surface(atlas_brain(), "ras").warnings == ()


@pytest.mark.parametrize(
    "pathology", ["without_callosum", "holoprosencephaly", "wide_hemisphere"]
)
def test_a_brain_that_fits_several_poses_is_taken_as_ras_and_doubted(brain, pathology):
    mesh = cerebrum_surface(getattr(odd_brains, pathology)(*brain), brain[1])
    pose = pose_of_surface(mesh, "auto")
    assert pose.by == "default"
    assert pose.warnings[0] == Facts("RAS+", "coordinates")


@pytest.mark.usefixtures("shapes_once")
def test_hemispheres_in_coordinates_that_their_shapes_contradict_are_doubted(halves):
    left, right = halves
    assert require_coordinates(left, right, "ras") == []
    (doubt,) = require_coordinates(
        *(transformed(side, rigid(180, 0, 0)) for side in (left, right)), "ras"
    )
    assert re.search(r"1[78]\d° .*\bras\b", doubt)


@pytest.mark.usefixtures("shapes_once")
def test_exchanged_files_are_refused_though_the_left_one_lies_on_the_left(halves):
    # back to front in the named coordinates; so are mirrored ones, RPS
    right, left = (transformed(half, LPS) for half in halves)
    require_left_and_right(left, right, "lps")
    facts = Facts("left", "right", "exchanged", "mirrored", "LPS")
    with pytest.raises(InputError, match=r"0\.\d\d .*0\.\d\d ", check=facts) as caught:
        require_coordinates(left, right, "lps")
    assert str(caught.value) == Facts("coordinates: auto", "do not swap")


@pytest.mark.parametrize(
    ("turn", "confidence", "ratios"),
    [
        (LPS, 1.05, [0.8, 0.8]),
        (LPS, 1.5, [0.7, 0.95]),
        (np.eye(4), 1.5, [0.8, 0.8]),
    ],
    ids=[
        "of no clear pose",
        "of which one fits both sides",
        "exchanged, but in RAS",
    ],
)
def test_odd_shapes_in_named_coordinates_are_doubted_and_measured(
    halves, monkeypatch, turn, confidence, ratios
):
    # as if hemispheres in RAS fitted the other sides better, in axes turned by `turn`
    shape = shape_of(halves[1])
    posed = PosedShape(
        "hemisphere", shape, turn[:3, :3], 0.0, 0.05, confidence, 1.2, np.eye(3)
    )
    found = iter([*ratios, 1.2, 1.2])
    monkeypatch.setattr(
        posing,
        "hemisphere_by_shape",
        lambda _: replace(posed, side_ratio=next(found)),
    )
    (doubt,) = require_coordinates(*halves, "ras")
    assert doubt == Facts("left", "right", "RAS", "coordinates: auto")
