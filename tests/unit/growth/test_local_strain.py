"""Local strain between weeks: directions of growth, whatever the pose and the change of volume."""

import numpy as np
import pytest
from scipy.spatial import Delaunay
from scipy.spatial.transform import Rotation

from gyriflow.errors import InputError
from gyriflow.geometry.diffusion import cell_sizes
from gyriflow.growth.local import local_strain


def box():
    points = np.stack(np.meshgrid(*[np.arange(5.0)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    cells = Delaunay(points + np.random.default_rng(0).uniform(-0.05, 0.05, points.shape)).simplices
    cells = cells[np.abs(cell_sizes(points, cells)) > 1e-3]
    turned = cell_sizes(points, cells) < 0
    cells[turned] = cells[turned][:, ::-1]
    return points, cells[cell_sizes(points, cells) > 0]


def test_strain_is_that_of_the_stretch_and_has_no_volume():
    points, cells = box()
    grown = points * np.exp([0.3, 0.0, 0.0])
    strain = local_strain(np.stack([points, grown]), cells, [21.0, 23.0], 1.0)
    assert strain.shape == (1, len(points), 6)
    used = np.unique(cells)
    np.testing.assert_allclose(strain[0, used], np.tile([0.1, -0.05, -0.05, 0, 0, 0], (len(used), 1)), atol=1e-6)
    np.testing.assert_allclose(local_strain(np.stack([points, 1.3 * points]), cells, [21.0, 22.0], 1.0), 0, atol=1e-9)


def test_weeks_that_lie_otherwise_are_turned_as_the_mesh_lies():
    points, cells = box()
    turn = Rotation.from_euler("z", 90, degrees=True).as_matrix()
    positions = [points, points * np.exp([0.3, 0.0, 0.0]), points * np.exp([0.6, 0.0, 0.0])]
    straight = local_strain(np.stack(positions), cells, [21.0, 22.0, 23.0], 0.0)
    moved = local_strain(
        np.stack([positions[0], *(p @ turn.T + 7 for p in positions[1:])]), cells, [21.0, 22.0, 23.0], 0.0
    )
    np.testing.assert_allclose(moved, straight, atol=1e-6)


def test_inverted_elements_do_not_count():
    points, cells = box()
    torn = points.copy()
    torn[62] += [3.0, 0.0, 0.0]
    strain = local_strain(np.stack([points, torn]), cells, [21.0, 22.0], 0.0)
    assert np.isfinite(strain).all()
    assert np.abs(strain).max() <= 1.5
    with pytest.raises(InputError, match="successive weeks"):
        local_strain(np.stack([points, torn]), cells, [22.0, 21.0], 0.0)
