"""White surfaces: made of labels and of files, measured as pial ones are, on concentric
spheres."""

import numpy as np
import pytest
from shapes import scaling, sphere

from gyriflow.anatomy.fissure import split
from gyriflow.anatomy.thickness import white_from_labels, white_from_surfaces
from gyriflow.geometry.poses import Pose
from gyriflow.geometry.triangles import transformed
from gyriflow.metrics.measure import measure_white
from gyriflow.settings.schemes import LabelScheme
from gyriflow.settings.terms import SIDES

PIAL_MM, WHITE_MM, VOXEL_MM = 20.0, 17.0, 0.8
SCHEME = LabelScheme(name="two", cerebrum=(1, 2), cortex=(2,))
POSE = np.array([[0.0, -1, 0, 5], [1, 0, 0, -3], [0, 0, 1, 2], [0, 0, 0, 1]])
"""A quarter turn and some mm."""


def spheres_labels():
    axis = np.arange(-24, 24, VOXEL_MM) + 0.13
    radius = np.sqrt(sum(np.square(np.meshgrid(axis, axis, axis, indexing="ij"))))
    labels = np.select([radius < WHITE_MM, radius < PIAL_MM], [1, 2], 0)
    return labels, scaling(VOXEL_MM, axis[0])


@pytest.mark.parametrize("source", ["labels", "whole", "sides"])
def test_the_white_surface_of_concentric_spheres_is_the_inner_one(source):
    pial = dict(zip(SIDES, split(sphere(PIAL_MM, 4), 0.0), strict=True))
    # the files lie elsewhere than the posed surface
    to_file = np.linalg.inv(POSE)
    if source == "labels":
        labels, affine = spheres_labels()
        found = white_from_labels(
            labels, to_file @ affine, SCHEME, pial, Pose(POSE), edge_length_mm=1.5
        )
    else:
        inner = transformed(sphere(WHITE_MM, 4), to_file)
        names = ("whole",) if source == "whole" else SIDES
        found = white_from_surfaces(
            dict.fromkeys(names, inner),
            pial,
            Pose(files={"whole": POSE}),
            edge_length_mm=1.5,
        )
    assert list(found) == ["left", "right"]
    points = np.concatenate([mesh.vertices for mesh in found.values()])
    radii = np.linalg.norm(points, axis=1)
    assert radii == pytest.approx(WHITE_MM, abs=VOXEL_MM / 4)
    assert radii.mean() == pytest.approx(WHITE_MM, abs=0.02)
    # two whole spheres where the files have one for each side
    share = 1.0 if source == "sides" else 0.5
    if share == 0.5:
        left, right = (mesh.vertices[:, 0].max() for mesh in found.values())
        assert left < 1.5 < right
    table, _ = measure_white(found, 5.0)
    numbers = table.set_index(["hemisphere", "metric"])["value"]
    sphere_cm2 = 4 * np.pi * WHITE_MM**2 / 100
    assert numbers["left", "white_area"] == pytest.approx(share * sphere_cm2, rel=0.03)
    whole = numbers["whole"]
    assert whole["white_area"] == pytest.approx(2 * share * sphere_cm2, rel=0.03)
    assert whole["white_mean_curvedness"] == pytest.approx(1 / WHITE_MM, rel=0.03)
    assert whole["white_gyrification_index"] == pytest.approx(1, abs=0.01)
    assert whole["white_mean_sulcal_depth"] == pytest.approx(0, abs=0.02)
