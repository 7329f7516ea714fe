"""Thickness of simulated brains that are spheres, and thickness and maps by region."""

import numpy as np
import pytest
from scipy.spatial import Delaunay
from shapes import sphere

from gyriflow.errors import InputError
from gyriflow.folding.layers import cortical_weight
from gyriflow.geometry.tetrahedra import TetrahedralMesh
from gyriflow.geometry.triangles import TriangleMesh, vertex_areas
from gyriflow.metrics.measure import thickness_rows
from gyriflow.metrics.regions import region_metrics
from gyriflow.metrics.thickness import at_part, depth_of_weight, simulated_thickness

RADIUS, CORTEX = 20.0, 2.5


@pytest.fixture(scope="module")
def ball() -> tuple[TetrahedralMesh, TriangleMesh]:
    """A ball of concentric icospheres, and its surface (the first vertices of the mesh)."""
    shells = [sphere(radius, 3) for radius in (20.0, 19.0, 17.0, 14.0, 9.0)]
    points = np.concatenate([*(shell.vertices for shell in shells), [[0.0, 0.0, 0.0]]])
    tets = Delaunay(points).simplices
    return TetrahedralMesh(points, tets), shells[0]


def depth_of(mesh: TetrahedralMesh) -> np.ndarray:
    return (RADIUS - np.linalg.norm(mesh.vertices, axis=1)) / CORTEX


def test_thickness_at_the_start_is_the_cortex(ball) -> None:
    mesh, pial = ball
    np.testing.assert_allclose(simulated_thickness(mesh, depth_of(mesh), mesh.vertices, pial), CORTEX, atol=0.15)


def test_depth_from_the_weight_of_the_model() -> None:
    depth = np.linspace(0, 2.5, 26)
    np.testing.assert_allclose(depth_of_weight(cortical_weight(1.5 * depth, 1.5)), depth, atol=1e-6)
    assert depth_of_weight(np.array([0.0]))[0] > 2.5


def test_the_border_is_carried_with_the_tissue(ball) -> None:
    mesh, pial = ball
    # growth by 1.4 makes the same cortex thicker; a distance of 2.5 mm in the later shape would not see it
    grown = simulated_thickness(
        mesh, depth_of(mesh), 1.4 * mesh.vertices, TriangleMesh(1.4 * pial.vertices, pial.faces)
    )
    np.testing.assert_allclose(grown, 1.4 * CORTEX, atol=0.2)
    # and a core that swells while the surface stays presses the cortex: r → 20 (r/20)^(1/2)
    radius = np.linalg.norm(mesh.vertices, axis=1)
    pressed = mesh.vertices * (np.sqrt(RADIUS * radius) / np.maximum(radius, 1e-9))[:, None]
    found = simulated_thickness(mesh, depth_of(mesh), pressed, pial)
    assert found.mean() == pytest.approx(RADIUS - np.sqrt(RADIUS * (RADIUS - CORTEX)), abs=0.15)


def test_values_of_a_part() -> None:
    whole = sphere(RADIUS, 2)
    part = TriangleMesh(whole.vertices[[5, 3, 8]].astype(np.float32), [[0, 1, 2]])
    np.testing.assert_array_equal(at_part(np.arange(162), whole, part), [5, 3, 8])
    with pytest.raises(InputError, match="do not belong"):
        at_part(np.arange(162), whole, TriangleMesh(whole.vertices[:3] + 1.0, [[0, 1, 2]]))
    with pytest.raises(InputError, match="161 values"):
        at_part(np.arange(161), whole, part)


def test_thickness_metrics_leave_out_what_was_not_measured() -> None:
    rows = {name: value for name, value, _ in thickness_rows(np.array([1.0, 2.0, np.nan]), np.array([3.0, 1.0, 4.0]))}
    assert rows["mean_thickness"] == pytest.approx(1.25)
    assert rows["thickness_sd"] == pytest.approx(np.sqrt(0.75 * 0.25**2 + 0.25 * 0.75**2))
    assert (rows["thickness_q05"], rows["thickness_q95"]) == (1.0, 2.0)
    assert rows["thickness_measured_share"] == pytest.approx(0.5)
    assert thickness_rows(np.full(3, np.nan), np.ones(3)) == []


def test_regions_have_their_area_and_means() -> None:
    mesh = sphere(RADIUS)
    top = mesh.vertices[:, 2] > 0
    labels = np.where(top, 7, np.where(mesh.vertices[:, 2] < -10.0, 9, 0))
    thickness = np.where(top, 1.0, 3.0)
    thickness[np.flatnonzero(top)[:5]] = np.nan
    maps = {"thickness_mm": thickness, "shape_index": np.ones(len(labels)), "reliable": np.ones(len(labels))}
    found = region_metrics({"left": mesh}, {"left": maps}, {"left": labels}, {7: "top", 9: "bottom"})
    value = found.set_index(["region", "metric"])["value"]
    areas = vertex_areas(mesh)
    assert value["top", "area"] == pytest.approx(areas[top].sum() / 100)
    # a cap of height 10 mm is a quarter of the sphere
    assert value["bottom", "area_share"] == pytest.approx(0.25, abs=0.02)
    assert value["top", "mean_thickness"] == 1.0
    assert value["bottom", "mean_thickness"] == 3.0
    assert found.set_index("metric").loc["mean_thickness", "unit"].tolist() == ["mm", "mm"]
    with pytest.raises(InputError, match="without a name: 9"):
        region_metrics({"left": mesh}, {"left": maps}, {"left": labels}, {7: "top"})
