"""Elastic stretch that is kept, packed and relaxed."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gyriflow.folding.memory import left_stretch, packed, relaxed, unpacked, unstretched

RANDOM = np.random.default_rng(5)
STRETCH = np.eye(3) + 0.1 * (lambda a: a + a.T)(RANDOM.standard_normal((3, 3)))


def test_packing_keeps_symmetric_tensors():
    np.testing.assert_array_equal(unpacked(packed(STRETCH[None]))[0], STRETCH)
    np.testing.assert_array_equal(unpacked(unstretched(4, 2)), np.tile(np.eye(3), (4, 2, 1, 1)))


def test_a_rotation_is_forgotten_and_the_stretch_kept():
    turn = Rotation.from_rotvec([0.3, -0.8, 0.5]).as_matrix()
    np.testing.assert_allclose(left_stretch((STRETCH @ turn)[None])[0], STRETCH, rtol=1e-12)


def test_logarithmic_strain_decays_exponentially():
    stretch = np.diag([1.2, 0.9, 1.0])[None]
    after = relaxed(relaxed(stretch, 0.5, 2.0), 1.5, 2.0)
    np.testing.assert_allclose(np.log(np.diag(after[0])), np.exp(-1.0) * np.log([1.2, 0.9, 1.0]), atol=1e-14)


def test_with_infinite_memory_nothing_relaxes_and_with_little_all_does():
    assert relaxed(STRETCH[None], 1.0, np.inf)[0] == pytest.approx(STRETCH)
    np.testing.assert_allclose(relaxed(STRETCH[None], 1.0, 1e-3)[0], np.eye(3), atol=1e-14)
