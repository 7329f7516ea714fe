"""All metrics of brains made of spheres, closed and cut, thickness, maps by region, and
distances between surfaces."""

import numpy as np
import pytest
from facts import Facts
from scipy.spatial import Delaunay
from shapes import FAR, ellipsoid, octasphere, sphere, uneven

from gyriflow.compare.accuracy import ensemble_maps
from gyriflow.compare.deviation import deviation_maps
from gyriflow.errors import InputError, MeshError
from gyriflow.folding.layers import cortical_weight
from gyriflow.geometry.tetrahedra import TetrahedralMesh
from gyriflow.geometry.triangles import (
    TriangleMesh,
    area_cm2,
    flipped,
    merged,
    submesh,
    transformed,
    vertex_areas,
)
from gyriflow.growth.carrying import maps_on_template
from gyriflow.metrics.curvature import curvature
from gyriflow.metrics.gyrification import cap
from gyriflow.metrics.measure import (
    BrainMetrics,
    area_ratio,
    hemisphere_spectra,
    measure_brain,
    measure_white,
    thickness_metrics,
)
from gyriflow.metrics.tables import region_metrics
from gyriflow.metrics.thickness import at_part, depth_of_weight, simulated_thickness
from gyriflow.quantities import METRICS, VERTEX_MAPS
from gyriflow.settings.terms import PROXIES


def value(metrics: BrainMetrics, hemisphere: str, metric: str) -> float:
    rows = metrics.table.query("hemisphere == @hemisphere and metric == @metric")
    assert len(rows) == 1
    return float(rows["value"].iloc[0])


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
    whole = octasphere(25.0)
    on_right = whole.vertices[whole.faces].mean(axis=1)[:, 0] > 0
    whole = transformed(whole, FAR[0])
    left, right = submesh(whole, ~on_right)[0], submesh(whole, on_right)[0]
    return measure_brain(whole, left, right, spangy_modes=60)


def test_ratios_of_the_whole_have_its_area_without_caps() -> None:
    ball = octasphere(25.0)
    half = submesh(ball, ball.vertices[ball.faces].mean(axis=1)[:, 0] < 0)[0]
    other = flipped(
        TriangleMesh(half.vertices * [-1.0, 1.0, 1.0] + [1.0, 0.0, 0.0], half.faces)
    )
    found = measure_brain(merged(cap(half), cap(other)), half, other, spangy_modes=60)
    area, volume = value(found, "whole", "area"), value(found, "whole", "volume")
    assert area == pytest.approx(area_cm2(ball))
    assert value(found, "whole", "relative_area") == pytest.approx(
        area / volume ** (2 / 3)
    )


def test_two_spheres(apart: BrainMetrics) -> None:
    for name, radius in (("left", 20.0), ("right", 25.0)):
        expected = {
            "volume": (4 / 3 * np.pi * radius**3 / 1000, 0.01),
            "area": (4 * np.pi * radius**2 / 100, 0.01),
            "gyrification_index": (1.0, 1e-6),
            "gyrification_index_envelope": (1.0, 0.01),
            "mean_shape_index": (1.0, 0.01),
            "mean_curvedness": (1 / radius, 0.02),
            "mean_curvature_q50": (1 / radius, 0.02),
            "intrinsic_curvature_index": (1.0, 0.02),
            "mean_curvature_norm": (1.0, 0.02),
            "gaussian_curvature_norm": (1.0, 0.02),
            "curvature_wavelength": (4 * value(apart, name, "curvature_radius"), 1e-9),
            # Weyl's number by the paper's formula is 8192/2π, whatever the radius
            "weyl_number": (8192 / (2 * np.pi), 0.01),
            "spangy_modes": (60, 0),
        }
        for metric, (wanted, tolerance) in expected.items():
            assert value(apart, name, metric) == pytest.approx(wanted, rel=tolerance), (
                metric
            )
        for metric in (
            "sulcal_area_share",
            "mean_sulcal_depth",
            "crossing_faces",
            "folding_index",
        ):
            assert value(apart, name, metric) == pytest.approx(0.0, abs=0.05), metric
    for metric in ("volume", "area"):
        both = value(apart, "left", metric) + value(apart, "right", metric)
        assert value(apart, "whole", metric) == pytest.approx(both)


def test_volumes_of_tissues_are_of_the_whole_where_labels_know_them(
    apart: BrainMetrics, cut: BrainMetrics
) -> None:
    found = apart.table[apart.table["metric"].str.startswith("volume_")]
    assert found["hemisphere"].tolist() == ["whole", "whole"]
    assert dict(zip(found["metric"], found["value"], strict=True)) == {
        "volume_tissue": 90.0,
        "volume_cortex": 20.0,
    }
    assert not cut.table["metric"].str.startswith("volume_").any()


def test_the_pial_area_is_compared_with_that_of_a_sheet_of_the_cortex() -> None:
    sizes = {"area": 300.0, "volume_cortex": 80.0}
    assert area_ratio(sizes | {"mean_thickness": 2.0}, 0.0) == {
        "area_ratio": pytest.approx(0.75)
    }
    assert area_ratio(sizes | {"mean_thickness": 2.0}, 0.125) == {
        "area_ratio": pytest.approx(0.6)
    }
    assert area_ratio(sizes, 0.125) == {}


def test_neither_the_fissure_nor_a_cut_is_a_sulcus(
    apart: BrainMetrics, cut: BrainMetrics
) -> None:
    assert value(apart, "whole", "gyrification_index") == pytest.approx(1.0, abs=1e-6)
    assert value(cut, "whole", "gyrification_index") == pytest.approx(1.0, abs=0.02)
    # the wall of a cut is in the hull; what depth there is, is that of the facets
    assert value(cut, "whole", "sulcal_depth_95") < 0.05


def test_thickness_is_that_of_each_side() -> None:
    left, right = (ellipsoid((20.0, 20.0, 26.0), 3, (x, 0, 0)) for x in (-21.0, 21.0))
    thickness = np.linspace(1.0, 2.0, 2 * len(left.vertices))
    one = measure_brain(
        merged(left, right), left, right, thickness_mm=thickness, spangy_modes=20
    )
    assert (
        value(one, "left", "mean_thickness")
        < 1.5
        < value(one, "right", "mean_thickness")
    )
    assert value(one, "whole", "mean_thickness") == pytest.approx(1.5, abs=0.01)
    np.testing.assert_allclose(
        one.maps["left"]["thickness_mm"], thickness[: len(left.vertices)]
    )


def test_maps_and_spectra(apart: BrainMetrics) -> None:
    assert set(apart.maps) == {"left", "right"}
    assert {len(values) for values in apart.maps["left"].values()} == {2562}
    assert apart.spectra["hemisphere"].tolist() == ["left"] * 14 + ["right"] * 14
    assert apart.spectra["proxy"].tolist() == 2 * (
        ["mean_curvature"] * 7 + ["shape_index"] * 7
    )
    assert apart.spectra["band"].tolist() == 4 * [*range(7)]
    # a sphere has the mean curvature 1/R and the shape index 1: all power is in B0, the
    # square times the area
    for proxy, squared in (("", 20.0**-2), ("shape_index_", 1.0)):
        power = value(apart, "left", f"spangy_{proxy}B0_power")
        assert power == pytest.approx(squared * 4 * np.pi * 20.0**2, rel=0.02)
        assert value(apart, "left", f"spangy_{proxy}captured_share") == pytest.approx(
            1.0, abs=1e-3
        )
        coefficients = apart.coefficients[
            f"coefficient_{proxy.rstrip('_') or 'mean_curvature'}"
        ]
        assert coefficients[0] ** 2 == pytest.approx(power)


def test_the_whole_is_both_sides_by_area_where_sides_and_vertices_are_unequal() -> None:
    def bumpy(axes, subdivisions, x):
        mesh = ellipsoid(axes, subdivisions)
        bumps = 1.0 + 0.04 * np.sin(0.5 * mesh.vertices[:, 1]) * np.cos(
            0.4 * mesh.vertices[:, 2]
        )
        # denser on one side
        return TriangleMesh(
            mesh.vertices * bumps[:, None]
            + [x, 0, 0]
            + 4 * np.tanh(mesh.vertices / 20),
            mesh.faces,
        )

    left = bumpy((18.0, 26.0, 20.0), 4, -40.0)
    right = bumpy((24.0, 34.0, 22.0), 3, 40.0)
    thickness = np.concatenate(
        [
            np.linspace(1.0, 2.0, len(left.vertices)),
            np.linspace(3.0, 5.0, len(right.vertices)),
        ]
    )
    sides = {"left": left, "right": right}
    found = measure_brain(
        merged(left, right),
        left,
        right,
        thickness_mm=thickness,
        label_volumes_ml={"cortex": 60.0},
        curvature_radius_mm=6.0,
        spangy_modes=30,
    )
    numbers = found.table.set_index(["metric", "hemisphere"])["value"].unstack()
    areas = np.array([area_cm2(mesh) for mesh in sides.values()])
    share = areas / areas.sum()
    means = [
        "mean_shape_index",
        "mean_curvedness",
        "sulcal_area_share",
        "mean_sulcal_depth",
        "mean_thickness",
    ]
    # which do not depend on the side
    scales = ["curvature_radius", "curvature_wavelength"]
    sums = [
        "area",
        "volume",
        "intrinsic_curvature_index",
        "folding_index",
        "mean_curvature_norm",
    ]
    both = numbers[["left", "right"]]
    averages = means + scales
    np.testing.assert_allclose(
        numbers.loc[averages, "whole"], both.loc[averages] @ share, rtol=1e-9
    )
    np.testing.assert_allclose(
        numbers.loc[sums, "whole"], both.loc[sums].sum(axis=1), rtol=1e-6
    )
    # squares add up: √(A ∫K²) and the spread of thickness
    squares = both.loc["gaussian_curvature_norm"] ** 2 / areas
    assert numbers.loc["gaussian_curvature_norm", "whole"] == pytest.approx(
        np.sqrt(areas.sum() * squares.sum())
    )
    spread = (
        both.loc["thickness_sd"] ** 2
        + (both.loc["mean_thickness"] - numbers.loc["mean_thickness", "whole"]) ** 2
    )
    assert numbers.loc["thickness_sd", "whole"] == pytest.approx(
        np.sqrt(spread @ share)
    )
    for name in ("gyrification_index", "gyrification_index_envelope"):
        assert numbers.loc[name, "whole"] == pytest.approx(
            areas.sum() / np.sum(areas / both.loc[name])
        )
    # and each side has its own
    assert (np.abs(both["left"] / both["right"] - 1)[means + sums] > 0.01).all()
    for name, mesh in sides.items():
        maps = found.maps[name]
        weights = vertex_areas(mesh)
        assert both.loc["mean_sulcal_depth", name] == pytest.approx(
            np.average(maps["sulcal_depth_mm"], weights=weights)
        )
        assert both.loc["sulcal_depth_95", name] == pytest.approx(
            np.quantile(
                maps["sulcal_depth_mm"], 0.95, weights=weights, method="inverted_cdf"
            )
        )
        power = found.spectra.query(
            "hemisphere == @name and proxy == 'shape_index'"
        ).set_index("band")["power"]
        total = np.average(maps["shape_index"] ** 2, weights=weights) * weights.sum()
        assert both.loc["spangy_shape_index_captured_share", name] == pytest.approx(
            power.sum() / total, rel=1e-6
        )
        assert both.loc["spangy_shape_index_B1_power", name] == pytest.approx(power[1])
        assert both.loc["relative_area", name] == pytest.approx(
            both.loc["area", name] / both.loc["volume", name] ** (2 / 3)
        )
        # κ1 κ2, of H and the curvedness
        assert maps["gaussian_curvature"] == pytest.approx(
            2 * maps["mean_curvature"] ** 2 - maps["curvedness"] ** 2, abs=1e-12
        )
        modes = found.coefficients.query("hemisphere == @name")
        assert modes["mode"].tolist() == list(range(30))
        assert (np.diff(modes["eigenvalue_per_mm2"]) > 0).all()
        for proxy in PROXIES:
            squares = modes[f"coefficient_{proxy}"] ** 2
            bands = found.spectra.query("hemisphere == @name and proxy == @proxy")
            assert squares.groupby(modes["band"]).sum().to_dict() == pytest.approx(
                bands.set_index("band")["power"].loc[: modes["band"].max()].to_dict()
            )
    # the cortex as a bent sheet of its thickness
    bent = [
        np.average(found.maps[name]["mean_curvature"], weights=vertex_areas(mesh))
        for name, mesh in sides.items()
    ]
    mean_mm = numbers.loc["mean_thickness", "whole"]
    sheet_cm2 = 60_000 / mean_mm / 100 * (1 + np.average(bent, weights=areas) * mean_mm)
    assert numbers.loc["area_ratio", "whole"] == pytest.approx(areas.sum() / sheet_cm2)


def test_one_wavelength_is_one_band_of_mean_curvature_but_not_of_shape_index() -> None:
    ball = sphere(1.0, 4)
    x, y, _ = ball.vertices.T
    # a harmonic of degree 8, in the middle of B3; B4 has the degrees 11 to 22
    folds = TriangleMesh(
        ball.vertices * (25.0 + 2.0 * np.real((x + 1j * y) ** 8))[:, None], ball.faces
    )
    found = hemisphere_spectra(folds, curvature(folds, radius_mm=3.0), 23**2)
    share = {proxy: found[proxy].bands["relative_power"][4] for proxy in PROXIES}
    assert share["mean_curvature"] < 0.02
    assert share["shape_index"] > 0.07


def test_each_map_and_metric_has_a_record_and_each_record_is_written(
    apart: BrainMetrics,
) -> None:
    ball = octasphere(20.0)
    volumes = {"tissue": 30.0, "ventricles": 1.0, "cortex": 8.0}
    thick = measure_brain(
        ball,
        ball,
        None,
        thickness_mm=np.full(len(ball.vertices), 2.0),
        label_volumes_ml=volumes,
        spangy_modes=60,
    )
    deviations = {
        **deviation_maps(ball, ball),
        "thickness_difference_mm": np.zeros(len(ball.vertices)),
    }
    at_template = maps_on_template({}, ball, ball, [])
    drawn_in_report = {
        "displacement_mm",
        "area_growth_percent_per_gw",
        "thickness_growth_percent_per_gw",
    }
    spread = ensemble_maps(ball, [ball, ball], [np.zeros(len(ball.vertices))] * 3)
    assert {
        *thick.maps["left"],
        *at_template,
        *deviations,
        *drawn_in_report,
        *spread,
    } == set(VERTEX_MAPS)
    white, white_maps = measure_white({"left": ball})
    assert set(white_maps["left"]) <= set(thick.maps["left"])
    regions = region_metrics(
        {"left": ball}, thick.maps, {"left": np.ones(len(ball.vertices))}, {1: "all"}
    )
    named = {
        f"{VERTEX_MAPS[name].mean_name.removeprefix('mean_')}" for name in deviations
    }
    assert {
        *thick.table["metric"],
        *white["metric"],
        *regions["metric"],
        *named,
    } == set(METRICS)
    for records in (VERTEX_MAPS, METRICS):
        assert all(record.name == name for name, record in records.items())
        with pytest.raises(KeyError, match=r"quantities\.py"):
            records["unheard_of"]


def test_cut_is_left_out(cut: BrainMetrics) -> None:
    for name in ("left", "right"):
        assert value(cut, name, "area") == pytest.approx(
            0.5 * value(cut, "whole", "area"), rel=1e-3
        )
        assert value(cut, name, "volume") == pytest.approx(
            0.5 * value(cut, "whole", "volume"), rel=1e-3
        )
        assert value(cut, name, "gyrification_index") == pytest.approx(1.0, abs=0.02)
        assert value(cut, name, "gyrification_index_envelope") == pytest.approx(
            1.0, abs=0.03
        )
        assert value(cut, name, "mean_shape_index") == pytest.approx(
            value(cut, "whole", "mean_shape_index"), abs=0.01
        )
        assert value(cut, name, "mean_curvedness") == pytest.approx(1 / 25.0, rel=0.02)
        # nothing of the cut's edge in the spectrum
        total = (
            cut.spectra.query("hemisphere == @name and band > 0")
            .groupby("proxy")["power"]
            .sum()
        )
        assert total["shape_index"] < 1e-3 * value(
            cut, name, "spangy_shape_index_B0_power"
        )
        assert total["mean_curvature"] < 1e-3 * value(cut, name, "spangy_B0_power")


def test_surfaces_that_cut_each_other_are_counted() -> None:
    left, right = (sphere(20.0, 3, (x, 0, 0)) for x in (-18.0, 18.0))
    metrics = measure_brain(
        merged(left, right), left, right, curvature_radius_mm=6.0, spangy_modes=10
    )
    # the two spheres meet in a circle of radius √(20² − 18²), which at most a face or
    # two per edge length cross
    circle = 2 * np.pi * np.sqrt(20.0**2 - 18.0**2)
    assert circle / 3.0 < value(metrics, "whole", "crossing_faces") < 8 * circle / 3.0
    assert (
        value(metrics, "left", "crossing_faces")
        == value(metrics, "right", "crossing_faces")
        == 0
    )


def test_a_radius_that_reaches_the_cut_everywhere_is_refused() -> None:
    whole = sphere(10.0, 3)
    on_right = whole.vertices[whole.faces].mean(axis=1)[:, 0] > 0
    with pytest.raises(MeshError, check=Facts("metrics.curvature_radius_mm")):
        measure_brain(
            whole,
            submesh(whole, ~on_right)[0],
            submesh(whole, on_right)[0],
            curvature_radius_mm=18.0,
        )


def test_inside_out_is_refused() -> None:
    mesh = sphere(20.0, 2)
    with pytest.raises(MeshError, check=Facts("-32.4 mL")):
        measure_brain(flipped(mesh), mesh, mesh)


RADIUS, CORTEX = 20.0, 2.5


@pytest.fixture(scope="module")
def ball() -> tuple[TetrahedralMesh, TriangleMesh]:
    """A ball of concentric icospheres, and its surface (the first vertices of the
    mesh)."""
    shells = [sphere(radius, 3) for radius in (20.0, 19.0, 17.0, 14.0, 9.0)]
    points = np.concatenate([*(shell.vertices for shell in shells), [[0.0, 0.0, 0.0]]])
    tets = Delaunay(points).simplices
    return TetrahedralMesh(points, tets), shells[0]


def depth_of(mesh: TetrahedralMesh) -> np.ndarray:
    return (RADIUS - np.linalg.norm(mesh.vertices, axis=1)) / CORTEX


def test_thickness_at_the_start_is_the_cortex(ball) -> None:
    mesh, pial = ball
    np.testing.assert_allclose(
        simulated_thickness(mesh, depth_of(mesh), mesh.vertices, pial),
        CORTEX,
        atol=0.15,
    )


def test_depth_from_the_weight_of_the_model() -> None:
    depth = np.linspace(0, 2.5, 26)
    np.testing.assert_allclose(
        depth_of_weight(cortical_weight(1.5 * depth, 1.5)), depth, atol=1e-6
    )
    assert depth_of_weight(np.array([0.0]))[0] > 2.5


def test_the_border_is_carried_with_the_tissue(ball) -> None:
    mesh, pial = ball
    # growth by 1.4 makes the same cortex thicker; a distance of 2.5 mm in the later
    # shape would not see it
    grown = simulated_thickness(
        mesh,
        depth_of(mesh),
        1.4 * mesh.vertices,
        TriangleMesh(1.4 * pial.vertices, pial.faces),
    )
    np.testing.assert_allclose(grown, 1.4 * CORTEX, atol=0.2)
    # and a core that swells while the surface stays presses the cortex: r → 20
    # (r/20)^(1/2)
    radius = np.linalg.norm(mesh.vertices, axis=1)
    pressed = (
        mesh.vertices * (np.sqrt(RADIUS * radius) / np.maximum(radius, 1e-9))[:, None]
    )
    found = simulated_thickness(mesh, depth_of(mesh), pressed, pial)
    assert found.mean() == pytest.approx(
        RADIUS - np.sqrt(RADIUS * (RADIUS - CORTEX)), abs=0.15
    )


def test_values_of_a_part() -> None:
    whole = sphere(RADIUS, 2)
    part = TriangleMesh(whole.vertices[[5, 3, 8]].astype(np.float32), [[0, 1, 2]])
    np.testing.assert_array_equal(at_part(np.arange(162), whole, part), [5, 3, 8])
    with pytest.raises(InputError):
        at_part(
            np.arange(162), whole, TriangleMesh(whole.vertices[:3] + 1.0, [[0, 1, 2]])
        )
    with pytest.raises(InputError, check=Facts(161, 162)):
        at_part(np.arange(161), whole, part)


def test_thickness_metrics_leave_out_what_was_not_measured() -> None:
    rows = thickness_metrics(np.array([1.0, 2.0, np.nan]), np.array([3.0, 1.0, 4.0]))
    assert rows["mean_thickness"] == pytest.approx(1.25)
    assert rows["thickness_sd"] == pytest.approx(
        np.sqrt(0.75 * 0.25**2 + 0.25 * 0.75**2)
    )
    assert (rows["thickness_q05"], rows["thickness_q95"]) == (1.0, 2.0)
    assert rows["thickness_measured_share"] == pytest.approx(0.5)
    assert thickness_metrics(np.full(3, np.nan), np.ones(3)) == {}


def test_means_of_regions_are_over_the_reliable_area() -> None:
    mesh = uneven(sphere(RADIUS))
    z = mesh.vertices[:, 2] / RADIUS
    # the height is the middle of a zone, over its area
    depth = np.where(np.abs(z) < 0.5, 99.0, z)
    maps = {"sulcal_depth_mm": depth, "reliable": np.abs(z) > 0.5}
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


def test_regions_have_their_area_and_means() -> None:
    mesh = sphere(RADIUS)
    top = mesh.vertices[:, 2] > 0
    labels = np.where(top, 7, np.where(mesh.vertices[:, 2] < -10.0, 9, 0))
    thickness = np.where(top, 1.0, 3.0)
    thickness[np.flatnonzero(top)[:5]] = np.nan
    maps = {
        "thickness_mm": thickness,
        "shape_index": np.ones(len(labels)),
        "reliable": np.ones(len(labels)),
    }
    found = region_metrics(
        {"left": mesh}, {"left": maps}, {"left": labels}, {7: "top", 9: "bottom"}
    )
    value = found.set_index(["region", "metric"])["value"]
    areas = vertex_areas(mesh)
    assert value["top", "area"] == pytest.approx(areas[top].sum() / 100)
    # a cap of height 10 mm is a quarter of the sphere
    assert value["bottom", "area_share"] == pytest.approx(0.25, abs=0.02)
    assert value["top", "mean_thickness"] == 1.0
    assert value["bottom", "mean_thickness"] == 3.0
    assert found.set_index("metric").loc["mean_thickness", "unit"].tolist() == [
        "mm",
        "mm",
    ]
    lengths = {
        "thickness_mm": "mm",
        "sulcal_depth_mm": "mm",
        "distance_mm": "mm",
        "thickness_difference_mm": "mm",
    }
    units = {
        "shape_index": "1",
        "curvedness": "1/mm",
        "mean_curvature": "1/mm",
        "log_area": "1",
        **lengths,
    }
    every = {name: np.ones(len(labels)) for name in units}
    rows = region_metrics(
        {"left": mesh}, {"left": every}, {"left": np.full(len(labels), 7)}, {7: "all"}
    )
    means = {
        f"mean_{name.removesuffix('_mm').removeprefix('mean_')}": unit
        for name, unit in units.items()
    }
    assert dict(zip(rows["metric"], rows["unit"], strict=True)) == {
        "area": "cm2",
        "area_share": "1",
        **means,
    }
    with pytest.raises(InputError, check=Facts("left", 9)):
        region_metrics({"left": mesh}, {"left": maps}, {"left": labels}, {7: "top"})
