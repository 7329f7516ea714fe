"""Deviation of an observed brain from the expected one: distances, areas and thickness
that are known."""

import numpy as np
import pandas as pd
import pytest
from scripts import run_script
from shapes import FAR, moved, sphere

from gyriflow.compare.deviation import (
    deviation_maps,
    deviation_scores,
    deviation_table,
    thickness_difference,
)
from gyriflow.geometry.triangles import TriangleMesh, merged, transformed
from gyriflow.io.files import read_table
from gyriflow.io.surfaces import read_vertex_maps, write_surface, write_vertex_maps

BALL = sphere(20.0)


def scaled(factors):
    return TriangleMesh(BALL.vertices * factors, BALL.faces)


def test_a_larger_ball_lies_outside_and_has_more_area():
    maps = deviation_maps(BALL, scaled(1.1))
    np.testing.assert_allclose(maps["distance_mm"], 2.0, atol=0.01)
    np.testing.assert_allclose(maps["log_area"], 2 * np.log(1.1), atol=1e-6)
    smaller = deviation_maps(BALL, scaled(0.9))
    assert (smaller["distance_mm"] < 0).all()
    assert (smaller["log_area"] < 0).all()


def test_a_deviation_in_one_place_is_found_there_alone():
    top = np.linalg.norm(BALL.vertices - [0, 0, 20], axis=1) < 12
    maps = deviation_maps(BALL, scaled(np.where(top, 1.1, 1.0)[:, None]))
    assert maps["distance_mm"][top] == pytest.approx(2.0, abs=0.05)
    assert not maps["distance_mm"][~top].any()
    pole, opposite = BALL.vertices[:, 2].argmax(), BALL.vertices[:, 2].argmin()
    assert maps["log_area"][pole] == pytest.approx(2 * np.log(1.1), abs=0.01)
    assert maps["log_area"][opposite] == pytest.approx(0.0, abs=0.01)


def test_areas_are_compared_after_a_gaussian_of_3_mm():
    degree, height = 8, 0.005
    wave = np.polynomial.Legendre.basis(degree)(BALL.vertices[:, 2] / 20)
    found = deviation_maps(BALL, scaled(1 + height * wave[:, None]))["log_area"]
    # heat over the time σ²/2 in eight implicit steps, along the sphere's own wave
    decay = (1 + degree * (degree + 1) / 20**2 * 3**2 / 2 / 8) ** -8
    assert found @ wave / (wave @ wave) == pytest.approx(2 * height * decay, rel=0.1)


def test_the_expected_thickness_is_the_start_s_grown_as_in_the_run():
    # thickness differs between above and below, on surfaces with vertices of their own
    def thickness(mesh, above, below):
        return mesh, np.where(mesh.vertices[:, 2] > 0, above, below)

    expected, start, observed = sphere(22.0), sphere(19.5, 3), sphere(23.0, 5)
    first, expected_mm = thickness(BALL, 1.0, 2.0), thickness(expected, 1.5, 5.0)[1]
    difference = thickness_difference(
        sphere(23.0),
        thickness(observed, 2.5, 6.0),
        thickness(start, 2.0, 1.5),
        first,
        expected_mm,
    )
    height = expected.vertices[:, 2]
    # 2.0 mm became 2.0 · 1.5 mm / 1.0 mm above, and 1.5 mm became 1.5 · 5.0 mm / 2.0 mm
    # below
    assert difference[height > 4] == pytest.approx(2.5 - 3.0)
    assert difference[height < -4] == pytest.approx(6.0 - 3.75)


def test_maps_are_averaged_over_the_brain_its_sides_and_their_regions():
    left, right = moved(BALL, -25), moved(sphere(10.0), 25)
    surface = merged(left, right)
    upper = [mesh.vertices[:, 2] > 1e-9 for mesh in (left, right)]
    maps = {
        "distance_mm": np.concatenate(
            [np.where(upper[0], 1.0, 0.0), np.where(upper[1], 3.0, -3.0)]
        )
    }
    regions = {
        "left": (upper[0].astype(np.int64), {1: "top"}),
        "right": (2 - upper[1].astype(np.int64), {1: "a", 2: "b"}),
    }
    table = deviation_table(
        {"run": "r", "week": 24.0},
        surface,
        maps,
        {"left": left, "right": right},
        regions,
    )
    assert list(table) == [
        "run",
        "week",
        "hemisphere",
        "region",
        "metric",
        "value",
        "unit",
    ]
    assert set(table["metric"]) == {"distance"}
    assert set(table["unit"]) == {"mm"}
    values = table.set_index(["hemisphere", "region"])["value"]
    assert values.drop(
        [("whole", ""), ("left", ""), ("right", "")]
    ).to_dict() == pytest.approx(
        {("left", "top"): 1.0, ("right", "a"): 3.0, ("right", "b"): -3.0}
    )
    share = values["left", ""]
    assert share == pytest.approx(0.5, abs=0.05)
    # the left side has four times the area of the right one
    assert values["whole", ""] == pytest.approx(
        (4 * share + values["right", ""]) / 5, rel=1e-3
    )


def test_a_deviation_is_scored_among_the_other_brains_of_its_run_and_place():
    subjects = [f"s{number}" for number in range(12)]
    weeks = 25.0 + 0.1 * np.arange(12.0)
    common = {
        "start": subjects,
        "subject": subjects,
        "week": weeks,
        "metric": "distance",
        "unit": "mm",
    }
    places = [
        ("r", "whole", np.nan, 0.0),
        ("r", "left", "top", 9.0),
        ("q", "whole", np.nan, 50.0),
    ]
    tables = [
        pd.DataFrame(
            {
                **common,
                "run": run,
                "hemisphere": side,
                "region": region,
                "value": usual + np.tile([1, -1], 6),
            }
        )
        for run, side, region, usual in places
    ]
    scores = deviation_scores(pd.concat(tables, ignore_index=True), individuals=True)
    assert len(scores) == 36
    expected = scores.groupby(["run", "hemisphere"])["expected"].mean()
    assert expected.to_dict() == pytest.approx(
        {("r", "whole"): 0.0, ("r", "left"): 9.0, ("q", "whole"): 50.0}, abs=0.5
    )
    assert (np.sign(scores["z"]) == np.tile([1, -1], 18)).all()
    # without the brain itself
    assert (scores["brains"] == 11).all()
    averages = deviation_scores(pd.concat(tables, ignore_index=True), individuals=False)
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
    run_script(
        "deviation.py",
        tmp_path,
        inputs,
        {"maps": "maps.gii", "table": "table.csv"},
        params,
    )
    maps = read_vertex_maps(tmp_path / "maps.gii")
    assert maps["distance_mm"] == pytest.approx(1.0, abs=0.05)
    assert maps["thickness_difference_mm"] == pytest.approx(
        2.7 - 2.0 * 1.5 / 1.0, abs=1e-3
    )
    table = read_table(tmp_path / "table.csv").set_index(["hemisphere", "metric"])[
        "value"
    ]
    assert table["left", "distance"] == pytest.approx(1.0, abs=0.05)
