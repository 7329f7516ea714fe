"""Left and right from labels that have sides, and the volume that smoothing gives
back."""

import numpy as np
import odd_brains
import pytest
from facts import Facts
from phantoms import CENTRE_MM
from shapes import phantom, rigid, sphere

from gyriflow.anatomy.pial import from_labels
from gyriflow.anatomy.repair import pieces, with_volume
from gyriflow.errors import InputError
from gyriflow.geometry.deformations import transform_points
from gyriflow.geometry.remeshing import self_intersecting_faces
from gyriflow.geometry.triangles import area, corners, face_areas, merged, signed_volume
from gyriflow.io.yaml_files import SCHEMES
from gyriflow.settings.schemes import LabelScheme

pytestmark = pytest.mark.usefixtures("few_starts", "quick_poses")
SIDED = LabelScheme(
    name="sided", cerebrum=(1, 2, 3, 4, 5), cortex=(3, 4), left=(1, 3), right=(2, 4)
)


def test_hemispheres_are_parted_where_the_labels_of_the_sides_meet():
    # at a surface bent by 4 mm, cortex on both sides of it and no gap between: the
    # phantom's own fissure is filled
    labels, affine = phantom(24.0, 1.6)
    x, y, _ = odd_brains.positions(labels, affine)
    gap = (np.abs(x) < 3.0) & (labels == 4)
    right, cortex = x > 4.0 * np.sin(y / 12.0), (labels == 5) | gap
    sided = np.where(
        np.isin(labels, odd_brains.CEREBRUM) | gap, np.where(cortex, 3, 1) + right, 0
    )
    sided[labels == 2] = 5
    surface = from_labels(sided, affine, SIDED, week=24.0, edge_length_mm=2.0)
    to_file = np.linalg.inv(surface.pose.world)
    for part, sign in ((surface.left, -1), (surface.right, 1)):
        places = transform_points(corners(part).mean(axis=1), to_file) - CENTRE_MM
        wrong = sign * (places[:, 0] - 4.0 * np.sin(places[:, 1] / 12.0)) < -1.2
        assert face_areas(part)[wrong].sum() < 0.005 * area(part)


def test_a_side_of_a_few_voxels_is_no_hemisphere():
    labels, affine = phantom(21.0, 2.0)
    scheme, sided = SCHEMES["dhcp-19"], odd_brains.add_sides(labels, affine)
    left = np.argwhere(np.isin(sided, scheme.left))
    # all but the 40 voxels farthest to the left become the right hemisphere's
    outermost = left[np.argsort(left @ affine[0, :3])][40:]
    sided[tuple(outermost.T)] = dict(zip(scheme.left, scheme.right, strict=True))[3]
    with pytest.raises(InputError, match=r"\d\.\d\d .*\d\d\.\d\d cm²", check=Facts(15)):
        from_labels(sided, affine, scheme, week=21.0, edge_length_mm=3.0)


def test_walls_that_would_cut_are_held_back_while_the_rest_takes_the_volume():
    one = sphere(20.0, 3)
    shift = np.array([2 * one.vertices[:, 0].max() + 0.1, 0.0, 0.0])
    balls = merged(*(sphere(20.0, 3, k * shift) for k in (0, 1)))
    wider, report = with_volume(balls, 1.02 * signed_volume(balls), area(balls))
    assert report["volume_change"] == pytest.approx(0.0, abs=1e-4)
    assert not self_intersecting_faces(wider).any()
    still = np.all(wider.vertices == balls.vertices, axis=1)
    assert 0 < still.mean() < 0.2
    # at the place where the balls nearly touch
    assert np.abs(balls.vertices[still, 0] - shift[0] / 2).max() < 5.0


def test_a_piece_beside_a_hemisphere_is_left_out_with_its_place():
    labels, affine = phantom(28.0, 2.0)
    labels = odd_brains.add_sides(odd_brains.apart(labels, affine), affine)
    place = np.array([-55.0, 0.0, 0.0])
    labels = np.pad(labels, 15)
    affine = affine @ rigid(shift=(-15.0, -15.0, -15.0))
    from_place = odd_brains.positions(labels, affine) - place[:, None, None, None]
    distance = np.linalg.norm(from_place, axis=0)
    labels[distance < 9.2] = 3
    labels[distance < 7.2] = 5
    # the place is told in the coordinates of the file, which lies on its back
    to_file = rigid(90.0, 0.0, 0.0, shift=(0.0, 90.0, 0.0))
    surface = from_labels(
        labels, to_file @ affine, SCHEMES["dhcp-19"], week=28.0, edge_length_mm=2.5
    )
    x, y, z = transform_points((place + CENTRE_MM)[None], to_file)[0].round()
    facts = Facts("left", "2 pieces", f"({x:.0f}, {y:.0f}, {z:.0f})")
    assert facts in surface.report["warnings"]
    assert surface.report["pieces"] == 2
    assert [len(pieces(side)) for side in (surface.left, surface.right)] == [1, 1]
    assert surface.whole.vertices[:, 0].min() > -45.0 + CENTRE_MM[0]
