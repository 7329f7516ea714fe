"""One hemisphere alone: posed by its file or its shape, of the side that it is said to
be, or refused."""

import numpy as np
import odd_brains
import pytest
from atlas_brains import atlas_halves
from facts import Facts
from shapes import LPS, cerebrum_surface, inner, phantom, rigid

from gyriflow.anatomy.pial import from_hemispheres, from_labels, from_surface
from gyriflow.anatomy.thickness import thickness_from_white
from gyriflow.errors import InputError
from gyriflow.geometry.alignment import angle_deg
from gyriflow.geometry.deformations import transform_points
from gyriflow.geometry.triangles import transformed
from gyriflow.io.yaml_files import SCHEMES
from gyriflow.settings.terms import SIDES

QUICK = {"week": 24.0, "edge_length_mm": 3.0}
DHCP = SCHEMES["dhcp-19"]
pytestmark = pytest.mark.usefixtures("few_starts")


@pytest.fixture(scope="module")
def brain():
    return phantom(24.0, 2.0)


@pytest.fixture(scope="module")
def sides(brain):
    halves = {side: odd_brains.one_hemisphere(*brain, side) for side in SIDES}
    return {side: cerebrum_surface(half, brain[1]) for side, half in halves.items()}


@pytest.fixture(scope="module")
def labelled(brain):
    """The brain with labels of both sides, and its affine."""
    return odd_brains.add_sides(*brain), brain[1]


@pytest.mark.parametrize(
    ("side", "degrees", "by"),
    [
        ("left", (0, 0, 0), "file"),
        ("right", (0, 0, 180), "file"),
        ("left", (10, 170, -20), "shape"),
    ],
)
def test_a_hemisphere_in_any_pose_is_posed(sides, side, degrees, by):
    turn = rigid(*degrees)
    surface = from_surface(
        transformed(sides[side], turn), side, coordinates="auto", **QUICK
    )
    assert surface.pose.by == by
    rest = surface.pose.of_file()[:3, :3] @ turn[:3, :3]
    assert angle_deg(rest) < 5.0
    found = {"left": surface.left, "right": surface.right}
    assert found.pop(side) is surface.whole
    assert [*found.values()] == [None]
    x = surface.whole.vertices[:, 0] - surface.fissure_x_mm
    nearest = x.min() if side == "right" else -x.max()
    assert nearest == pytest.approx(0.5, abs=0.01)


def test_the_other_side_and_a_whole_brain_are_refused(brain):
    with pytest.raises(InputError, match=r"0\.\d\d ", check=Facts("right", 1)):
        from_surface(atlas_halves()[1], "left", coordinates="auto", **QUICK)
    with pytest.raises(InputError, match=r"0\.[67]\d ", check=Facts(0.56)):
        from_surface(cerebrum_surface(*brain), "left", coordinates="auto", **QUICK)


def test_labels_of_one_hemisphere_are_a_brain_of_one_side_and_no_whole_one(
    brain, labelled
):
    left, affine = odd_brains.one_hemisphere(*labelled, "left"), brain[1]
    # its axes are those of LPS, by its shape
    lps = rigid(0, 0, 180) @ affine
    surface = from_labels(left, lps, DHCP, "left", **QUICK)
    assert Facts("LPS") in surface.report["warnings"]
    world = surface.pose.world @ lps
    voxels = transform_points(np.argwhere(np.isin(left, DHCP.cerebrum)), world)
    vertices = surface.whole.vertices
    assert vertices.min(axis=0) == pytest.approx(voxels.min(axis=0), abs=2.0)
    assert vertices.max(axis=0) == pytest.approx(voxels.max(axis=0), abs=2.0)
    volume = surface.report["label_volumes_mL"]["cerebrum"]
    assert surface.report["volume_mL"] == pytest.approx(volume, rel=0.01)
    with pytest.raises(InputError, check=Facts("right")):
        from_labels(left, affine, DHCP, "right", **QUICK)
    with pytest.raises(InputError, check=Facts("left hemisphere")):
        from_labels(left, affine, DHCP, **QUICK)
    unsided = odd_brains.one_hemisphere(*brain, "left")
    with pytest.raises(InputError, match=r"0\.[34]\d ", check=Facts(0.5)):
        from_labels(unsided, affine, SCHEMES["spina-bifida-atlas"], **QUICK)


def test_a_whole_brain_whose_cortex_has_the_labels_of_one_side_is_reported(labelled):
    labels, affine = labelled
    left, right = DHCP.cortex
    for kept, lost, side in ((left, right, "left"), (right, left, "right")):
        merged = np.where(labels == lost, kept, labels)
        with pytest.raises(InputError, check=Facts(f"{side} hemisphere", "scheme")):
            from_labels(merged, affine, DHCP, **QUICK)


def test_white_surfaces_give_the_thickness_in_any_pose(sides):
    moved = {side: transformed(mesh, LPS) for side, mesh in sides.items()}
    surface = from_hemispheres(*moved.values(), coordinates="lps", **QUICK)
    whites = {side: inner(mesh, 1.5) for side, mesh in moved.items()}
    posed = surface.whole, surface.pose, surface.fissure_x_mm
    thickness = thickness_from_white(*posed, whites)
    assert thickness.report["mean_mm"] == pytest.approx(1.5, abs=0.15)
    assert thickness.is_measured.mean() > 0.98
