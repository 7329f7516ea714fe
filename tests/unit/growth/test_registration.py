"""Registration of brains by their labels, and when it is refused."""

from dataclasses import replace

import numpy as np
import pytest
from facts import Facts
from scipy.ndimage import binary_dilation, gaussian_filter, morphological_gradient
from shapes import LPS

from gyriflow.errors import InputError
from gyriflow.geometry.deformations import Deformation, carry, transform_points
from gyriflow.growth import registration
from gyriflow.growth.registration import (
    Channels,
    _common_channels,
    _measure_quality,
    channels,
    perturb_labels,
    register,
    require_good,
)

CORTEX, WHITE = 2, 1
VOXEL_MM = 1.25
SHAPE = (53, 63, 53)
AT_MM = np.array([4.0, -3.0, 2.0])
"""Centre of the later brain."""


def not_grown(points: np.ndarray) -> np.ndarray:
    """Return where points of the later brain were in the earlier one: smaller, shorter
    in front, not bent."""
    out = points - AT_MM
    z = out[:, 2] / 1.08
    x = (out[:, 0] - 2.0 * np.sin(z / 4)) / 1.10
    return np.stack([x, (out[:, 1] - 1.5 * np.sin(x / 10)) / 1.14, z], axis=1)


def beyond_rim(points: np.ndarray) -> np.ndarray:
    """Return how far points are outside an egg with a bump on the right and a dent on
    the left, in its radii."""
    x, y, z = points.T
    angle = np.arctan2(y, x)
    radius = np.sqrt((x / 16) ** 2 + (y / 22) ** 2 + (z / 14) ** 2)
    bumps = 0.12 * np.cos(angle) + 0.08 * np.sin(3 * angle) + 0.05 * z / 14
    return radius - (1.0 + bumps)


def grid(turn=None, at=(0.0, 0.0, 0.0)) -> np.ndarray:
    """Return the affine of a volume around a place."""
    affine = np.eye(4)
    affine[:3, :3] = VOXEL_MM * (np.eye(3) if turn is None else turn)
    affine[:3, 3] = at - affine[:3, :3] @ ((np.array(SHAPE) - 1) / 2)
    return affine


def egg(affine: np.ndarray, *, later: bool) -> np.ndarray:
    """Return the labels of the egg with a cortex of 3 mm in a volume."""
    points = transform_points(np.indices(SHAPE).reshape(3, -1).T, affine)
    depth = beyond_rim(not_grown(points) if later else points)
    labels = np.select([depth < -0.18, depth < 0], [WHITE, CORTEX], 0)
    return labels.reshape(SHAPE)


def brain(labels: np.ndarray, affine: np.ndarray, **more) -> Channels:
    return channels(labels, affine, cerebrum=(WHITE, CORTEX), cortex=(CORTEX,), **more)


EARLIER_LABELS = egg(grid(), later=False)
EARLIER = brain(EARLIER_LABELS, grid())


@pytest.fixture(scope="module")
def later() -> Channels:
    # stored with its axes in another order, one of them backwards
    turned = grid(np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), AT_MM)
    return brain(egg(turned, later=True), turned)


@pytest.fixture(scope="module")
def found(later):
    return register(EARLIER, later)


def rim_points() -> np.ndarray:
    index = np.indices(EARLIER.tissue.shape).reshape(3, -1).T
    points = transform_points(index, EARLIER.affine)
    return points[np.abs(beyond_rim(points)) < 0.02]


def rim_errors(carried_points: np.ndarray) -> np.ndarray:
    """Return how far points of the earlier brain's rim end from the later brain's rim,
    in mm.

    Along the rim, and inside, the egg is all alike, and shows no one where it went.
    """
    return 17.0 * np.abs(beyond_rim(not_grown(carried_points)))


def test_the_rim_comes_to_where_it_grew(found):
    errors = rim_errors(carry(found.deformation, rim_points()))
    by_affine = rim_errors(transform_points(rim_points(), found.deformation.matrix))
    assert errors.mean() < 0.4 * VOXEL_MM
    assert errors.mean() < 0.8 * by_affine.mean()
    assert found.turned_deg == 0


def test_a_brain_in_another_pose_is_turned_first():
    affine = grid(at=AT_MM)
    found = register(EARLIER, brain(egg(affine, later=True), LPS @ affine))
    assert found.turned_deg == pytest.approx(180)
    turned_back = carry(found.deformation, rim_points()) @ LPS[:3, :3]
    assert rim_errors(turned_back).mean() < 0.4 * VOXEL_MM


def test_a_failed_registration_is_refused_with_numbers(later):
    shape = (*EARLIER.tissue.shape, 3)
    none = Deformation(np.eye(4), np.zeros(shape), EARLIER.affine)
    quality = _measure_quality(EARLIER, later, none)
    facts = Facts("21-22", 0.95, 0.6)
    with pytest.raises(InputError, match=r"0\.7\d+ .*0\.2\d+ ", check=facts):
        require_good(quality, pair="21-22")


def test_a_map_that_folds_is_refused(later, found):
    quality = _measure_quality(EARLIER, later, found.deformation)
    assert quality["volume_ratio"] == pytest.approx(1.10 * 1.14 * 1.08, rel=0.05)
    require_good(quality, pair="21-22")
    displacement = found.deformation.displacement.copy()
    displacement[18:21] += [8.0, 0.0, 0.0]
    folded = replace(found.deformation, displacement=displacement)
    quality = _measure_quality(EARLIER, later, folded)
    assert quality["least_determinant"] < 0
    with pytest.raises(InputError, check=Facts("21-22", "0.50%")):
        require_good(quality, pair="21-22")


@pytest.mark.parametrize(
    ("change", "facts"),
    [
        ({}, None),
        ({"dice_cerebrum": 0.949}, ["cerebrum", 0.949, 0.95]),
        ({"dice_cortex": 0.599}, ["cortex", 0.599, 0.6]),
        ({"folded_share": 0.0051}, ["0.51%", "0.50%"]),
        # without cortex
        ({"dice_cortex": float("nan")}, None),
    ],
)
def test_a_registration_is_good_within_its_limits(change, facts, caplog):
    quality = {"dice_cerebrum": 0.951, "dice_cortex": 0.601, "folded_share": 0.0049}
    quality |= change
    require_good(quality, pair="21-22", only_warn=True)
    assert caplog.messages == ([] if facts is None else [Facts("21-22", *facts)])
    if facts is None:
        require_good(quality, pair="21-22")
    else:
        with pytest.raises(InputError, check=Facts("21-22", *facts)):
            require_good(quality, pair="21-22")


def test_perturbed_labels_differ_at_boundaries_only_and_by_their_seed():
    labels = np.zeros((40, 40, 40), np.uint8)
    labels[8:32, 8:32, 8:32] = 2
    labels[14:26, 14:26, 14:26] = 7
    found = perturb_labels(labels, 1, "a")
    assert np.array_equal(found, perturb_labels(labels, 1, "a"))
    assert set(np.unique(found)) == {0, 2, 7}
    near = binary_dilation(morphological_gradient(labels, 3) > 0, iterations=2)
    assert np.array_equal(found[~near], labels[~near])
    assert 0.02 < (found != labels)[near].mean() < 0.2
    # errors of two brains, or of two members, are independent
    for other in (perturb_labels(labels, 2, "a"), perturb_labels(labels, 1, "b")):
        errors = [(each != labels).ravel() for each in (found, other)]
        assert abs(np.corrcoef(*errors)[0, 1]) < 0.5


@pytest.mark.parametrize(("axis", "is_first"), [(0, True), (2, False)])
def test_a_cerebrum_at_the_edge_of_the_volume_is_refused(axis, is_first):
    labels = np.zeros((20, 22, 24), np.uint8)
    labels[6:14, 6:14, 6:14] = WHITE
    channels(labels, np.eye(4), cerebrum=(WHITE,))
    at_end = np.roll(labels, -6 if is_first else labels.shape[axis] - 14, axis)
    place = f"{'ijk'[axis]} = {0 if is_first else 'last'}"
    with pytest.raises(InputError, check=Facts("64 voxels", place)):
        channels(at_end, np.eye(4), cerebrum=(WHITE,))


def test_images_are_compared_where_both_brains_have_one():
    image = 700.0 * gaussian_filter((EARLIER_LABELS > 0).astype(float), 1)
    shown = brain(EARLIER_LABELS, grid(), image=(image, grid()))
    bright = np.quantile(shown.intensity[shown.tissue > 0], 0.99)
    assert bright == pytest.approx(1.0, abs=0.01)
    assert list(_common_channels(shown, EARLIER)) == ["cerebrum", "cortex"]
    both = _common_channels(shown, shown)
    assert list(both) == ["cerebrum", "cortex", "intensity"]
    with pytest.raises(InputError, check=Facts("0%", "99 %", 0)):
        brain(EARLIER_LABELS, grid(), image=(0 * image, grid()))


class Stopping:
    """Stands for greedy and stops at the deformation, whose command it keeps."""

    command = ""

    def execute(self, command: str, **images) -> None:
        if " -o warp" in command:
            Stopping.command = command
            raise RuntimeError("stopped")


@pytest.mark.parametrize(
    ("voxel_mm", "iterations"), [(0.8, "60x30x8"), (1.0, "60x40x15")]
)
def test_voxels_below_a_millimetre_take_fewer_rounds(monkeypatch, voxel_mm, iterations):
    for name in ("Greedy3D", "GreedyFloat3D"):
        monkeypatch.setattr(registration, name, Stopping)
    affine = EARLIER.affine @ np.diag([*3 * [voxel_mm / EARLIER.voxel_mm], 1.0])
    brain = replace(EARLIER, affine=affine)
    with pytest.raises(InputError, match="stopped"):
        register(brain, brain)
    assert f"-n {iterations} " in Stopping.command
