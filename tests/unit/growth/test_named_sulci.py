"""Named sulci: those that are drawn lie in valleys, and registration carries them to where they belong."""

from pathlib import Path

import numpy as np
import pytest

from gyriflow.anatomy.pial import from_labels
from gyriflow.config.atlas import SULCI
from gyriflow.geometry.alignment import motion
from gyriflow.geometry.deformations import Deformation, transform_points
from gyriflow.geometry.triangles import vertex_areas
from gyriflow.growth.carried_regions import PLACES_MM, find_places, regions_by_deformation
from gyriflow.growth.channels import Channels, channels
from gyriflow.io.volumes import LabelVolume, read_label_volume
from gyriflow.io.yaml_files import SCHEMES, read_yaml
from gyriflow.metrics.curvature import curvature

DRAWING = read_yaml(SULCI / "sulci.yaml")
SCHEME = SCHEMES[DRAWING["scheme"]]
NAMES = dict(enumerate([sulcus["name"] for sulcus in DRAWING["sulci"]], start=1))
DRAWN = read_label_volume(SULCI / "sulci.nii.gz")
BRAIN = read_label_volume(SULCI / DRAWING["labels"])


def hemispheres(brain: LabelVolume, week: float):
    pial = from_labels(brain.labels, brain.affine, SCHEME, week=week)
    # in the space of the labels
    back = np.linalg.inv(pial.report["pose"]["world"])
    return [(mesh, transform_points(mesh.vertices, back)) for mesh in (pial.left, pial.right)]


def coarse(brain: LabelVolume) -> Channels:
    parts = {"cerebrum": SCHEME.cerebrum, "cortex": SCHEME.cortex}
    return channels(brain.labels, brain.affine, **parts, voxel_mm=PLACES_MM)


def onto_drawn(brain: LabelVolume) -> Deformation:
    found = find_places(coarse(brain), coarse(BRAIN))
    assert found is not None
    return found


def own_sulci(points):
    still = Deformation(np.eye(4), np.zeros((2, 2, 2, 3)), np.eye(4))
    return regions_by_deformation(points, still, DRAWN.labels, DRAWN.affine)


def test_points_take_the_region_of_the_voxel_that_they_are_carried_to():
    regions = np.arange(27).reshape(3, 3, 3)
    affine = np.diag([2.0, 2.0, 2.0, 1.0])
    shift = Deformation(motion(shift=[0.0, 0.0, 2.0]), np.full((2, 2, 2, 3), [2.0, 0.0, 0.0]), affine)
    points = np.array([[0.0, 0.0, 0.0], [0.9, 2.1, 1.9], [2.0, 4.0, 4.0], [-9.0, 0.0, 0.0]])
    np.testing.assert_array_equal(regions_by_deformation(points, shift, regions, affine), [10, 14, 0, 0])


@pytest.mark.slow
def test_every_sulcus_is_drawn_on_both_sides_and_in_a_valley():
    assert DRAWN.labels.shape == BRAIN.labels.shape
    np.testing.assert_allclose(DRAWN.affine, BRAIN.affine)
    for mesh, points in hemispheres(BRAIN, DRAWING["week"]):
        labels, areas = own_sulci(points), vertex_areas(mesh)
        bend = curvature(mesh).mean
        assert set(labels) == {0, *NAMES}
        for number in NAMES:
            assert (
                np.average(bend[labels == number], weights=areas[labels == number])
                < 0
                < np.average(bend, weights=areas)
            )
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
    between = onto_drawn(before)
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
    assert find_places(body, coarse(BRAIN)) is None
    assert "sulci have no names" in caplog.text
