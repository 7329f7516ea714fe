"""The synthetic brain: size, parts, storage order, folds that deepen."""

import nibabel as nib
import numpy as np
import pytest
from scipy import ndimage
from shapes import phantom
from skimage.measure import euler_number

from gyriflow.errors import InputError
from gyriflow.phantom.brain import CENTRE_MM, cerebral_volume_ml, phantom_labels
from gyriflow.phantom.pathologies import CEREBRUM


def test_volume_follows_the_published_growth():
    # the anchors named in the docstring: the atlas at 21 GW, + 230 % from 25.4 to 36.6 GW
    assert cerebral_volume_ml(21.0) == pytest.approx(48.0)
    assert cerebral_volume_ml(36.6) / cerebral_volume_ml(25.4) == pytest.approx(3.3, rel=0.01)


@pytest.mark.parametrize(("week", "voxel_mm"), [(21.0, 0.8), (28.5, 1.2), (36.0, 1.6)])
def test_cerebrum_has_the_volume_of_its_week(week, voxel_mm):
    labels, affine = phantom_labels(week, voxel_mm=voxel_mm)
    volume = np.isin(labels, CEREBRUM).sum() * abs(np.linalg.det(affine[:3, :3])) * 1e-3
    assert volume == pytest.approx(cerebral_volume_ml(week), rel=0.015)


def test_storage_is_not_ras_and_the_brain_is_off_the_origin():
    labels, affine = phantom()
    assert "".join(nib.aff2axcodes(affine)) == "PIR"
    centre = affine[:3, :3] @ np.argwhere(np.isin(labels, CEREBRUM)).mean(axis=0) + affine[:3, 3]
    assert np.abs(centre - CENTRE_MM).max() < 4.0


def test_all_eight_tissues_are_there_in_their_places():
    labels, affine = phantom()
    assert np.unique(labels).tolist() == list(range(9))
    place = {n: affine[:3, :3] @ np.argwhere(labels == n).mean(axis=0) + affine[:3, 3] for n in range(1, 9)}
    # RAS+: the cerebellum is behind and below, the brainstem below, the callosum above the deep grey matter
    assert place[3][1] < place[1][1] - 10
    assert place[3][2] < place[1][2] - 10
    assert place[7][2] < place[6][2] - 10
    assert place[8][2] > place[6][2] + 3


def test_cerebrum_is_one_ball_in_two_hemispheres():
    labels, affine = phantom()
    cerebrum = np.isin(labels, CEREBRUM)
    assert ndimage.label(cerebrum)[1] == 1
    assert euler_number(cerebrum, connectivity=1) == 1
    # the fissure is open from above: at the top of the brain no voxel lies in the middle (axes P, I, R)
    middle = round((CENTRE_MM[0] - affine[0, 3]) / 1.2)
    top = np.argwhere(cerebrum)[:, 1].min()
    assert not cerebrum[:, : top + 5, middle].any()
    assert cerebrum[:, : top + 5, middle + 5].any()
    assert cerebrum[:, : top + 5, middle - 5].any()


def test_cortex_has_the_thickness_asked_for():
    labels, _ = phantom_labels(24.0, voxel_mm=0.8, cortex_mm=3.0)
    cerebrum = np.isin(labels, CEREBRUM)
    depth = ndimage.distance_transform_edt(cerebrum) * 0.8
    assert depth[labels == 5].max() <= 3.0
    assert (labels[cerebrum & (depth <= 2.9)] == 5).mean() > 0.9


def test_folds_deepen_with_age():
    def roughness(week):
        labels, _ = phantom_labels(week, voxel_mm=1.6)
        cerebrum = np.isin(labels, CEREBRUM)
        edge = cerebrum & ~ndimage.binary_erosion(cerebrum)
        return edge.sum() / cerebrum.sum() ** (2 / 3)

    young, middle, old = (roughness(week) for week in (21.0, 29.0, 36.0))
    assert middle > 1.04 * young
    assert old > 1.1 * middle


def test_seed_decides_the_folds():
    labels, _ = phantom()
    assert np.array_equal(phantom_labels(24.0, voxel_mm=1.2)[0], labels)
    other = phantom_labels(24.0, voxel_mm=1.2, seed=1)[0]
    assert other.shape != labels.shape or (other != labels).any()


@pytest.mark.parametrize("week", [20.9, 36.1])
def test_other_weeks_are_refused(week):
    with pytest.raises(InputError, match="21 to 36"):
        phantom_labels(week)
