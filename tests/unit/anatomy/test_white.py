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

PIAL_MM, WHITE_MM, VOXEL_MM = 20.0, 17.0, 0.8
SCHEME = LabelScheme(name="two", cerebrum=(1, 2), cortex=(2,))
POSE = np.array([[0.0, -1, 0, 5], [1, 0, 0, -3], [0, 0, 1, 2], [0, 0, 0, 1]])
"""A quarter turn and some mm."""


def spheres_labels():
    axis = np.arange(-24, 24, VOXEL_MM) + 0.13
    radius = np.sqrt(sum(np.square(np.meshgrid(axis, axis, axis, indexing="ij"))))
    return np.where(radius < WHITE_MM, 1, np.where(radius < PIAL_MM, 2, 0)), scaling(
        VOXEL_MM, axis[0]
    )


@pytest.mark.parametrize("source", ["labels", "whole", "sides"])
def test_the_white_surface_of_concentric_spheres_is_the_inner_one(source):
    pial = dict(zip(("left", "right"), split(sphere(PIAL_MM, 4), 0.0), strict=True))
    if source == "labels":
        labels, affine = spheres_labels()
        # the files lie elsewhere than the posed surface
        affine = np.linalg.inv(POSE) @ affine
        found = white_from_labels(
            labels, affine, SCHEME, pial, Pose(POSE), edge_length_mm=1.5
        )
    else:
        inner = sphere(WHITE_MM, 4)
        given = (
            {"whole": inner} if source == "whole" else {"left": inner, "right": inner}
        )
        given = {
            name: transformed(mesh, np.linalg.inv(POSE)) for name, mesh in given.items()
        }
        found = white_from_surfaces(
            given, pial, Pose(files={"whole": POSE}), edge_length_mm=1.5
        )
    radii = np.concatenate(
        [np.linalg.norm(mesh.vertices, axis=1) for mesh in found.values()]
    )
    assert radii == pytest.approx(WHITE_MM, abs=VOXEL_MM / 4)
    assert radii.mean() == pytest.approx(WHITE_MM, abs=0.02)
    assert list(found) == ["left", "right"]
    table, maps = measure_white(found, 5.0)
    value = table.set_index(["hemisphere", "metric"])["value"]
    # two whole spheres where the files have one for each side
    share = {"labels": 0.5, "whole": 0.5, "sides": 1.0}[source]
    assert value["left", "white_area"] == pytest.approx(
        share * 4 * np.pi * WHITE_MM**2 / 100, rel=0.03
    )
    assert value["whole", "white_area"] == pytest.approx(
        value["left", "white_area"] + value["right", "white_area"]
    )
    assert value["whole", "white_mean_curvedness"] == pytest.approx(
        1 / WHITE_MM, rel=0.03
    )
    assert value["whole", "white_gyrification_index"] == pytest.approx(1, abs=0.01)
    assert value["right", "white_mean_sulcal_depth"] == pytest.approx(0, abs=0.02)
    assert len(maps["left"]["sulcal_depth_mm"]) == len(found["left"].vertices)
    if source != "sides":
        assert (
            found["left"].vertices[:, 0].max()
            < 1.5
            < found["right"].vertices[:, 0].max()
        )
