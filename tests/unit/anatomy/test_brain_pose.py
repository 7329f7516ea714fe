"""Whole brains in any pose: told by their hindbrain, their labelled sides or their shape, or refused."""

import re

import numpy as np
import odd_brains
import pytest
from atlas_brains import atlas_brain, atlas_halves
from shapes import LPS, cerebrum_surface, ellipsoid, phantom, rigid

from gyriflow.anatomy.hindbrain import pose_of_labels
from gyriflow.anatomy.pose import doubts_of_hemispheres, pose_of_surface, pose_of_volume_by_shape
from gyriflow.errors import InputError
from gyriflow.geometry.alignment import angle_deg
from gyriflow.geometry.triangles import transformed
from gyriflow.io.yaml_files import SCHEMES

TURNS = [(180, 0, 0), (0, 180, 0), (0, 0, 180), (90, 0, 0), (0, 0, -90), (0, 90, 0)]


@pytest.fixture(scope="module")
def brain():
    return phantom(24.0, 1.6)


@pytest.mark.fault(49)
@pytest.mark.parametrize("degrees", TURNS)
def test_quarter_turns_of_a_volume_are_undone_exactly(brain, degrees):
    labels, affine = brain
    pose = pose_of_labels(labels, rigid(*degrees) @ affine, SCHEMES["spina-bifida-atlas"])
    assert pose.by == "cerebellum and brainstem"
    np.testing.assert_allclose(pose.world[:3, :3] @ rigid(*degrees)[:3, :3], np.eye(3), atol=1e-9)
    assert "the brain was turned by" in pose.warnings[0]


@pytest.mark.parametrize("degrees", [(0, 0, 0), (5, 0, 0), (-15, 0, 0), (-6, 5, 7)])
def test_small_tilts_are_the_files_own(brain, degrees):
    labels, affine = brain
    pose = pose_of_labels(labels, rigid(*degrees) @ affine, SCHEMES["spina-bifida-atlas"])
    assert (pose.by, pose.warnings) == ("file", ())
    assert np.array_equal(pose.world[:3, :3], np.eye(3))


@pytest.mark.parametrize(
    ("degrees", "angle"), [((25, 0, 0), 25), ((30, 0, 0), 30), ((45, 0, 0), 45), ((0, 45, 0), 45), ((-20, 25, 30), 46)]
)
def test_larger_tilts_are_kept_and_told(brain, degrees, angle):
    labels, affine = brain
    pose = pose_of_labels(labels, rigid(*degrees) @ affine, SCHEMES["spina-bifida-atlas"])
    assert np.array_equal(pose.world[:3, :3], np.eye(3))
    (warning,) = pose.warnings
    said = re.search(r"cerebellum and brainstem say that the brain is turned by about (\d+)°: its mid-plane", warning)
    # the hindbrain of this brain is pitched by 7° against that of the atlas
    assert abs(int(said[1]) - angle) < 8


@pytest.mark.parametrize("lost", [(), (10,), (11, 12)], ids=["nothing", "cerebellum", "brainstem"])
def test_sides_and_half_a_hindbrain_tell_a_mirrored_brain_from_a_turned_one(brain, lost):
    labels, affine = odd_brains.add_sides(*brain), brain[1]
    labels = np.where(np.isin(labels, lost), 0, labels)
    for turn in TURNS:
        pose = pose_of_labels(labels, rigid(*turn) @ affine, SCHEMES["dhcp-19"])
        np.testing.assert_allclose(pose.world[:3, :3] @ rigid(*turn)[:3, :3], np.eye(3), atol=1e-9)
        if not lost:
            with pytest.raises(InputError, match=r"left hemisphere lie on the right.*affine mirrors"):
                pose_of_labels(labels, rigid(*turn) @ np.diag([-1.0, 1, 1, 1]) @ affine, SCHEMES["dhcp-19"])
    for tilt in ((0, 0, 0), (0, 10, 8), (0, -5, 12)):
        assert pose_of_labels(labels, rigid(*tilt) @ affine, SCHEMES["dhcp-19"]).by == "file"
        with pytest.raises(InputError, match=r"left hemisphere lie on the right.*affine mirrors"):
            pose_of_labels(labels, rigid(*tilt) @ np.diag([-1.0, 1, 1, 1]) @ affine, SCHEMES["dhcp-19"])


@pytest.mark.parametrize("degrees", [(0, 0, 0), (0, 0, 180), (90, 0, 0), (0, 180, 0)])
def test_volumes_without_a_hindbrain_are_posed_by_their_shape(degrees):
    mesh = transformed(atlas_brain(), rigid(*degrees))
    pose = pose_of_volume_by_shape(mesh, sided=False)
    np.testing.assert_allclose(pose.world[:3, :3] @ rigid(*degrees)[:3, :3], np.eye(3), atol=1e-9)
    assert ["left and right are exchanged now" in warning for warning in pose.warnings] == [True] * any(degrees)


def test_a_volume_whose_shape_says_no_pose_keeps_its_own_and_is_told():
    # neither front nor back, up nor down, and its axes are no file's
    mesh = transformed(ellipsoid((24, 33, 22)), rigid(50, 40, 30))
    with pytest.raises(InputError, match="cannot be determined from its shape"):
        pose_of_surface(mesh, "auto")
    pose = pose_of_volume_by_shape(mesh, sided=False)
    assert np.array_equal(pose.world, np.eye(4))
    assert "unchecked" in pose.warnings[0]


def test_a_brain_with_a_reversed_axis_may_be_mirrored_and_is_told_so(brain):
    labels, affine = brain
    scheme = SCHEMES["spina-bifida-atlas"]
    assert "left and right are exchanged now" in pose_of_labels(labels[:, ::-1], affine, scheme).warnings[0]
    sided = odd_brains.add_sides(*brain)
    turned = pose_of_labels(sided, rigid(0, 0, 180) @ affine, SCHEMES["dhcp-19"])
    assert "exchanged" not in turned.warnings[0]


@pytest.mark.fault(10)
@pytest.mark.parametrize(
    ("turn", "most_deg", "said"),
    [(np.eye(4), 1e-6, ()), (LPS, 1e-6, ("are LPS",)), (rigid(100, 40, -70), 5.0, ("as its shape says",))],
    ids=["RAS", "LPS", "any"],
)
def test_the_shape_of_a_surface_tells_its_pose(turn, most_deg, said):
    pose = pose_of_surface(transformed(atlas_brain(), turn), "auto")
    assert angle_deg(pose.of_file()[:3, :3] @ turn[:3, :3]) < most_deg
    assert [part in warning for part, warning in zip(said, pose.warnings, strict=True)] == [True] * len(said)


def test_coordinates_that_are_named_are_kept_and_doubted():
    pose = pose_of_surface(transformed(atlas_brain(), rigid(180, 0, 0)), "ras")
    assert np.array_equal(pose.world[:3, :3], np.eye(3))
    assert "turned by 1" in pose.warnings[0]
    assert pose_of_surface(atlas_brain(), "ras").warnings == ()


@pytest.mark.parametrize("pathology", ["without_callosum", "holoprosencephaly", "wide_hemisphere"])
def test_a_brain_that_fits_several_poses_is_taken_as_ras_and_doubted(brain, pathology):
    mesh = cerebrum_surface(getattr(odd_brains, pathology)(*brain), brain[1])
    pose = pose_of_surface(mesh, "auto")
    assert pose.by == "default"
    assert "set coordinates" in pose.warnings[0]


@pytest.mark.fault(9, 10)
def test_hemispheres_in_coordinates_that_their_shapes_contradict_are_doubted():
    left, right = atlas_halves()
    assert doubts_of_hemispheres(left, right, "ras") == []
    # files that are swapped, and in the other one of RAS and LPS: back to front
    about = [transformed(side, LPS) for side in (right, left)]
    (doubt,) = doubts_of_hemispheres(*about, "lps")
    assert "are left and right swapped, and the coordinates not LPS?" in doubt
    (doubt,) = doubts_of_hemispheres(*(transformed(side, rigid(180, 0, 0)) for side in (left, right)), "ras")
    assert "turned by 1" in doubt
