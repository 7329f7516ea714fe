"""Hemispheres and whole brains in any pose: told by shape, hindbrain, labelled sides or
file, or refused."""

import re

import numpy as np
import odd_brains
import pytest
from atlas_brains import atlas_brain, atlas_halves
from facts import Facts
from scipy.spatial.transform import Rotation
from shapes import LPS, cerebrum_surface, ellipsoid, phantom, rigid

from gyriflow.anatomy import template
from gyriflow.anatomy.fissure import smallest_gap
from gyriflow.anatomy.pial import from_hemispheres
from gyriflow.anatomy.plausible import require_left_and_right
from gyriflow.anatomy.pose import (
    pose_of_hemisphere,
    pose_of_labels,
    pose_of_pair,
    pose_of_surface,
    pose_of_volume_by_shape,
    require_coordinates,
)
from gyriflow.anatomy.repair import pieces
from gyriflow.errors import InputError
from gyriflow.geometry.alignment import MIRROR, RigidFit, angle_deg, motion
from gyriflow.geometry.poses import CONVENTIONS
from gyriflow.geometry.triangles import (
    euler_number,
    flipped,
    signed_volume,
    transformed,
)
from gyriflow.io.yaml_files import SCHEMES
from gyriflow.settings.terms import SIDES

ATLAS, DHCP = SCHEMES["spina-bifida-atlas"], SCHEMES["dhcp-19"]
pytestmark = pytest.mark.usefixtures("quick_poses")


@pytest.fixture(scope="module")
def halves():
    return atlas_halves()


def drawn(seed):
    """Return a rigid motion at random."""
    random = np.random.default_rng(seed)
    turn = Rotation.random(random_state=random).as_matrix()
    return motion(turn, random.normal(0, 30, 3))


def linear(mesh, matrix):
    return transformed(mesh, motion(matrix))


def both_moved(halves, *motions):
    """Return a left and a right hemisphere after motions, one each or one for both."""
    left, right = halves
    return transformed(left, motions[0]), transformed(right, motions[-1])


def require_upright(pose, *motions, pitch=10.0, tilt=2.0):
    """Require that the pose takes the motions of both sides back, but for pitch and
    tilt in degrees."""
    for side, there in zip(SIDES, motions, strict=True):
        rest = Rotation.from_matrix((pose.of_file(side) @ there)[:3, :3])
        x, y, z = rest.as_rotvec(degrees=True)
        assert abs(x) < pitch
        assert np.hypot(y, z) < tilt


def test_separately_moved_hemispheres_are_posed(halves):
    motions = drawn(1), drawn(101)
    pose = pose_of_pair(*both_moved(halves, *motions))
    require_upright(pose, *motions, pitch=5.0)
    assert not pose.together
    assert min(pose.evidence["confidence"].values()) > 1.5
    assert min(pose.evidence["side_ratio"].values()) > 1.1
    # side by side as they were, beside the middle
    left, right = (
        transformed(half, pose.of_file(side) @ there).vertices
        for half, side, there in zip(halves, SIDES, motions, strict=True)
    )
    assert [left[:, 0].max(), right[:, 0].min()] == pytest.approx([-0.5, 0.5], abs=0.7)
    between = halves[1].vertices.mean(axis=0) - halves[0].vertices.mean(axis=0)
    found = right.mean(axis=0) - left.mean(axis=0)
    assert found[1:] == pytest.approx(between[1:], abs=1.0)


@pytest.mark.parametrize(
    ("there", "frame"),
    [
        (drawn(3), None),
        (LPS, "lps"),
        # a pitch of up to 15° and a tilt of up to 10°
        (rigid(9, 0, 0), "ras"),
        (rigid(21, 0, 0), None),
        (rigid(0, 0, -7) @ LPS, "lps"),
        (rigid(0, 13, 0) @ LPS, None),
    ],
)
def test_hemispheres_of_one_pose_stay_together_and_keep_the_axes_of_a_convention(
    halves, there, frame
):
    pose = pose_of_pair(*both_moved(halves, there))
    assert pose.together
    np.testing.assert_array_equal(pose.of_file("left"), pose.of_file("right"))
    assert pose.evidence["coordinates"] == frame
    assert pose.by == ("file" if frame else "shape")
    if frame:
        np.testing.assert_array_equal(pose.of_file("left"), CONVENTIONS[frame])
    else:
        require_upright(pose, there, there, pitch=5.0)


@pytest.mark.parametrize(
    ("off", "declared", "together"),
    [
        (rigid(0, 0, 3), False, True),
        (rigid(0, 0, 8), False, False),
        (rigid(0, 0, 8), True, True),
        (rigid(0, 0, 40), True, False),
        (rigid(shift=(-2.0, 0.0, 0.0)), False, True),
        (rigid(shift=(-9.0, 0.0, 0.0)), False, False),
        (rigid(shift=(0.0, 0.0, -9.0)), False, False),
        (rigid(shift=(0.0, 0.0, -9.0)), True, True),
    ],
)
def test_files_of_nearly_one_pose_or_that_name_one_system_share_their_coordinates(
    halves, off, declared, together
):
    centre = halves[0].vertices.mean(axis=0)
    about = rigid(shift=centre) @ off @ rigid(shift=-centre)
    pose = pose_of_pair(*both_moved(halves, about, np.eye(4)), declared=declared)
    assert pose.together == together
    if together:
        np.testing.assert_array_equal(pose.of_file("left"), np.eye(4))
    elif shift_mm := np.linalg.norm(off[:3, 3]):
        (warning,) = pose.warnings
        found = float(re.search(r"([\d.]+) mm", warning)[1])
        assert found == pytest.approx(shift_mm, abs=1.0)


def test_brains_of_another_size_and_shape_are_posed(halves):
    change = 3.0 * np.array([[1.05, 0.03, 0], [0.05, 0.95, 0], [0, 0.03, 1.03]])
    size = np.cbrt(np.linalg.det(change))
    changed = linear(halves[0], size * np.eye(3)), linear(halves[1], change)
    motions = drawn(7), drawn(8)
    pose = pose_of_pair(*both_moved(changed, *motions))
    require_upright(pose, *motions, tilt=4.0)


def test_swapped_hemispheres_are_refused(halves):
    left, right = both_moved(halves, drawn(9), drawn(10))
    facts = Facts("coordinates: ras", "mirrored")
    with pytest.raises(InputError, match=r"0\.\d\d .*0\.\d\d ", check=facts):
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
    is_told = "If the files are exchanged, swap" in str(caught.value)
    assert is_told == ("swap" in facts)


def test_of_unusual_axes_it_is_said_that_they_may_be_mirrored(halves):
    (doubt,) = pose_of_pair(*(linear(half, AXES["PIR"]) for half in halves)).warnings
    assert doubt == Facts("PIR", "left", "right")
    # exchanged and mirrored hemispheres have the shapes of others: these are not to be
    # told
    exchanged = [linear(half, AXES["LPI"]) for half in halves[::-1]]
    (doubt,) = pose_of_pair(*exchanged).warnings
    assert doubt == Facts("RPI", "left", "right")


def test_no_swap_of_sides_is_advised_in_coordinates_that_do_not_fit(halves):
    # LPS named RAS, or the reverse
    facts = Facts("coordinates: auto", "do not swap")
    for coordinates in ("ras", "lps"):
        with pytest.raises(InputError, check=facts) as caught:
            require_left_and_right(*both_moved(halves, LPS), coordinates)
        assert "Swap" not in str(caught.value)


def test_a_hemisphere_of_the_other_shape_is_mirrored_or_of_the_other_side(halves):
    mirrored = linear(halves[0], AXES["LAS"])
    facts = Facts("right", "mirrored", "set side: right", "keep the side")
    with pytest.raises(InputError, check=facts):
        pose_of_hemisphere(mirrored, "left", "auto")
    doubt, *_ = pose_of_hemisphere(mirrored, "left", "ras").warnings
    assert doubt == Facts("right", "left", "axis")


@pytest.mark.usefixtures("few_starts")
def test_shapes_without_a_pose_are_refused_or_keep_that_of_their_volume():
    # neither front nor back, up nor down, and its axes are no file's
    shape = transformed(ellipsoid((9, 24, 16)), rigid(50, 40, 30))
    facts = Facts("hemisphere", 0.13, 1.07, "ras", "lps")
    with pytest.raises(InputError, check=facts):
        pose_of_hemisphere(shape, "right", "auto")
    with pytest.raises(InputError, check=Facts("brain", 0.13, 1.07)):
        pose_of_surface(shape, "auto")
    pose = pose_of_volume_by_shape(shape, has_sides=False)
    assert np.array_equal(pose.world, np.eye(4))
    assert len(pose.warnings) == 1


def test_surface_of_hemispheres_inside_out_in_any_pose_is_one_brain(halves):
    inside_out = [flipped(half) for half in halves]
    files = both_moved(inside_out, drawn(11), drawn(12))
    surface = from_hemispheres(
        *files, week=24.0, coordinates="auto", edge_length_mm=3.0
    )
    sides = pieces(surface.whole)
    assert [euler_number(side) for side in sides] == [2, 2]
    assert all(signed_volume(side) > 0 for side in sides)
    assert smallest_gap(*sides) > 0.4
    for side, file in zip(SIDES, files, strict=True):
        posed = transformed(file, surface.pose.of_file(side)).vertices
        found = getattr(surface, side).vertices
        assert posed.min(axis=0) == pytest.approx(found.min(axis=0), abs=1.0)
        assert posed.max(axis=0) == pytest.approx(found.max(axis=0), abs=1.0)


def test_doubtful_shapes_are_taken_as_ras_or_refused(halves, monkeypatch):
    # as if another pose of every hemisphere fitted the template nearly as well
    search = template.register_from_all_sides
    monkeypatch.setattr(
        template, "register_from_all_sides", lambda *shapes: (search(*shapes)[0], 1.05)
    )
    pose = pose_of_pair(*both_moved(halves, rigid(9, -14, 12)))
    assert pose.by == "default"
    np.testing.assert_array_equal(pose.of_file("left"), np.eye(4))
    assert pose.warnings[0] == Facts("RAS+", "coordinates")
    with pytest.raises(InputError, check=Facts("left hemisphere", 1.05, 1.07)):
        pose_of_pair(*both_moved(halves, drawn(31)))


TURNS = [(180, 0, 0), (0, 180, 0), (0, 0, 180), (90, 0, 0), (0, 0, -90), (0, 90, 0)]


@pytest.fixture(scope="module")
def brain():
    return phantom(24.0, 2.0)


@pytest.mark.parametrize(
    "lost", [(), (10,), (11, 12)], ids=["nothing", "cerebellum", "brainstem"]
)
def test_sides_and_half_a_hindbrain_tell_a_mirrored_brain_from_a_turned_one(
    brain, lost
):
    labels, affine = odd_brains.add_sides(*brain), brain[1]
    labels = np.where(np.isin(labels, lost), 0, labels)

    def pose_by_labels(*motions):
        return pose_of_labels(labels, np.linalg.multi_dot([*motions, affine]), DHCP)

    for degrees in TURNS:
        turn = rigid(*degrees)
        world = pose_by_labels(turn).world
        np.testing.assert_allclose(world @ turn, np.eye(4), atol=1e-9)
    tilts = [(0, 0, 0), (0, 10, 8), (0, -5, 12)]
    for degrees in tilts:
        assert pose_by_labels(rigid(*degrees)).by == "file"
    for degrees in tilts if lost else tilts + TURNS:
        with pytest.raises(InputError, check=Facts("left", "right", "affine")):
            pose_by_labels(rigid(*degrees), MIRROR)


@pytest.mark.parametrize("degrees", [(0, 0, 0), (90, 0, 0)])
def test_volumes_without_a_hindbrain_are_posed_by_their_shape(degrees):
    turn = rigid(*degrees)
    mesh = transformed(atlas_brain(), turn)
    pose = pose_of_volume_by_shape(mesh, has_sides=False)
    np.testing.assert_allclose(pose.world @ turn, np.eye(4), atol=1e-9)
    warnings = [Facts(f"{max(degrees)}°", "left", "right")] * any(degrees)
    assert list(pose.warnings) == warnings


def test_a_brain_with_a_reversed_axis_may_be_mirrored_and_is_warned_of(brain):
    labels, affine = brain
    warning, *_ = pose_of_labels(labels[:, ::-1], affine, ATLAS).warnings
    assert warning == Facts("180°", "left", "right")
    sided = odd_brains.add_sides(*brain)
    warning, *_ = pose_of_labels(sided, rigid(0, 0, 180) @ affine, DHCP).warnings
    assert warning == Facts("180°")
    assert warning != Facts("left")


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


def test_coordinates_that_are_named_are_kept_and_doubted():
    pose = pose_of_surface(transformed(atlas_brain(), rigid(180, 0, 0)), "ras")
    assert np.array_equal(pose.world[:3, :3], np.eye(3))
    assert re.search(r"1[78]\d° .*\bras\b", pose.warnings[0])
    assert pose_of_surface(atlas_brain(), "ras").warnings == ()


def test_a_brain_that_fits_several_poses_is_taken_as_ras_and_doubted(brain):
    mesh = cerebrum_surface(odd_brains.holoprosencephaly(*brain), brain[1])
    pose = pose_of_surface(mesh, "auto")
    assert pose.by == "default"
    assert pose.warnings[0] == Facts("RAS+", "coordinates")


def test_hemispheres_in_coordinates_that_their_shapes_contradict_are_doubted(halves):
    assert require_coordinates(*halves, "ras") == []
    (doubt,) = require_coordinates(*both_moved(halves, rigid(180, 0, 0)), "ras")
    assert re.search(r"1[78]\d° .*\bras\b", doubt)


def test_exchanged_files_are_refused_though_the_left_one_lies_on_the_left(halves):
    # back to front in the named coordinates; so are mirrored ones, RPS
    right, left = both_moved(halves, LPS)
    require_left_and_right(left, right, "lps")
    facts = Facts("left", "right", "exchanged", "mirrored", "LPS")
    with pytest.raises(InputError, match=r"0\.\d\d .*0\.\d\d ", check=facts) as caught:
        require_coordinates(left, right, "lps")
    assert str(caught.value) == Facts("coordinates: auto", "do not swap")


@pytest.mark.parametrize(
    ("turn", "confidence", "ratios"),
    [
        # of no clear pose; of which one fits both sides; exchanged, but in RAS
        (LPS, 1.05, [0.8, 0.8]),
        (LPS, 1.5, [0.7, 0.95]),
        (np.eye(4), 1.5, [0.8, 0.8]),
    ],
)
def test_odd_shapes_in_named_coordinates_are_doubted_and_measured(
    halves, monkeypatch, turn, confidence, ratios
):
    # as if hemispheres in RAS fitted the other sides better, in axes turned by `turn`:
    # the residual of each shape, then that of its mirror image
    residuals = iter(
        [0.05, 0.05 * ratios[0], 0.05, 0.05 * ratios[1], *[0.05, 0.06] * 2]
    )

    def found(*_):
        fit = RigidFit(turn[:3, :3], np.zeros(3), 0.05 * next(residuals))
        return fit, confidence

    monkeypatch.setattr(template, "register_from_all_sides", found)
    (doubt,) = require_coordinates(*halves, "ras")
    assert doubt == Facts("left", "right", "RAS", "coordinates: auto")
