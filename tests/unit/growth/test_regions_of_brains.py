"""Regions come from volumes, surfaces and drawn sulci to the vertices where they are known to be."""

from pathlib import Path

import numpy as np
import pytest
from facts import Facts
from shapes import ellipsoid, scaling

from gyriflow.anatomy.pial import from_labels
from gyriflow.errors import InputError
from gyriflow.geometry.alignment import motion
from gyriflow.geometry.deformations import Deformation, transform_points
from gyriflow.geometry.matching import surface_mask
from gyriflow.geometry.triangles import TriangleMesh, vertex_areas
from gyriflow.growth.carried_regions import (
    PLACES_MM,
    number_regions,
    regions_by_deformation,
    regions_from_surface,
    regions_from_volume,
    register_to_drawn_sulci,
    renumber,
)
from gyriflow.growth.carrying import carry_regions
from gyriflow.growth.registration import Channels, channels, register
from gyriflow.io.volumes import LabelVolume, read_label_volume
from gyriflow.io.yaml_files import SCHEMES, read_yaml
from gyriflow.metrics.curvature import curvature
from gyriflow.settings.atlas import SULCI

BRAIN = ellipsoid([16.0, 22.0, 14.0])


def test_labels_of_one_name_are_one_region():
    table = {4: "frontal", 3: "parietal", 9: "frontal"}
    numbers = number_regions(table, {1: "insula", 2: "parietal"})
    assert numbers == {"parietal": 1, "frontal": 2, "insula": 3}
    assert renumber(np.array([[0, 3], [9, 7]]), table, numbers).tolist() == [[0, 1], [2, 0]]


def test_vertices_take_the_region_of_the_nearest_voxel_in_reach():
    affine = np.array([[0, 0, 1.0, -20], [-1.0, 0, 0, 25], [0, 1.0, 0, -18], [0, 0, 0, 1]])
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
        regions_from_volume({"left": BRAIN.vertices, "right": BRAIN.vertices + 500.0}, regions, affine)


def test_regions_beside_the_surface_are_refused_few_regions_are_not(caplog):
    affine = scaling(1.0, -30.0)
    centres = transform_points(np.indices((60, 60, 60)).reshape(3, -1).T, affine)
    radius = np.linalg.norm(centres / [16.0, 22.0, 14.0], axis=1)
    shell = ((radius > 0.85) & (radius < 1.0)).reshape(60, 60, 60).astype(int)
    frontal = shell * (centres[:, 1] > 16.0).reshape(60, 60, 60)
    sides = BRAIN.vertices[:, 0] < 0

    def found(regions, shift):
        points = BRAIN.vertices + [0.0, shift, 0.0]
        return regions_from_volume({"left": points[sides], "right": points[~sides]}, regions, affine)

    assert (found(shell, 0.0)["right"] == 1).all()
    # a sixth of the vertices has this region
    assert 0.05 < (found(frontal, 0.0)["left"] == 1).mean() < 0.3
    assert caplog.text == ""
    with pytest.raises(InputError, check=Facts("24 %", "4 mm", "50 %", "mris_convert --to-scanner")):
        found(shell, 25.0)
    assert found(shell, 12.0)
    assert caplog.messages == [Facts("52 %", "4 mm")]


def test_another_mesh_of_the_surface_has_the_same_regions_and_no_other():
    fine = ellipsoid([16.0, 22.0, 14.0], 5)
    labels = np.where(fine.vertices[:, 1] > 0, 1, 2)
    found = regions_from_surface(BRAIN, fine, labels)
    clear = np.abs(BRAIN.vertices[:, 1]) > 0.8
    np.testing.assert_array_equal(found[clear], np.where(BRAIN.vertices[clear, 1] > 0, 1, 2))
    with pytest.raises(InputError, check=Facts(len(labels) - 1, len(labels))):
        regions_from_surface(BRAIN, fine, labels[:-1])
    with pytest.raises(InputError, check=Facts("39.7 mm", "5 mm")):
        regions_from_surface(BRAIN, TriangleMesh(fine.vertices + [0, 60.0, 0], fine.faces), labels)


def test_regions_of_brains_without_labels_are_carried_by_the_masks_of_their_surfaces():
    other = TriangleMesh(BRAIN.vertices * [1.15, 1.1, 1.2] + [5.0, -3.0, 2.0], BRAIN.faces)
    volumes = [channels(*surface_mask(mesh, 1.5), cerebrum=(1,)) for mesh in (BRAIN, other)]
    deformation = register(*volumes).deformation
    labels = np.where(BRAIN.vertices[:, 1] > 4.0, 1, 2)
    found = carry_regions(labels, BRAIN, other, deformation)
    # a vertex stands for the same place on both
    assert (found == labels).mean() > 0.97


DRAWING = read_yaml(SULCI / "sulci.yaml")
SCHEME = SCHEMES[DRAWING["scheme"]]
NAMES = dict(enumerate([sulcus["name"] for sulcus in DRAWING["sulci"]], start=1))
DRAWN = read_label_volume(SULCI / "sulci.nii.gz")
DRAWN_BRAIN = read_label_volume(SULCI / DRAWING["labels"])


def hemispheres(brain: LabelVolume, week: float):
    pial = from_labels(brain.labels, brain.affine, SCHEME, week=week)
    # in the space of the labels
    back = np.linalg.inv(pial.report["pose"]["world"])
    return [(mesh, transform_points(mesh.vertices, back)) for mesh in (pial.left, pial.right)]


def coarse(brain: LabelVolume) -> Channels:
    parts = {"cerebrum": SCHEME.cerebrum, "cortex": SCHEME.cortex}
    return channels(brain.labels, brain.affine, **parts, voxel_mm=PLACES_MM)


def test_points_take_the_region_of_the_voxel_that_they_are_carried_to():
    regions = np.arange(27).reshape(3, 3, 3)
    affine = np.diag([2.0, 2.0, 2.0, 1.0])
    shift = Deformation(motion(shift=[0.0, 0.0, 2.0]), np.full((2, 2, 2, 3), [2.0, 0.0, 0.0]), affine)
    points = np.array([[0.0, 0.0, 0.0], [0.9, 2.1, 1.9], [2.0, 4.0, 4.0], [-9.0, 0.0, 0.0]])
    np.testing.assert_array_equal(regions_by_deformation(points, shift, regions, affine), [10, 14, 0, 0])


@pytest.mark.slow
def test_every_sulcus_is_drawn_on_both_sides_and_in_a_valley():
    assert DRAWN.labels.shape == DRAWN_BRAIN.labels.shape
    np.testing.assert_allclose(DRAWN.affine, DRAWN_BRAIN.affine)
    still = Deformation(np.eye(4), np.zeros((2, 2, 2, 3)), np.eye(4))
    for mesh, points in hemispheres(DRAWN_BRAIN, DRAWING["week"]):
        labels, areas = regions_by_deformation(points, still, DRAWN.labels, DRAWN.affine), vertex_areas(mesh)
        bend = curvature(mesh).mean
        assert set(labels) == {0, *NAMES}
        for number in NAMES:
            own = labels == number
            assert np.average(bend[own], weights=areas[own]) < 0 < np.average(bend, weights=areas)
        middle = {name: points[labels == number].mean(axis=0) for number, name in NAMES.items()}
        # y to the front, z up
        in_front = ["precentral", "central", "intraparietal"]
        assert sorted(in_front, key=lambda name: -middle[name][1]) == in_front
        below = ["superior temporal", "Sylvian fissure", "central"]
        assert sorted(below, key=lambda name: middle[name][2]) == below
        assert np.abs(middle["cingulate"][0]) < 5 < np.abs(middle["central"][0])


@pytest.mark.slow
def test_in_the_brain_of_the_week_before_named_sulci_are_concave():
    week = DRAWING["week"] - 1
    before = read_label_volume(SULCI / Path(DRAWING["labels"].replace(str(DRAWING["week"]), str(week))))
    between = register_to_drawn_sulci(coarse(before), coarse(DRAWN_BRAIN))
    assert between is not None
    for mesh, points in hemispheres(before, week):
        found = regions_by_deformation(points, between, DRAWN.labels, DRAWN.affine)
        bend, areas = curvature(mesh).mean, vertex_areas(mesh)
        for number, name in NAMES.items():
            assert np.average(bend[found == number], weights=areas[found == number]) < 0, name


@pytest.mark.slow
def test_a_body_that_is_no_brain_has_no_named_sulci(caplog):
    centres = np.indices((60, 60, 60)) - 30.0
    box = (np.abs(centres).max(axis=0) < 18).astype(np.int32)
    box[(np.abs(centres).max(axis=0) < 15)] = 2
    body = channels(box, np.diag([1.6, 1.6, 1.6, 1.0]), cerebrum=[1, 2], cortex=[1], voxel_mm=2.4)
    assert register_to_drawn_sulci(body, coarse(DRAWN_BRAIN)) is None
    assert "sulci" in caplog.text
