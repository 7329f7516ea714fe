"""Distances of runs from observed brains, and the nearest run."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from scripts import run_script
from shapes import sphere

from gyriflow.compare.sweeps import (
    COEFFICIENTS,
    COMPARISON_COLUMNS,
    NO_NEAREST,
    WITHIN_NOISE,
    joined_comparisons,
    member_row,
    nearest_runs,
    with_common_cut,
)
from gyriflow.io.files import write_json, write_table
from gyriflow.io.surfaces import write_surface
from gyriflow.io.yaml_files import write_yaml
from gyriflow.metrics.spangy import PART_POWERS

BANDS = np.arange(4, 7)


def spectra(run, subject, shares):
    """Return spectra of a left side by the shares of B4 to B6, of which B6 is not
    resolved; all power is in the middle of a band of a brain with L = 128 mm."""
    tables = []
    for proxy, factor in (("mean_curvature", 1.0), ("shape_index", 2.0)):
        power = factor * np.array(shares)
        table = pd.DataFrame({"band": BANDS, "relative_power": power, "power": power})
        table[PART_POWERS] = np.outer(power, np.arange(16) == 7)
        tables.append(table.assign(proxy=proxy, wavelength_max_mm=256.0 / 2.0**BANDS))
    table = pd.concat(tables, ignore_index=True)
    table = table.assign(run=run, subject=subject, hemisphere="left", week=28.0)
    return table.assign(complete=True, resolved=table["band"] < 6, is_open=False)


SIMULATED = spectra("sim", "a", (0.5, 0.2, 0.1))
OBSERVED = spectra("observed", "b", (0.4, 0.3, 0.1))
METRICS = pd.DataFrame(
    [
        ("sim", "a", "whole", "area", 90.0, "cm2"),
        ("observed", "b", "whole", "area", 100.0, "cm2"),
        ("sim", "a", "left", "weyl_number", 600.0, "1"),
        ("observed", "b", "left", "weyl_number", 700.0, "1"),
    ],
    columns=["run", "subject", "hemisphere", "metric", "value", "unit"],
)


# the turn of a sphere onto another is decided by rounding
@pytest.mark.remeshed
@pytest.mark.usefixtures("recorded_outputs")
def test_the_script_compares_each_part_with_that_of_each_observed_brain(tmp_path):
    """Parts of unequal size of two observed brains, a millimetre and three larger than
    the simulated one."""
    files = {}
    for name, radius in {"sim": 10.0, "b": 11.0, "c": 13.0}.items():
        files[name] = [f"{name}.whole.gii", f"{name}.left.gii"]
        for file, part_radius in zip(files[name], (radius, radius / 2), strict=True):
            write_surface(tmp_path / file, sphere(part_radius, 3))
    # of b all bands are cut off
    brains = [SIMULATED, OBSERVED.assign(complete=False), OBSERVED.assign(subject="c")]
    write_table(tmp_path / "spectra.csv", pd.concat(brains))
    write_table(tmp_path / "metrics.csv", METRICS)
    write_table(tmp_path / "modes.csv", pd.DataFrame(columns=COEFFICIENTS))
    inputs = {"metrics": ["metrics.csv"], "spectra": ["spectra.csv"]}
    inputs |= {"coefficients": ["modes.csv"], "simulated": files["sim"]}
    inputs |= {"measured": [*files["b"], *files["c"]]}
    populations = {"observed": {"b": "one", "c": "two"}, "population": "two"}
    params = {"parts": ["whole", "left"], **populations}
    outputs = {"table": "table.csv", "coefficients": "found.csv"}
    job = {"wildcards": SimpleNamespace(run="sim", brain="a")}
    run_script("compare_member.py", tmp_path, inputs, outputs, params, **job)


def test_comparisons_without_rows_keep_their_columns():
    empty = joined_comparisons([])
    assert list(empty) == COMPARISON_COLUMNS
    row = pd.DataFrame([["x"] * len(COMPARISON_COLUMNS)], columns=COMPARISON_COLUMNS)
    assert len(joined_comparisons([empty, row, row])) == 2


def member(run, thickness, through=2.0, diverged=None, growth="rates"):
    labels = {"sweep": "thickness", "run": run, "subject": "a", "compare_week": 28}
    params = {"thickness_mm": thickness, "end_week": 28, "growth": {"model": growth}}
    summary = {"diverged": diverged, "steps": 7, "cpu_seconds": 3.0}
    zones = {"elements_through_cortex": through, "order": 1}
    return member_row(labels, {"thickness_mm": thickness}, params, zones, summary)


@pytest.mark.parametrize(
    ("through", "growth", "resolution"),
    [
        (1.94, "rates", "not resolved by the mesh"),
        (1.96, "rates", "ok"),
        # growth without layers
        (1.3, "shapes", "ok"),
    ],
)
def test_a_mesh_resolves_layers_from_two_elements_on(through, growth, resolution):
    assert member("t", 1.0, through, growth=growth)["resolution"] == resolution


MEMBERS = pd.DataFrame(
    [
        member("t1", 1.0, 1.3),
        member("t2", 2.0),
        member("t3", 3.0),
        member("t4", 9.0, 9, "det F"),
    ]
)


def nearest(noise=0.0, **distances):
    """Return the row of the nearest of runs with these distances."""
    table = pd.DataFrame({"run": distances.keys(), "distance": distances.values()})
    table["flag"] = np.where(table["distance"].isna(), "not resolved", "ok")
    labels = {"subject": "a", "observed": "b", "hemisphere": "left", "measure": "B4"}
    table = table.assign(**labels, noise=noise)
    (row,) = nearest_runs(table, MEMBERS, ["thickness_mm"]).to_dict("records")
    return row


def test_the_nearest_run_has_the_second_nearest():
    row = nearest(t1=0.3, t2=0.1, t3=0.2)
    assert (row["run"], row["thickness_mm"], row["distance"]) == ("t2", 2, 0.1)
    assert (row["next_thickness_mm"], row["next_distance"]) == (3, 0.2)


@pytest.mark.parametrize(
    ("distances", "noise", "flag"),
    [
        ({"t1": 0.3, "t2": 0.1, "t3": 0.2}, 0.0, "ok"),
        ({"t1": 0.3, "t2": 0.1, "t3": 0.2}, 0.09, "ok"),
        ({"t1": 0.3, "t2": 0.1, "t3": 0.2}, 0.11, WITHIN_NOISE),
        (
            {"t1": 0.1, "t2": 0.3, "t3": 0.2},
            0.0,
            "not resolved by the mesh; at the end of the range",
        ),
        # a band that no run resolves, and one that a run does
        ({"t1": np.nan, "t2": np.nan}, 0.0, NO_NEAREST),
        ({"t1": np.nan, "t3": 0.2}, 0.0, "ok"),
    ],
)
def test_a_nearest_run_is_flagged_where_it_is_doubtful(distances, noise, flag):
    row = nearest(noise=noise, **distances)
    assert row["flag"] == flag
    assert pd.isna(row["run"]) == (flag == NO_NEAREST)


def coefficients(run, subject, *bands):
    """Return modes of unit power in these bands, after the constant."""
    table = pd.DataFrame({"mode": range(len(bands) + 1), "band": [0, *bands]})
    table = table.assign(run=run, subject=subject, hemisphere="left")
    return table.assign(coefficient_shape_index=1.0)


def test_spectra_are_cut_at_the_largest_number_of_modes_of_all_surfaces_compared():
    rows = pd.DataFrame(
        [
            ("weyl_number", 5.0, 6.0, "ok"),
            ("shape_index_relative_power_B4", 0.5, 0.5, "ok"),
            ("shape_index_relative_power_B5", 0.5, 0.5, "not resolved"),
            ("shape_index_relative_power_B6", 0.5, 0.5, "ok"),
        ],
        columns=["measure", "value", "observed_value", "flag"],
    ).assign(subject="a", observed="b", hemisphere="left")
    runs = pd.concat([rows.assign(run="thin"), rows.assign(run="few")])
    modes = [
        coefficients("thin", "a", 4, 4, 5, 5, 6, 6),
        coefficients("few", "a", 4, 5, 5),
        coefficients("observed", "b", 4, 5, 5, 5, 5, 6),
    ]
    table = with_common_cut(runs.reindex(columns=COMPARISON_COLUMNS), pd.concat(modes))
    table = table.set_index(["run", "measure"])
    columns = ["value", "observed_value", "distance", "flag"]
    nan = pytest.approx(float("nan"), nan_ok=True)
    # modes 1 to 5: two of B4, two of B5, one of B6 against one and four; its own
    # number, 5, would leave B6 out
    for band, expected in (
        (4, (0.4, 0.2, pytest.approx(0.2), "ok")),
        (5, (0.4, 0.8, nan, "not resolved")),
        (6, (0.2, nan, nan, "cut off")),
    ):
        row = table.loc["thin", f"shape_index_relative_power_B{band}_weyl"]
        assert tuple(row[columns]) == expected
    assert table.loc[("few", "shape_index_relative_power_B4_weyl"), "flag"] == "cut off"


@pytest.mark.usefixtures("recorded_outputs")
def test_the_script_joins_each_run_with_its_own_files_and_finds_the_nearest(tmp_path):
    """The coarse run is the nearer one by area and within the noise of the other."""
    # thickness in mm, elements through the cortex, area in cm2
    runs = {"thin": (1.0, 1.3, 104.0), "thick": (2.0, 4.0, 95.0)}
    compared = {"subject": "a", "observed": "b", "hemisphere": "left", "flag": "ok"}
    compared |= {"observed_population": "", "same_population": True, "unit": "1"}
    share = {"measure": "shape_index_relative_power_B4", "distance": 0.0}
    number = {"measure": "weyl_number", "value": 3.0, "observed_value": 3.0}
    observed = coefficients("observed", "b", 4, 5)
    for run, (thickness_mm, through, area) in runs.items():
        settings = {"thickness_mm": thickness_mm, "end_week": 28.0}
        write_yaml(tmp_path / f"{run}.yaml", settings | {"growth": {"model": "rates"}})
        zones = {"elements_through_cortex": through, "order": 1}
        write_json(tmp_path / f"{run}.zones.json", zones)
        summary = {"steps": 10 * through, "cpu_seconds": 3.0}
        write_json(tmp_path / f"{run}.json", summary)
        size = {"measure": "area", "value": area, "distance": abs(area / 100 - 1)}
        rows = [compared | {"run": run} | row for row in (share, number, size)]
        table = pd.DataFrame(rows, columns=COMPARISON_COLUMNS)
        write_table(tmp_path / f"{run}.compared.csv", table)
        modes = pd.concat([coefficients(run, "a", 4, 4), observed])
        write_table(tmp_path / f"{run}.modes.csv", modes)
    noise = {"metrics": {"area": {"cv": 0.02}}, "distances": {}}
    write_yaml(tmp_path / "noise.yaml", noise)
    endings = {"comparisons": "compared.csv", "coefficients": "modes.csv"}
    endings |= {"params": "yaml", "summaries": "json", "zones": "zones.json"}
    inputs = {name: [f"{run}.{end}" for run in runs] for name, end in endings.items()}
    members = []
    for run, (thickness_mm, _, _) in runs.items():
        values = {"thickness_mm": thickness_mm}
        members.append({"run": run, "subject": "a", "values": values})
    names = ("members", "comparison", "nearest")
    run_script(
        "sweep_tables.py",
        tmp_path,
        inputs | {"noise": "noise.yaml"},
        {name: f"{name}.csv" for name in names},
        {"members": members, "week": 28.0},
        wildcards=SimpleNamespace(sweep="thickness"),
    )
