from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter
from shapes import LPS

from gyriflow.errors import InputError
from gyriflow.geometry.deformations import Deformation, carry, transform_points
from gyriflow.growth.channels import Channels, channels
from gyriflow.growth.diffeomorphic import register
from gyriflow.growth.registration_quality import judge, require_good
from gyriflow.io.registrations import read_correspondence, write_correspondence

VOXEL = 1.0
CORTEX, WHITE, OTHER = 2, 1, 7


def grown(points: np.ndarray) -> np.ndarray:
    """Return where points of the earlier phantom are in the later one: larger, longer in front, bent, moved."""
    x, _, z = points.T
    out = points * [1.10, 1.14, 1.08]
    out[:, 0] += 2.0 * np.sin(z / 4)
    out[:, 1] += 1.5 * np.sin(x / 10)
    return out + [4.0, -3.0, 2.0]


def not_grown(points: np.ndarray) -> np.ndarray:
    out = points - [4.0, -3.0, 2.0]
    z = out[:, 2] / 1.08
    x = (out[:, 0] - 2.0 * np.sin(z / 4)) / 1.10
    return np.stack([x, (out[:, 1] - 1.5 * np.sin(x / 10)) / 1.14, z], axis=1)


def beyond_rim(points: np.ndarray) -> np.ndarray:
    """Return how far points are outside an egg with a bump on the right and a dent on the left, in its radii."""
    x, y, z = points.T
    angle = np.arctan2(y, x)
    radius = np.sqrt((x / 16) ** 2 + (y / 22) ** 2 + (z / 14) ** 2)
    return radius - (1.0 + 0.12 * np.cos(angle) + 0.08 * np.sin(3 * angle) + 0.05 * z / 14)


def phantom(points: np.ndarray) -> np.ndarray:
    """Return the labels at points: the egg with a cortex of 3 mm."""
    labels = np.where(beyond_rim(points) < 0, CORTEX, 0)
    return np.where(beyond_rim(points) < -0.18, WHITE, labels)


def volume(affine: np.ndarray, *, later: bool, shape=(66, 78, 66)) -> np.ndarray:
    points = transform_points(np.indices(shape).reshape(3, -1).T, affine)
    return phantom(not_grown(points) if later else points).reshape(shape)


def centred(shape=(66, 78, 66), turn: np.ndarray | None = None, at=(0.0, 0.0, 0.0)) -> np.ndarray:
    affine = np.eye(4)
    affine[:3, :3] = VOXEL * (np.eye(3) if turn is None else turn)
    affine[:3, 3] = at - affine[:3, :3] @ ((np.array(shape) - 1) / 2)
    return affine


def made(affine: np.ndarray, *, later: bool) -> Channels:
    return channels(volume(affine, later=later), affine, cerebrum=(WHITE, CORTEX), cortex=(CORTEX,))


@pytest.fixture(scope="module")
def pair() -> tuple[Channels, Channels]:
    # the later volume is stored with its axes in another order, one of them backwards
    turned = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    return made(centred(), later=False), made(centred(turn=turned, at=(4.0, -3.0, 2.0)), later=True)


@pytest.fixture(scope="module")
def found(pair):
    return register(*pair)


RIM_MM = 17.0
"""Mean radius of the phantom."""


def rim_errors(carried_points: np.ndarray) -> np.ndarray:
    """Return how far points of the earlier brain's rim end from the later brain's rim, in mm.

    Along the rim, and inside, the phantom is all alike, and shows no one where it went.
    """
    return RIM_MM * np.abs(beyond_rim(not_grown(carried_points)))


def rim_points(brain: Channels) -> np.ndarray:
    grid = transform_points(np.indices(brain.tissue.shape).reshape(3, -1).T, brain.affine)
    return grid[np.abs(beyond_rim(grid)) < 0.02]


def test_the_rim_comes_to_where_it_grew(pair, found):
    points = rim_points(pair[0])
    errors = rim_errors(carry(found.deformation, points))
    by_affine = rim_errors(transform_points(points, found.deformation.matrix))
    assert errors.mean() < 0.4 * VOXEL
    assert errors.mean() < 0.6 * by_affine.mean()
    assert found.turned_deg == 0


def test_quality_of_a_good_registration(pair, found):
    quality = judge(*pair, found.deformation)
    assert quality.dice_cerebrum > 0.97
    assert quality.dice_cortex > 0.85
    assert quality.folded_share == 0
    assert quality.volume_ratio == pytest.approx(1.10 * 1.14 * 1.08, rel=0.05)
    require_good(quality, pair="21-22")


def test_a_brain_in_another_pose_is_turned_first(pair):
    affine = centred(at=(4.0, -3.0, 2.0))
    labels = volume(affine, later=True)
    later = channels(labels, LPS @ affine, cerebrum=(WHITE, CORTEX), cortex=(CORTEX,))
    found = register(pair[0], later)
    assert found.turned_deg == pytest.approx(180)
    turned_back = carry(found.deformation, rim_points(pair[0])) @ LPS[:3, :3]
    assert rim_errors(turned_back).mean() < 0.4 * VOXEL


def test_a_failed_registration_is_refused_with_numbers(pair):
    none = Deformation(np.eye(4), np.zeros((*pair[0].tissue.shape, 3)), pair[0].affine)
    quality = judge(*pair, none)
    with pytest.raises(InputError, match=r"registration week 21 to 22 has failed: Dice of the cerebrum 0\.\d+ below"):
        require_good(quality, pair="week 21 to 22")


def test_a_map_that_folds_is_refused(pair, found):
    displacement = found.deformation.displacement.copy()
    displacement[22:25] += [8.0, 0.0, 0.0]
    folded = Deformation(found.deformation.matrix, displacement, found.deformation.affine)
    quality = judge(*pair, folded)
    assert quality.least_determinant < 0
    assert quality.folded_share > 0.005
    with pytest.raises(InputError, match="the map folds in"):
        require_good(quality, pair="21-22")


def test_a_cerebrum_at_the_edge_of_the_volume_is_refused():
    affine = centred()
    with pytest.raises(InputError, match=r"cut by the edge of the volume.*i = 0"):
        channels(volume(affine, later=False)[21:], affine, cerebrum=(WHITE, CORTEX))


def test_images_are_compared_where_both_brains_have_one(pair):
    affine = centred()
    labels = volume(affine, later=False)
    image = 700.0 * gaussian_filter((labels > 0).astype(float), 1)
    shown = channels(labels, affine, cerebrum=(WHITE, CORTEX), image=(image, affine))
    assert shown.cortex is None
    assert np.quantile(shown.intensity[shown.tissue > 0], 0.99) == pytest.approx(1.0, abs=0.01)
    with pytest.raises(InputError, match="does not show the cerebrum"):
        channels(labels, affine, cerebrum=(WHITE, CORTEX), image=(np.zeros_like(image), affine))
    found = register(replace(shown, cortex=pair[0].cortex), replace(pair[1], intensity=None))
    assert found.channels == ("cerebrum", "cortex")


def test_deformations_are_read_as_written(tmp_path, found):
    write_correspondence(tmp_path / "a.h5", found.deformation, {"dice": 0.9})
    read = read_correspondence(tmp_path / "a.h5")
    assert np.array_equal(read.matrix, found.deformation.matrix)
    assert read.displacement == pytest.approx(found.deformation.displacement, abs=1e-6)
    (tmp_path / "b.h5").write_bytes(b"torn")
    with pytest.raises(InputError, match=r"b\.h5: cannot be read as a correspondence"):
        read_correspondence(tmp_path / "b.h5")
