"""Intervals of a run from the members of its ensemble, and maps of their spread."""

from types import SimpleNamespace

import nibabel as nib
import numpy as np
import pandas as pd
import pytest
from scripts import run_script
from shapes import sphere

from gyriflow.compare.accuracy import ensemble_maps, interval_table
from gyriflow.io.files import write_table
from gyriflow.io.surfaces import write_surface, write_vertex_maps


def brain(week, area, metric="area"):
    """Return a metric of a brain, and its volume, which is always the same."""
    rows = {"metric": [metric, "volume"], "value": [area, 10.0]}
    return pd.DataFrame(rows).assign(week=week, hemisphere="whole", unit="u")


def intervals(run, members, tests=()):
    """Return the intervals of brains by metric and week."""
    tables = [pd.concat(run), pd.concat(members), brain(0.0, 0.0)[:0]]
    return interval_table(*tables, tests).set_index(["metric", "week"]).sort_index()


def test_spread_and_tested_error_are_added_in_logarithms_about_the_mean_less_the_bias():
    errors = {"a": 0.25, "b": 0.24, "c": 0.26, "d": 0.25}
    tests = []
    for start, error in errors.items():
        test = {"start": start, "start_week": 22, "horizon": 2.0, "model": "run"}
        tests.append(test | {"protocol": "default", "area_difference": error})
    members = [brain(24.0, 139), brain(24.0, 140), brain(24.0, 142)]
    found = intervals([brain(22.0, 80), brain(24.0, 100)], members, tests=tests)
    row = found.loc[("area", 24.0)]
    logs = np.log1p(list(errors.values()))
    assert np.log1p(row["bias"]) == pytest.approx(logs.mean())
    largest = np.abs(logs - logs.mean()).max()
    # t of two degrees of freedom at 0.9
    spread = 2.9200 * np.log([139, 140, 142]).std(ddof=1) * np.sqrt(4 / 3)
    half = np.log(row["high"] / row["low"]) / 2
    assert half == pytest.approx(np.hypot(spread, largest), rel=1e-4)
    middle = np.log(row["high"] * row["low"]) / 2
    assert middle == pytest.approx(np.log([139, 140, 142]).mean() - logs.mean())
    # a metric that was not tested
    assert found.loc[("volume", 24.0), "high"] == pytest.approx(10)


def test_a_later_interval_is_not_narrower_and_the_index_is_that_of_the_folding():
    indices = {24.0: (1.06, 1.10), 26.0: (1.18, 1.1801)}
    members = []
    for week, values in indices.items():
        members += [brain(week, value, "gyrification_index") for value in values]
    found = intervals(members[::2], members).loc["gyrification_index"]
    halves = np.log((found["high"] - 0.98) / (found["low"] - 0.98)) / 2
    spread = 6.3138 * np.log(0.12 / 0.08) / np.sqrt(2) * np.sqrt(3 / 2)
    assert halves.tolist() == pytest.approx([spread, spread], rel=1e-3)


def test_the_limits_of_sulcus_and_gyrus_are_those_of_rut_and_ridge():
    mesh = sphere(20.0, 2)
    shape_indices = [-0.38, -0.5, 0.38, -0.37, 0.37]
    values = [np.full(len(mesh.vertices), value) for value in shape_indices]
    found = ensemble_maps(mesh, [], values)
    assert set(found["sulcus_probability"]) == {0.4}
    assert set(found["gyrus_probability"]) == {0.2}
    assert np.isnan(found["position_sd_mm"]).all()


@pytest.mark.usefixtures("recorded_outputs")
def test_the_scripts_read_run_members_and_observed_brain_of_both_sides(tmp_path):
    for name, area in (("run", 100), ("one", 99), ("two", 101)):
        write_table(tmp_path / f"{name}.csv", brain(24.0, area))
    inputs = {"run": ["run.csv"], "members": ["one.csv", "two.csv"]}
    inputs |= {"observed": [], "accuracy": []}
    run_script("ensemble.py", tmp_path, inputs, {0: "found.csv"})
    surfaces = {"run": 20.0, "one": 21.0, "two": 19.0}
    for name, radius in surfaces.items():
        for side, more in (("left", 0.0), ("right", 10.0)):
            mesh = sphere(radius * (1 + more), 2)
            maps = {"shape_index": np.full(len(mesh.vertices), -0.5)}
            write_surface(tmp_path / f"{name}.{side}.surf.gii", mesh)
            write_vertex_maps(tmp_path / f"{name}.{side}.shape.gii", maps)
    for side in ("left", "right"):
        files = [f"{name}.{side}" for name in surfaces]
        inputs = {
            "surfaces": [f"{file}.surf.gii" for file in files],
            "maps": [f"{file}.shape.gii" for file in files],
        }
        job = {"wildcards": SimpleNamespace(side=side)}
        file = tmp_path / "spread.shape.gii"
        run_script("ensemble_maps.py", tmp_path, inputs, {0: file.name}, **job)
        structure = nib.load(file).meta["AnatomicalStructurePrimary"]
        assert structure == f"Cortex{side.title()}"
