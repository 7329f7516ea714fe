"""Label schemes: what is unknown, missing or empty is named."""

import numpy as np
import pytest

from gyriflow.anatomy.hindbrain import pose_of_labels
from gyriflow.anatomy.labels import cerebrum_mask, require_cortex_outside, require_sides
from gyriflow.errors import InputError
from gyriflow.io.volumes import read_label_volume
from gyriflow.io.yaml_files import SCHEMES
from gyriflow.shipped import SHIPPED

ATLAS = SCHEMES["spina-bifida-atlas"]


@pytest.mark.parametrize("scheme", SCHEMES.values(), ids=SCHEMES)
def test_schemes_name_only_labels_that_they_have(scheme):
    inside = {*scheme.cortex, *scheme.left, *scheme.right, *scheme.white_matter, *scheme.ventricles}
    outside = {*scheme.cerebellum, *scheme.brainstem}
    named = {*scheme.cerebrum, *inside, *outside}
    assert named <= set(scheme.labels)
    assert inside <= set(scheme.cerebrum)
    assert not outside & set(scheme.cerebrum)
    assert not set(scheme.cortex) & {*scheme.white_matter, *scheme.ventricles}
    assert not set(scheme.left) & set(scheme.right)
    assert len(scheme.left) == len(scheme.right)


@pytest.mark.fault(7)
def test_unknown_labels_are_named_beside_the_known():
    labels = np.arange(11).reshape(1, 1, 11)
    with pytest.raises(InputError, match=r"does not know; found 9, 10 among.*5 cortex"):
        cerebrum_mask(labels, ATLAS)


@pytest.mark.fault(7)
@pytest.mark.parametrize(("label", "tissue"), [(5, "cortex"), (1, "white matter")])
def test_cortex_and_white_matter_are_required_by_name(label, tissue):
    labels = np.array([[[n for n in range(9) if n != label]]])
    with pytest.raises(InputError, match=f"the {tissue} of the scheme .* is missing.*{label} {tissue}"):
        cerebrum_mask(labels, ATLAS)


def test_transient_zones_stand_for_white_matter():
    # CRL's volumes have white matter at late weeks only
    labels = np.array([[[112, 113, 114, 115, 92, 93]]])
    assert cerebrum_mask(labels, SCHEMES["crl"]).all()


@pytest.mark.fault(44)
def test_a_scheme_whose_cortex_lies_inside_is_another_volumes():
    labels = np.full((9, 9, 9), 1)
    labels[2:7, 2:7, 2:7] = 5
    with pytest.raises(InputError, match="does not lie around what it calls the cerebrum; found cortex at 0 %"):
        require_cortex_outside(labels, ATLAS)
    assert require_cortex_outside(6 - labels, ATLAS) == 1.0
    # single voxels that are missing inside are no surface
    brain = np.full((21, 21, 21), 5)
    brain[2:-2, 2:-2, 2:-2] = 1
    brain[4:-4:3, 4:-4:3, 4:-4:3] = 0
    assert require_cortex_outside(brain, ATLAS) == 1.0


@pytest.mark.fault(8)
@pytest.mark.parametrize("labels", [[0, 0], [3, 4]])
def test_volume_without_cerebrum_is_refused_by_tissue(labels):
    with pytest.raises(InputError, match=r"no voxel belongs to the cerebrum.*1 white matter"):
        cerebrum_mask(np.array([[labels]]), ATLAS)


@pytest.mark.fault(42)
def test_labels_of_the_left_on_the_right_are_refused():
    scheme = SCHEMES["dhcp-19"]
    labels = np.zeros((4, 1, 1), dtype=int)
    labels[0], labels[3] = 3, 4
    require_sides(labels, scheme, np.eye(4), np.array([1.0, 0, 0]))
    with pytest.raises(InputError, match="left hemisphere lie on the right"):
        require_sides(labels, scheme, np.diag([-1.0, 1, 1, 1]), np.array([1.0, 0, 0]))


@pytest.fixture(scope="module")
def feta():
    """The shipped atlas' brain of 25 GW in the labels of FeTA."""
    volume = read_label_volume(SHIPPED / "atlases/spina-bifida/fetal_SB_atlas_GA25_notoperated/parcellation.nii.gz")
    return np.array([0, 3, 4, 5, 1, 2, 6, 7, 3])[volume.labels], volume.affine


def test_sides_that_are_no_hemispheres_are_another_schemes(feta):
    with pytest.raises(InputError, match=r"'dhcp-19' calls left and right are no hemispheres.*found .* 49 % of pairs"):
        require_sides(feta[0], SCHEMES["dhcp-19"], feta[1], np.array([1.0, 0, 0]))


def test_a_hindbrain_inside_the_cerebrum_is_another_schemes(feta):
    assert pose_of_labels(*feta, SCHEMES["feta-7"]).by == "file"
    with pytest.raises(InputError, match=r"'drawem-9' calls the cerebellum lies inside"):
        pose_of_labels(*feta, SCHEMES["drawem-9"])
