"""Distances between surfaces of known distance and motion."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from shapes import ellipsoid, rigid, sphere

from gyriflow.geometry.triangles import TriangleMesh, transformed
from gyriflow.metrics.similarity import brain_distances, distances, rigid_alignment, surface_distance


def brain_like(subdivisions: int = 4) -> TriangleMesh:
    """Returns an ellipsoid with a bump, so that only one pose fits."""
    shape = sphere(1.0, subdivisions)
    direction = shape.vertices
    bump = 1 + 0.25 * np.exp(-8 * ((direction - np.array([0.6, 0.64, 0.48])) ** 2).sum(axis=1))
    return TriangleMesh(direction * bump[:, None] * [20.0, 28.0, 16.0], shape.faces)


def motion(degrees: float, shift: list[float]) -> np.ndarray:
    turn = Rotation.from_rotvec(np.array([0.3, 0.5, 0.8]) / 0.99 * degrees, degrees=True)
    return rigid(*turn.as_euler("xyz", degrees=True), shift=shift)


def test_alignment_takes_a_motion_back() -> None:
    mesh = brain_like()
    matrix = motion(12.0, [8.0, -5.0, 3.0])
    found = rigid_alignment(transformed(mesh, matrix), mesh)
    np.testing.assert_allclose(found.matrix @ matrix, np.eye(4), atol=0.03)
    result = surface_distance(transformed(mesh, matrix), mesh)
    assert result["symmetric_mean_mm"] < 0.02
    assert result["hausdorff95_mm"] < 0.05
    assert result["rotation_deg"] == pytest.approx(12.0, rel=0.02)


def test_distance_does_not_depend_on_the_triangles() -> None:
    result = surface_distance(brain_like(3), brain_like(4))
    assert result["symmetric_mean_mm"] < 0.25  # the coarse one lies inside by the sag of its triangles
    assert result["rotation_deg"] < 1.0


def test_spheres_of_different_radius() -> None:
    result = surface_distance(sphere(20.0), sphere(22.0))
    assert result["symmetric_mean_mm"] == pytest.approx(2.0, abs=0.05)
    assert result["hausdorff95_mm"] == pytest.approx(2.0, abs=0.05)
    there, back = distances(sphere(20.0), sphere(22.0)), distances(sphere(22.0), sphere(20.0))
    assert there.max() < 2.01
    assert back.min() > 1.99


def test_hausdorff_sees_what_the_mean_does_not() -> None:
    smooth = sphere(25.0)
    tall = smooth.vertices.copy()
    cap = tall[:, 2] > 25.0 * np.cos(np.arccos(1 - 2 * 0.08))  # 8 % of the sphere's area
    tall[cap] *= 1.2
    result = surface_distance(TriangleMesh(tall, smooth.faces), smooth)
    assert result["symmetric_mean_mm"] < 1.0
    assert result["hausdorff95_mm"] > 3.0


def test_same_in_both_orders() -> None:
    a, b = brain_like(), transformed(sphere(22.0), motion(0.0, [5.0, 0.0, 0.0]))
    there, back = surface_distance(a, b), surface_distance(b, a)
    assert there["symmetric_mean_mm"] == pytest.approx(back["symmetric_mean_mm"], rel=0.02)
    assert there["hausdorff95_mm"] == pytest.approx(back["hausdorff95_mm"], rel=0.02)


@pytest.mark.parametrize("degrees", [75.0, 120.0, 180.0])
def test_a_wrong_pose_is_put_right_and_said(degrees: float, caplog: pytest.LogCaptureFixture) -> None:
    mesh = brain_like()
    turned = transformed(mesh, motion(degrees, [8.0, -5.0, 3.0]))
    result = surface_distance(turned, mesh, name="left")
    assert result["symmetric_mean_mm"] < 0.02
    assert result["rotation_deg"] == pytest.approx(degrees, abs=0.5)
    assert f"left: fits best when turned by {degrees:.0f} degrees" in caplog.text


def test_the_given_pose_is_kept_where_another_fits_as_well(caplog: pytest.LogCaptureFixture) -> None:
    # the same after half a turn about any axis
    longish = ellipsoid((20.0, 28.0, 16.0))
    result = surface_distance(transformed(longish, motion(10.0, [1.0, 2.0, 3.0])), longish)
    assert result["rotation_deg"] == pytest.approx(10.0, abs=0.5)
    assert result["pose_margin_1"] == pytest.approx(1.0, abs=0.01)
    assert "the pose is doubtful" in caplog.text
    assert rigid_alignment(brain_like(), brain_like()).margin > 5.0


def test_the_margin_compares_poses_that_are_aligned_alike() -> None:
    shape = sphere(1.0)
    x, y, z = shape.vertices.T
    # folds that closest points take long to bring together; half a turn about z changes nothing
    height = 0.06 * np.sin(8.0 * np.arctan2(y, x)) * (1.0 - z**2) ** 2 + 0.06 * np.cos(8.0 * z)
    folded = shape.vertices * (1.0 + height)[:, None] * [20.0, 28.0, 16.0]
    small, large = TriangleMesh(folded, shape.faces), TriangleMesh(1.08 * folded, shape.faces)
    found = rigid_alignment(transformed(small, motion(10.0, [1.0, 2.0, 3.0])), large)
    assert found.margin == pytest.approx(1.0, abs=0.01)


def test_parts_of_a_brain_are_aligned_by_themselves() -> None:
    left, right = sphere(20.0), transformed(sphere(21.0), motion(0.0, [50.0, 0.0, 0.0]))
    other = {"left": transformed(left, motion(0.0, [0.0, 4.0, 0.0])), "right": sphere(23.0)}
    table = brain_distances({"left": left, "right": right}, other)
    assert table.columns.tolist() == ["hemisphere", "metric", "value", "unit"]
    value = table.set_index(["hemisphere", "metric"])["value"]
    assert value["left", "symmetric_mean"] < 0.02
    assert value["left", "shift"] == pytest.approx(4.0, abs=0.01)
    assert value["right", "symmetric_mean"] == pytest.approx(2.0, abs=0.05)
    assert value["right", "shift"] == pytest.approx(50.0, abs=0.1)
    assert dict(zip(table["metric"], table["unit"], strict=True)) == {
        "symmetric_mean": "mm", "hausdorff95": "mm", "rotation": "deg", "shift": "mm", "pose_margin": "1",
    }  # fmt: skip
