"""All metrics of brains made of spheres, closed and cut, thickness, maps by region, and
distances between surfaces."""

import numpy as np
import pytest
from facts import Facts
from scipy.spatial import Delaunay
from shapes import (
    FAR,
    moved,
    octasphere,
    sphere,
    uneven,
)

from gyriflow.compare.accuracy import ensemble_maps
from gyriflow.compare.deviation import deviation_maps
from gyriflow.errors import InputError, MeshError
from gyriflow.folding.layers import cortical_weight
from gyriflow.geometry.tetrahedra import TetrahedralMesh
from gyriflow.geometry.triangles import (
    TriangleMesh,
    corners,
    flipped,
    merged,
    submesh,
    transformed,
)
from gyriflow.growth.carrying import maps_on_template
from gyriflow.metrics.measure import (
    BrainMetrics,
    measure_brain,
    measure_white,
)
from gyriflow.metrics.tables import region_metrics
from gyriflow.metrics.thickness import at_part, depth_of_weight, simulated_thickness
from gyriflow.quantities import METRICS, VERTEX_MAPS


def value(metrics: BrainMetrics, hemisphere: str, metric: str) -> float:
    rows = metrics.table.query("hemisphere == @hemisphere and metric == @metric")
    assert len(rows) == 1
    return float(rows["value"].iloc[0])


def halves(mesh: TriangleMesh) -> list[TriangleMesh]:
    """Return the open halves of a surface around the origin, left and right of x =
    0."""
    on_left = corners(mesh).mean(axis=1)[:, 0] < 0
    return [submesh(mesh, side)[0] for side in (on_left, ~on_left)]


@pytest.fixture(scope="module")
def apart() -> BrainMetrics:
    """A brain of two spheres of 20 and 25 mm."""
    left, right = sphere(20.0, centre=(-21.0, 0, 0)), sphere(25.0, centre=(26.0, 0, 0))
    known = {"cerebrum": 98.0, "tissue": 90.0, "cortex": 20.0}
    return measure_brain(
        merged(left, right), left, right, label_volumes_ml=known, spangy_modes=60
    )


@pytest.fixture(scope="module")
def cut() -> BrainMetrics:
    """A sphere of 25 mm cut in two, along its edges, far from the origin."""
    ball = octasphere(25.0, 4)
    left, right = (transformed(half, FAR[0]) for half in halves(ball))
    return measure_brain(transformed(ball, FAR[0]), left, right, spangy_modes=60)


def test_two_spheres(apart: BrainMetrics) -> None:
    numbers = apart.table.set_index(["hemisphere", "metric"])["value"]
    for side, radius in (("left", 20.0), ("right", 25.0)):
        expected = {
            "volume": 4 / 3 * np.pi * radius**3 / 1000,
            "area": 4 * np.pi * radius**2 / 100,
            "gyrification_index": 1.0,
            "gyrification_index_envelope": 1.0,
            "mean_shape_index": 1.0,
            "mean_curvedness": 1 / radius,
            "mean_curvature_q50": 1 / radius,
            "intrinsic_curvature_index": 1.0,
            "mean_curvature_norm": 1.0,
            "gaussian_curvature_norm": 1.0,
            "curvature_wavelength": 4 * numbers[side, "curvature_radius"],
            # Weyl's number by the paper's formula is 8192/2π, whatever the radius
            "weyl_number": 8192 / (2 * np.pi),
            "spangy_modes": 60,
        }
        assert dict(numbers[side][[*expected]]) == pytest.approx(expected, rel=0.02)
        absent = ["sulcal_area_share", "mean_sulcal_depth", "folding_index"]
        assert numbers[side][absent].max() < 0.05
        assert numbers[side, "crossing_faces"] == 0
    for metric in ("volume", "area"):
        both = numbers["left", metric] + numbers["right", metric]
        assert numbers["whole", metric] == pytest.approx(both)


def test_neither_the_fissure_nor_a_cut_is_a_sulcus(
    apart: BrainMetrics, cut: BrainMetrics
) -> None:
    assert value(apart, "whole", "gyrification_index") == pytest.approx(1.0, abs=1e-6)
    assert value(cut, "whole", "gyrification_index") == pytest.approx(1.0, abs=0.02)
    # the wall of a cut is in the hull; what depth there is, is that of the facets
    assert value(cut, "whole", "sulcal_depth_95") < 0.05


def test_each_map_and_metric_has_a_record_and_each_record_is_written() -> None:
    ball = octasphere(20.0, 4)
    values = np.full(len(ball.vertices), 2.0)
    pial = measure_brain(
        ball,
        ball,
        None,
        thickness_mm=values,
        label_volumes_ml={"tissue": 30.0, "ventricles": 1.0, "cortex": 8.0},
        spangy_modes=60,
    )
    deviations = {*deviation_maps(ball, ball), "thickness_difference_mm"}
    drawn_in_report = {
        "displacement_mm",
        "area_growth_percent_per_gw",
        "thickness_growth_percent_per_gw",
    }
    at_template = maps_on_template({}, ball, ball, [])
    spread = ensemble_maps(ball, [ball, ball], [values] * 3)
    maps = {*pial.maps["left"], *at_template, *deviations, *drawn_in_report, *spread}
    assert maps == set(VERTEX_MAPS)
    white, white_maps = measure_white({"left": ball})
    assert set(white_maps["left"]) <= set(pial.maps["left"])
    regions = region_metrics(
        {"left": ball}, pial.maps, {"left": np.ones(len(values))}, {1: "all"}
    )
    named = {VERTEX_MAPS[name].mean_name.removeprefix("mean_") for name in deviations}
    tables = (pial.table, white, regions)
    metrics = {name for table in tables for name in table["metric"]}
    assert metrics | named == set(METRICS)
    for records in (VERTEX_MAPS, METRICS):
        assert all(record.name == name for name, record in records.items())
        with pytest.raises(KeyError, match=r"quantities\.py"):
            records["unheard_of"]


def test_cut_is_left_out(cut: BrainMetrics) -> None:
    whole = cut.table.query("hemisphere == 'whole'").set_index("metric")["value"]
    for side in ("left", "right"):
        half = cut.table.query(f"hemisphere == '{side}'").set_index("metric")["value"]
        assert half["area"] == pytest.approx(0.5 * whole["area"], rel=1e-3)
        assert half["volume"] == pytest.approx(0.5 * whole["volume"], rel=1e-3)
        assert half["gyrification_index"] == pytest.approx(1.0, abs=0.02)
        assert half["gyrification_index_envelope"] == pytest.approx(1.0, abs=0.03)
        assert half["mean_curvedness"] == pytest.approx(1 / 25.0, rel=0.02)
        # nothing of the cut's edge in the spectrum
        bands = cut.spectra.query(f"hemisphere == '{side}' and band > 0")
        power = bands.groupby("proxy")["power"].sum()
        assert power["shape_index"] < 1e-3 * half["spangy_shape_index_B0_power"]
        assert power["mean_curvature"] < 1e-3 * half["spangy_B0_power"]


def test_a_radius_that_reaches_the_cut_everywhere_is_refused() -> None:
    whole = sphere(10.0, 3)
    with pytest.raises(MeshError, check=Facts("metrics.curvature_radius_mm")):
        measure_brain(whole, *halves(whole), curvature_radius_mm=18.0)


def test_inside_out_is_refused() -> None:
    mesh = sphere(20.0, 2)
    with pytest.raises(MeshError, check=Facts("-32.4 mL")):
        measure_brain(flipped(mesh), mesh, mesh)


RADIUS, CORTEX = 20.0, 2.5


def test_depth_from_the_weight_of_the_model() -> None:
    depth = np.linspace(0, 2.5, 26)
    np.testing.assert_allclose(
        depth_of_weight(cortical_weight(1.5 * depth, 1.5)), depth, atol=1e-6
    )
    assert depth_of_weight(np.array([0.0]))[0] > 2.5


def test_the_border_is_carried_with_the_tissue() -> None:
    # a ball of concentric icospheres, and its surface: the first vertices of the mesh
    shells = [sphere(radius, 3) for radius in (20.0, 19.0, 17.0, 14.0, 9.0)]
    points = np.concatenate([*(shell.vertices for shell in shells), [[0.0, 0.0, 0.0]]])
    mesh, pial = TetrahedralMesh(points, Delaunay(points).simplices), shells[0]
    radius = np.linalg.norm(points, axis=1)
    depth = (RADIUS - radius) / CORTEX
    # growth by 1.4 makes the same cortex thicker; a distance of 2.5 mm in the later
    # shape would not see it
    for factor in (1.0, 1.4):
        later = TriangleMesh(factor * pial.vertices, pial.faces)
        grown = simulated_thickness(mesh, depth, factor * points, later)
        np.testing.assert_allclose(grown, factor * CORTEX, atol=0.2)
    # and a core that swells while the surface stays presses the cortex: r → 20
    # (r/20)^(1/2)
    pressed = points * (np.sqrt(RADIUS * radius) / np.maximum(radius, 1e-9))[:, None]
    expected = RADIUS - np.sqrt(RADIUS * (RADIUS - CORTEX))
    found = simulated_thickness(mesh, depth, pressed, pial)
    assert found.mean() == pytest.approx(expected, abs=0.15)


def test_values_of_a_part_of_another_surface_are_refused() -> None:
    whole = sphere(RADIUS, 2)
    part = TriangleMesh(whole.vertices[[5, 3, 8]].astype(np.float32), [[0, 1, 2]])
    with pytest.raises(InputError):
        at_part(np.arange(162), whole, moved(part, 1.0))
    with pytest.raises(InputError, check=Facts(161, 162)):
        at_part(np.arange(161), whole, part)


def test_means_of_regions_are_over_the_reliable_area() -> None:
    mesh = uneven(sphere(RADIUS))
    z = mesh.vertices[:, 2] / RADIUS
    # the height is the middle of a zone, over its area
    depth = np.where(np.abs(z) < 0.5, 99.0, z)
    maps = {
        "sulcal_depth_mm": depth,
        "thickness_mm": np.where(z < 0.4, np.nan, 2.0),
        "reliable": np.abs(z) > 0.5,
    }
    sides = {"left": mesh, "right": TriangleMesh(0.5 * mesh.vertices, mesh.faces)}
    labels = np.where(np.abs(z) < 0.8, 4, 0)
    labels[z < 0.4] = 3
    found = region_metrics(
        sides,
        dict.fromkeys(sides, maps),
        dict.fromkeys(sides, labels),
        {3: "a", 4: "b"},
    ).set_index(["hemisphere", "region", "metric"])["value"]
    for side, factor in (("left", 1.0), ("right", 0.25)):
        sphere_cm2 = factor * 4 * np.pi * RADIUS**2 / 100
        assert found[side, "a", "area"] == pytest.approx(0.7 * sphere_cm2, rel=0.02)
        assert found[side, "b", "area_share"] == pytest.approx(0.2, abs=0.01)
        # −1 to −0.5, and 0.5 to 0.8
        assert found[side, "a", "mean_sulcal_depth"] == pytest.approx(-0.75, abs=0.01)
        assert found[side, "b", "mean_sulcal_depth"] == pytest.approx(0.65, abs=0.01)
        assert np.isnan(found[side, "a", "mean_thickness"])
        assert found[side, "b", "mean_thickness"] == 2.0


def test_labels_of_regions_without_a_name_are_refused() -> None:
    mesh = sphere(RADIUS, 2)
    labels = np.where(mesh.vertices[:, 2] > 0, 7, 9)
    with pytest.raises(InputError, check=Facts("left", 9)):
        region_metrics({"left": mesh}, {"left": {}}, {"left": labels}, {7: "top"})


def test_surfaces_that_cut_each_other_are_counted() -> None:
    left, right = (sphere(20.0, 3, (x, 0, 0)) for x in (-18.0, 18.0))
    metrics = measure_brain(
        merged(left, right), left, right, curvature_radius_mm=6.0, spangy_modes=10
    )
    # the two spheres meet in a circle of radius √(20² − 18²), which at most a face or
    # two per edge length cross
    circle = 2 * np.pi * np.sqrt(20.0**2 - 18.0**2)
    assert circle / 3.0 < value(metrics, "whole", "crossing_faces") < 8 * circle / 3.0
    sides = [value(metrics, side, "crossing_faces") for side in ("left", "right")]
    assert sides == [0, 0]
