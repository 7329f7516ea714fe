"""Intervals of a run from the members of its ensemble, and maps of their spread."""

from types import SimpleNamespace

import nibabel as nib
import numpy as np
import pandas as pd
import pytest
from scripts import run_script
from shapes import rigid, sphere, uneven

from gyriflow.compare.accuracy import ensemble_maps, interval_table, spread_of_members
from gyriflow.geometry.deformations import transform_points
from gyriflow.geometry.triangles import TriangleMesh
from gyriflow.io.files import read_table, write_table
from gyriflow.io.surfaces import read_vertex_maps, write_surface, write_vertex_maps


def test_an_interval_contains_a_further_value_as_often_as_it_says():
    values = np.random.default_rng(0).normal(5, 2, size=(4000, 7))
    for level in (2 / 3, 0.9):
        half = np.array([spread_of_members(row[:6], level) for row in values])
        inside = np.abs(values[:, 6] - values[:, :6].mean(axis=1)) <= half
        assert np.mean(inside) == pytest.approx(level, abs=0.015)
    # t of 5 degrees of freedom
    values = np.array([0.0, 0, 0, 1, 1, 1])
    assert spread_of_members(values, 0.9) == pytest.approx(
        2.0150 * np.sqrt(0.3) * np.sqrt(7 / 6), rel=1e-4
    )
    assert np.isnan(spread_of_members(np.ones(1), 0.9))


def metrics(week, area, hemisphere="whole"):
    rows = {"area": area, "volume": 10.0, "thickness_sd": 1.0}
    return pd.DataFrame(
        [
            {
                "week": week,
                "hemisphere": hemisphere,
                "metric": m,
                "value": v,
                "unit": "u",
            }
            for m, v in rows.items()
        ]
    )


def test_intervals_of_members_that_reached_a_week_say_if_they_contain_the_observed():
    run = pd.concat([metrics(24.0, 100), metrics(26.0, 120), metrics(28.0, 140)])
    members = pd.concat(
        [
            *(metrics(24.0, area) for area in (98, 100, 102)),
            *(metrics(26.0, area) for area in (119, 121)),
        ]
        + [metrics(24.0, 1000, "left")]
    )
    observed = pd.concat([metrics(24.0, 101), metrics(26.0, 170)])
    found = (
        interval_table(run, members, observed)
        .set_index(["metric", "week"])
        .sort_index()
    )
    assert set(found.index.get_level_values("metric")) == {"area", "volume"}
    area = found.loc["area"]
    assert area["members"].tolist() == [3, 2, 0]
    assert area["mean"].tolist()[:2] == [100, 120]
    assert area["sd"].tolist()[:2] == pytest.approx([2, np.sqrt(2)])
    assert area["contains_observed"].tolist()[:2] == [True, False]
    assert area[["contains_observed", "low"]].loc[28].isna().all()
    # equal members have an interval of one value
    assert found.loc[("volume", 24.0), ["low", "high"]].tolist() == pytest.approx(
        [10, 10]
    )


def test_members_spread_and_tested_error_are_added_in_logarithms():
    tests = [
        {
            "start": start,
            "start_week": 22,
            "horizon": h,
            "model": "run",
            "protocol": "default",
            "area_difference": e,
        }
        for start, errors in (("a", (0.02, 0.10)), ("b", (-0.03, -0.08)))
        for h, e in zip((2.0, 4.0), errors, strict=True)
    ]
    run = pd.concat([metrics(24.0, 100), metrics(26.0, 120), metrics(28.0, 140)])
    members = pd.concat(
        [metrics(week, area) for week in (26.0, 28.0) for area in (139, 140, 142)]
    )
    wide, narrow = (
        interval_table(run, members, run[:0], given).set_index(["metric", "week"])
        for given in (tests, [])
    )
    logs = np.log([139, 140, 142])
    row = wide.loc[("area", 28.0)]
    assert row[["tests", "tested_starts"]].tolist() == [4, 2]
    assert row["largest_error"] == pytest.approx(0.10)
    # t of two degrees of freedom at 0.9
    spread = 2.9200 * logs.std(ddof=1) * np.sqrt(4 / 3)
    half = np.hypot(spread, np.log(1.10))
    assert row["low"] == pytest.approx(np.exp(logs.mean() - half), rel=1e-4)
    assert row["high"] == pytest.approx(np.exp(logs.mean() + half), rel=1e-4)
    assert narrow.loc[("area", 28.0), ["largest_error", "bias"]].isna().all()
    assert narrow.loc[("area", 28.0), "high"] == pytest.approx(
        np.exp(logs.mean() + spread), rel=1e-4
    )
    # a metric that was not tested
    assert wide.loc[("volume", 28.0), "high"] == pytest.approx(10)


def test_a_later_interval_is_not_narrower_and_the_index_is_that_of_the_folding():
    def brain(week, index):
        return (
            metrics(week, 1.0)
            .replace("thickness_sd", "gyrification_index")
            .assign(value=index)
        )

    run = pd.concat([brain(24.0, 1.08), brain(26.0, 1.18)])
    members = pd.concat(
        [
            *(brain(24.0, x) for x in (1.06, 1.10)),
            *(brain(26.0, x) for x in (1.18, 1.1801)),
        ]
    )
    found = (
        interval_table(run, members, run[:0])
        .set_index(["metric", "week"])
        .loc["gyrification_index"]
    )
    halves = [
        np.log((row["high"] - 0.98) / (row["low"] - 0.98)) / 2
        for _, row in found.iterrows()
    ]
    assert halves[0] == pytest.approx(
        6.3138 * np.log(0.12 / 0.08) / np.sqrt(2) * np.sqrt(3 / 2), rel=1e-3
    )
    assert halves[1] == pytest.approx(halves[0])


def test_a_corrected_bias_moves_the_interval():
    tests = [
        {
            "start": start,
            "start_week": 22,
            "horizon": 2.0,
            "model": "run",
            "protocol": "default",
            "area_difference": e,
        }
        for start, e in (("a", 0.25), ("b", 0.24), ("c", 0.26), ("d", 0.25))
    ]
    run = pd.concat([metrics(22.0, 80), metrics(24.0, 100)])
    members = pd.concat([metrics(24.0, 100), metrics(24.0, 100)])
    row = (
        interval_table(run, members, run[:0], tests)
        .set_index(["metric", "week"])
        .loc[("area", 24.0)]
    )
    assert row["bias"] == pytest.approx(0.25, abs=1e-3)
    assert np.sqrt(row["low"] * row["high"]) == pytest.approx(80, rel=1e-3)
    assert row["high"] < 83


def test_spread_is_that_of_places_after_rigid_alignment():
    # half of the vertices are in the part that moves, an eighth of the area
    mesh = uneven(sphere(20.0, 4))
    far = mesh.vertices[:, 2] > 15
    ways = [1.0, -1.0, 0.0]
    moved = [mesh.vertices + way * far[:, None] * mesh.vertices / 20 for way in ways]
    members = [
        TriangleMesh(
            transform_points(places, rigid(0, 0, 30 * number, shift=(5, 0, 0))),
            mesh.faces,
        )
        for number, places in enumerate(moved)
    ]
    assert np.isnan(ensemble_maps(mesh, [], [far * 1.0])["position_sd_mm"]).all()
    values = [np.where(far, share, 0.5) for share in (-0.38, -0.5, 0.38, -0.37)]
    found = ensemble_maps(mesh, members, values)
    # ±1 mm along the radius
    assert found["position_sd_mm"][far] == pytest.approx(1.0, abs=0.15)
    assert found["position_sd_mm"][mesh.vertices[:, 2] < 0].max() < 0.15
    assert set(found["sulcus_probability"][far]) == {0.5}
    assert set(found["gyrus_probability"][far]) == {0.25}
    assert set(found["gyrus_probability"][~far]) == {1.0}
    slight = ensemble_maps(mesh, members, [np.full(len(far), 0.37)])
    assert set(slight["gyrus_probability"]) == {0.0}


@pytest.mark.usefixtures("recorded_outputs")
def test_the_scripts_read_run_members_and_observed_brain_of_both_sides(tmp_path):
    for name, area in (("run", 100), ("one", 99), ("two", 101)):
        write_table(tmp_path / f"{name}.csv", metrics(24.0, area))
    inputs = {
        "run": ["run.csv"],
        "members": ["one.csv", "two.csv"],
        "observed": [],
        "accuracy": [],
    }
    run_script("ensemble.py", tmp_path, inputs, {0: "found.csv"})
    assert read_table(tmp_path / "found.csv")["contains_observed"].isna().all()
    surfaces = {"run": 20.0, "one": 21.0, "two": 19.0}
    for name, radius in surfaces.items():
        for side, more in (("left", 0.0), ("right", 10.0)):
            mesh = sphere(radius * (1 + more), 2)
            write_surface(tmp_path / f"{name}.{side}.surf.gii", mesh)
            write_vertex_maps(
                tmp_path / f"{name}.{side}.shape.gii",
                {"shape_index": np.full(len(mesh.vertices), -0.5)},
            )
    spreads = []
    for side in ("left", "right"):
        files = [f"{name}.{side}" for name in surfaces]
        inputs = {
            "surfaces": [f"{file}.surf.gii" for file in files],
            "maps": [f"{file}.shape.gii" for file in files],
        }
        run_script(
            "ensemble_maps.py",
            tmp_path,
            inputs,
            {0: "spread.shape.gii"},
            wildcards=SimpleNamespace(side=side),
        )
        spreads.append(
            read_vertex_maps(tmp_path / "spread.shape.gii")["position_sd_mm"].mean()
        )
        structure = nib.load(tmp_path / "spread.shape.gii").meta[
            "AnatomicalStructurePrimary"
        ]
        assert structure == f"Cortex{side.title()}"
    assert spreads == pytest.approx([np.sqrt(2), 11 * np.sqrt(2)], rel=1e-3)
