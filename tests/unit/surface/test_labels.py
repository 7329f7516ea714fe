"""Label schemes: what is unknown, missing or empty is named."""

import numpy as np
import pytest

from gyriflow.errors import InputError
from gyriflow.parameters.schemes import SCHEMES
from gyriflow.surface.labels import cerebrum_mask, require_sides

ATLAS = SCHEMES["spina-bifida-atlas"]


def test_cerebrum_leaves_out_cerebellum_csf_and_brainstem():
    labels = np.arange(9).reshape(1, 3, 3)
    assert labels[cerebrum_mask(labels, ATLAS)].tolist() == [1, 2, 5, 6, 8]


@pytest.mark.parametrize("scheme", SCHEMES.values(), ids=SCHEMES)
def test_schemes_name_only_labels_that_they_have(scheme):
    named = {*scheme.cerebrum, *scheme.cortex, *scheme.left, *scheme.right}
    assert named <= set(scheme.labels)
    assert set(scheme.cortex) <= set(scheme.cerebrum)
    assert not set(scheme.left) & set(scheme.right)
    assert len(scheme.left) == len(scheme.right)


def test_unknown_labels_are_named_beside_the_known():
    labels = np.arange(11).reshape(1, 1, 11)
    with pytest.raises(InputError, match=r"does not know; found 9, 10 among.*5 cortex"):
        cerebrum_mask(labels, ATLAS)


def test_missing_tissues_are_named():
    labels = np.array([[[0, 1, 2, 3, 4, 6, 7]]])
    with pytest.raises(InputError, match=r"missing.*also 5 cortex, 8 corpus callosum"):
        cerebrum_mask(labels, ATLAS)


@pytest.mark.parametrize("labels", [[0, 0], [3, 4]])
def test_volume_without_cerebrum_is_refused_by_tissue(labels):
    with pytest.raises(InputError, match=r"no voxel belongs to the cerebrum.*1 white matter"):
        cerebrum_mask(np.array([[labels]]), ATLAS)


def test_labels_of_the_left_on_the_right_are_refused():
    scheme = SCHEMES["dhcp-19"]
    labels = np.zeros((4, 1, 1), dtype=int)
    labels[0], labels[3] = 3, 4
    require_sides(labels, scheme, np.eye(4), np.array([1.0, 0, 0]))
    with pytest.raises(InputError, match="left hemisphere lie on the right"):
        require_sides(labels, scheme, np.diag([-1.0, 1, 1, 1]), np.array([1.0, 0, 0]))
