"""Deviation of an observed brain from the expected one: distances, areas and thickness
that are known."""

import numpy as np
import pandas as pd
import pytest
from scripts import run_script
from shapes import FAR, sphere

from gyriflow.compare.deviation import (
    deviation_scores,
    thickness_difference,
)
from gyriflow.geometry.triangles import transformed
from gyriflow.io.files import read_table
from gyriflow.io.surfaces import read_vertex_maps, write_surface, write_vertex_maps

BALL = sphere(20.0)


def test_the_expected_thickness_is_the_start_s_grown_as_in_the_run():
    # thickness differs between above and below, on surfaces with vertices of their own
    def thickness(mesh, above, below):
        return mesh, np.where(mesh.vertices[:, 2] > 0, above, below)

    expected = sphere(22.0)
    difference = thickness_difference(
        fitted=sphere(23.0),
        observed=thickness(sphere(23.0, 5), 2.5, 6.0),
        start=thickness(sphere(19.5, 3), 2.0, 1.5),
        simulated_start=thickness(BALL, 1.0, 2.0),
        expected_mm=thickness(expected, 1.5, 5.0)[1],
    )
    height = expected.vertices[:, 2]
    assert difference[height > 4] == pytest.approx(2.5 - 2.0 * 1.5 / 1.0)
    assert difference[height < -4] == pytest.approx(6.0 - 1.5 * 5.0 / 2.0)


def deviations(run, side, region, usual):
    """Return a deviation of twelve brains in one place of a run: a usual one ± 1."""
    subjects = [f"s{number}" for number in range(12)]
    table = pd.DataFrame({"start": subjects, "subject": subjects, "run": run})
    table = table.assign(hemisphere=side, region=region, metric="distance", unit="mm")
    values = usual + np.tile([1.0, -1.0], 6)
    return table.assign(week=25.0 + 0.1 * np.arange(12.0), value=values)


def test_a_deviation_is_scored_among_the_other_brains_of_its_run_and_place():
    places = [
        deviations("r", "whole", np.nan, 0.0),
        deviations("r", "left", "top", 9.0),
        deviations("q", "whole", np.nan, 50.0),
    ]
    table = pd.concat(places, ignore_index=True)
    scores = deviation_scores(table, individuals=True)
    expected = scores.groupby(["run", "hemisphere"])["expected"].mean()
    assert expected.to_dict() == pytest.approx(
        {("r", "whole"): 0.0, ("r", "left"): 9.0, ("q", "whole"): 50.0}, abs=0.5
    )
    assert np.sign(scores["z"]).tolist() == [1, -1] * 18
    # without the brain itself
    assert (scores["brains"] == 11).all()
    averages = deviation_scores(table, individuals=False)
    assert averages["centile"].isna().all()


# the turn of a sphere onto another is decided by rounding
@pytest.mark.remeshed
@pytest.mark.usefixtures("recorded_outputs")
def test_the_script_takes_each_surface_with_its_own_thickness(tmp_path):
    """The observed brain is in another pose, and a millimetre larger than expected; no
    two thicknesses are equal."""
    brains = {
        "start": (sphere(19.5, 3), 2.0),
        "first": (BALL, 1.0),
        "expected": (sphere(22.0), 1.5),
        "observed": (transformed(sphere(23.0), FAR[0]), 2.7),
    }
    inputs = {"thickness": [f"{name}.shape.gii" for name in brains], "regions": []}
    for name, (mesh, thickness_mm) in brains.items():
        write_surface(tmp_path / f"{name}.gii", mesh)
        values = np.full(len(mesh.vertices), thickness_mm)
        write_vertex_maps(tmp_path / f"{name}.shape.gii", {"thickness_mm": values})
        inputs[name] = f"{name}.gii"
    inputs["sides"] = ["expected.gii"]
    params = {"sides": ["left"], "columns": {"run": "r", "subject": "b", "week": 24.0}}
    outputs = {"maps": "maps.gii", "table": "table.csv"}
    run_script("deviation.py", tmp_path, inputs, outputs, params)
    maps = read_vertex_maps(tmp_path / "maps.gii")
    assert maps["distance_mm"] == pytest.approx(1.0, abs=0.05)
    difference = pytest.approx(2.7 - 2.0 * 1.5 / 1.0, abs=1e-3)
    assert maps["thickness_difference_mm"] == difference
    table = read_table(tmp_path / "table.csv").set_index(["hemisphere", "metric"])
    assert table["value"]["left", "distance"] == pytest.approx(1.0, abs=0.05)
