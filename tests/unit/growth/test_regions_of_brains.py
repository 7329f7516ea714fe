"""Regions come from volumes and surfaces to the vertices where they are known to be."""

import numpy as np
import pytest
from facts import Facts
from shapes import ellipsoid, scaling

from gyriflow.errors import InputError
from gyriflow.geometry.deformations import transform_points
from gyriflow.geometry.matching import surface_mask
from gyriflow.geometry.triangles import TriangleMesh
from gyriflow.growth.carried_regions import (
    number_regions,
    regions_from_surface,
    regions_from_volume,
    renumber,
)
from gyriflow.growth.carrying import carry_regions
from gyriflow.growth.registration import channels, register

BRAIN = ellipsoid([16.0, 22.0, 14.0])


def test_labels_of_one_name_are_one_region():
    table = {4: "frontal", 3: "parietal", 9: "frontal"}
    numbers = number_regions(table, {1: "insula", 2: "parietal"})
    assert numbers == {"parietal": 1, "frontal": 2, "insula": 3}
    assert renumber(np.array([[0, 3], [9, 7]]), table, numbers).tolist() == [
        [0, 1],
        [2, 0],
    ]


def test_vertices_take_the_region_of_the_nearest_voxel_in_reach():
    affine = np.array(
        [[0, 0, 1.0, -20], [-1.0, 0, 0, 25], [0, 1.0, 0, -18], [0, 0, 0, 1]]
    )
    index = np.indices((50, 40, 40)).reshape(3, -1).T
    points = transform_points(index, affine)
    radius = np.linalg.norm(points / [16.0, 22.0, 14.0], axis=1)
    # a shell of cortex, in front of y = 0 one region, behind it another, none far below
    shell = (radius > 0.85) & (radius < 1.0) & (points[:, 2] > -6.0)
    regions = np.where(shell, np.where(points[:, 1] > 0, 1, 2), 0).reshape(50, 40, 40)
    found = regions_from_volume({"left": BRAIN.vertices}, regions, affine)["left"]
    y, z = BRAIN.vertices[:, 1:].T
    clear = (np.abs(y) > 1.0) & (z > -5.0)
    np.testing.assert_array_equal(found[clear], np.where(y[clear] > 0, 1, 2))
    assert (found[z < -12.0] == 0).all()
    with pytest.raises(InputError, check=Facts("right")):
        regions_from_volume(
            {"left": BRAIN.vertices, "right": BRAIN.vertices + 500.0}, regions, affine
        )


def test_regions_beside_the_surface_are_refused_few_regions_are_not(caplog):
    affine = scaling(1.0, -30.0)
    centres = transform_points(np.indices((60, 60, 60)).reshape(3, -1).T, affine)
    radius = np.linalg.norm(centres / [16.0, 22.0, 14.0], axis=1)
    shell = ((radius > 0.85) & (radius < 1.0)).reshape(60, 60, 60).astype(int)
    frontal = shell * (centres[:, 1] > 16.0).reshape(60, 60, 60)
    sides = BRAIN.vertices[:, 0] < 0

    def found(regions, shift):
        points = BRAIN.vertices + [0.0, shift, 0.0]
        return regions_from_volume(
            {"left": points[sides], "right": points[~sides]}, regions, affine
        )

    assert (found(shell, 0.0)["right"] == 1).all()
    # a sixth of the vertices has this region
    assert 0.05 < (found(frontal, 0.0)["left"] == 1).mean() < 0.3
    assert caplog.text == ""
    with pytest.raises(
        InputError, check=Facts("24 %", "4 mm", "50 %", "mris_convert --to-scanner")
    ):
        found(shell, 25.0)
    assert found(shell, 12.0)
    assert caplog.messages == [Facts("52 %", "4 mm")]


def test_another_mesh_of_the_surface_has_the_same_regions_and_no_other():
    fine = ellipsoid([16.0, 22.0, 14.0], 5)
    labels = np.where(fine.vertices[:, 1] > 0, 1, 2)
    found = regions_from_surface(BRAIN, fine, labels)
    clear = np.abs(BRAIN.vertices[:, 1]) > 0.8
    np.testing.assert_array_equal(
        found[clear], np.where(BRAIN.vertices[clear, 1] > 0, 1, 2)
    )
    with pytest.raises(InputError, check=Facts(len(labels) - 1, len(labels))):
        regions_from_surface(BRAIN, fine, labels[:-1])
    with pytest.raises(InputError, check=Facts("39.7 mm", "5 mm")):
        regions_from_surface(
            BRAIN, TriangleMesh(fine.vertices + [0, 60.0, 0], fine.faces), labels
        )


def test_regions_of_brains_without_labels_are_carried_by_the_masks_of_their_surfaces():
    other = TriangleMesh(
        BRAIN.vertices * [1.15, 1.1, 1.2] + [5.0, -3.0, 2.0], BRAIN.faces
    )
    volumes = [
        channels(*surface_mask(mesh, 1.5), cerebrum=(1,)) for mesh in (BRAIN, other)
    ]
    deformation = register(*volumes).deformation
    labels = np.where(BRAIN.vertices[:, 1] > 4.0, 1, 2)
    found = carry_regions(labels, BRAIN, other, deformation)
    # a vertex stands for the same place on both
    assert (found == labels).mean() > 0.97
