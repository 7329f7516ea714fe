"""Fits of outlines that differ by more than a motion."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gyriflow.anatomy.outlines import Target, reference, register, register_deformed
from gyriflow.geometry.alignment import angle_deg
from gyriflow.geometry.triangles import unit


def bent(outline, seed):
    """Returns an outline after a random quadratic deformation by some percent, without what of it is a motion."""
    random = np.random.default_rng(seed)
    stretch, bend = random.normal(0, 0.04, (3, 3)), random.normal(0, 0.04, (3, 3, 3))
    bend = bend + bend.transpose(0, 2, 1)
    points = outline.points
    there = points + points @ stretch.T + 0.5 * np.einsum("ijk,nj,nk->ni", bend, points, points)
    gradient = np.eye(3) + stretch + np.einsum("ijk,nk->nij", bend, points)
    normals = unit(np.einsum("nji,nj->ni", np.linalg.inv(gradient), outline.normals))
    middle = points.mean(axis=0)
    back, _ = Rotation.align_vectors(points - middle, there - there.mean(axis=0))
    return replace(outline, points=back.apply(there - there.mean(axis=0)) + middle, normals=back.apply(normals))


@pytest.mark.parametrize("seed", [1, 3, 6])
def test_a_deformation_turns_a_match_less_than_it_turns_nearest_places(seed):
    one, other = Target(reference()), Target(bent(reference(), seed))
    start = Rotation.from_rotvec([3, -4, 5], degrees=True).as_matrix()
    nearest = register(one.outline, other, start)
    assert angle_deg(nearest.rotation) > 0.9
    assert angle_deg(register_deformed(one, other, start).rotation) < 0.85 * angle_deg(nearest.rotation)


def test_a_match_of_moved_outlines_is_the_motion():
    outline = reference()
    motion = Rotation.from_rotvec([20, -30, 40], degrees=True)
    moved = replace(
        outline, points=motion.apply(outline.points) + [0.1, 0.0, -0.2], normals=motion.apply(outline.normals)
    )
    start = Rotation.from_rotvec([24, -28, 36], degrees=True).as_matrix()
    fit = register_deformed(Target(outline), Target(moved), start)
    np.testing.assert_allclose(fit.rotation, motion.as_matrix(), atol=1e-3)
    np.testing.assert_allclose(fit.shift, [0.1, 0.0, -0.2], atol=1e-3)
