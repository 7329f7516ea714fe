"""Regions come from volumes and surfaces to the vertices where they are known to be."""

import numpy as np
import pytest
from facts import Facts
from shapes import ellipsoid, scaling

from gyriflow.errors import InputError
from gyriflow.geometry.deformations import transform_points
from gyriflow.geometry.matching import surface_mask
from gyriflow.geometry.triangles import transformed
from gyriflow.growth.carried_regions import (
    regions_from_surface,
    regions_from_volume,
)
from gyriflow.growth.carrying import carry_regions
from gyriflow.growth.registration import channels, register

HALF_AXES = [16.0, 22.0, 14.0]
BRAIN = ellipsoid(HALF_AXES)


def ribbon(affine, shape):
    """Return the mask of a cortex of the brain in a volume, and the centres of its
    voxels."""
    points = transform_points(np.indices(shape).reshape(3, -1).T, affine)
    radius = np.linalg.norm(points / HALF_AXES, axis=1)
    is_cortex = (radius > 0.85) & (radius < 1.0)
    return is_cortex.reshape(shape), points.reshape(*shape, 3)


def test_vertices_take_the_region_of_the_nearest_voxel_in_reach():
    affine = np.array(
        [[0, 0, 1.0, -20], [-1.0, 0, 0, 25], [0, 1.0, 0, -18], [0, 0, 0, 1]]
    )
    cortex, points = ribbon(affine, (50, 40, 40))
    # in front of y = 0 one region, behind it another, none far below
    regions = (cortex & (points[..., 2] > -6.0)) * np.where(points[..., 1] > 0, 1, 2)
    found = regions_from_volume({"left": BRAIN.vertices}, regions, affine)["left"]
    _, y, z = BRAIN.vertices.T
    clear = (np.abs(y) > 1.0) & (z > -5.0)
    assert np.array_equal(found[clear], np.where(y[clear] > 0, 1, 2))
    assert (found[z < -12.0] == 0).all()
    sides = {"left": BRAIN.vertices, "right": BRAIN.vertices + 500.0}
    with pytest.raises(InputError, check=Facts("right")):
        regions_from_volume(sides, regions, affine)


def from_volume(shift_mm, first_y=-99.0):
    """Return the region of each vertex of a brain that lies elsewhere than its only
    region, which is in front of a place."""
    affine = scaling(1.0, -30.0)
    cortex, points = ribbon(affine, (60, 60, 60))
    moved = BRAIN.vertices + [0.0, shift_mm, 0.0]
    is_left = BRAIN.vertices[:, 0] < 0
    sides = {"left": moved[is_left], "right": moved[~is_left]}
    regions = (cortex & (points[..., 1] > first_y)).astype(int)
    return regions_from_volume(sides, regions, affine)


def test_regions_beside_the_surface_are_refused_few_regions_are_not(caplog):
    assert (from_volume(0.0)["right"] == 1).all()
    # a sixth of the vertices has this region
    assert 0.05 < (from_volume(0.0, first_y=16.0)["left"] == 1).mean() < 0.3
    assert caplog.text == ""
    from_volume(12.0)
    assert caplog.messages == [Facts("52 %", "4 mm")]
    facts = Facts("24 %", "4 mm", "50 %", "mris_convert --to-scanner")
    with pytest.raises(InputError, check=facts):
        from_volume(25.0)


@pytest.mark.parametrize(
    ("surface", "n_labels", "facts"),
    [
        (ellipsoid(HALF_AXES, 3), 641, (641, 642)),
        (ellipsoid(HALF_AXES, 3, (0.0, 60.0, 0.0)), 642, ("mm", "5 mm")),
    ],
)
def test_regions_of_another_surface_are_refused(surface, n_labels, facts):
    with pytest.raises(InputError, check=Facts(*facts)):
        regions_from_surface(BRAIN, surface, np.ones(n_labels, int))


def test_regions_of_brains_without_labels_are_carried_by_the_masks_of_their_surfaces():
    other = transformed(BRAIN, scaling([1.15, 1.1, 1.2], [5.0, -3.0, 2.0]))
    first, second = (
        channels(*surface_mask(mesh, 2.0), cerebrum=(1,)) for mesh in (BRAIN, other)
    )
    deformation = register(first, second).deformation
    labels = np.where(BRAIN.vertices[:, 1] > 4.0, 1, 2)
    found = carry_regions(labels, BRAIN, other, deformation)
    # a vertex stands for the same place on both
    assert (found == labels).mean() > 0.97
