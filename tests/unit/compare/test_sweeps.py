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
    member_comparison,
    member_row,
    nearest_runs,
    with_common_cut,
)
from gyriflow.io.files import read_table, write_json, write_table
from gyriflow.io.surfaces import write_surface
from gyriflow.io.yaml_files import write_yaml
from gyriflow.metrics.spangy import PART_POWERS


def spectra(run, subject, powers):
    rows = [
        {
            "subject": subject,
            "run": run,
            "hemisphere": "left",
            "proxy": proxy,
            "band": band,
            "relative_power": power * factor,
            "complete": True,
            "resolved": band < 6,
        }
        for proxy, factor in (("mean_curvature", 1), ("shape_index", 2))
        for band, power in zip((4, 5, 6), powers, strict=True)
    ]
    return pd.DataFrame(rows).assign(week=28.0)


def with_parts(table):
    """Add the powers of the parts of bands, all in the middle of a band of a brain with
    L = 128 mm."""
    table = table.assign(wavelength_max_mm=256.0 / 2.0 ** table["band"], is_open=False)
    table[PART_POWERS] = np.outer(table["power"], np.arange(16) == 7)
    return table


METRICS = pd.DataFrame(
    [
        ("sim", "a", "whole", "area", 90.0, "cm2"),
        ("observed", "b", "whole", "area", 100.0, "cm2"),
        ("sim", "a", "left", "weyl_number", 600.0, "1"),
        ("observed", "b", "left", "weyl_number", 700.0, "1"),
    ],
    columns=["run", "subject", "hemisphere", "metric", "value", "unit"],
)


def parts(radius):
    return {"whole": sphere(radius, 3), "left": sphere(radius / 2, 3)}


def test_distances_are_those_of_bands_sizes_spectra_and_surfaces():
    both = pd.concat(
        [
            spectra("sim", "a", (0.5, 0.2, 0.1)),
            spectra("observed", "b", (0.4, 0.3, 0.1)),
        ]
    )
    both = with_parts(both.assign(power=both["relative_power"]))
    surfaces = [{"whole": sphere(radius, 3)} for radius in (10.0, 11.5)]
    table = member_comparison(
        "sim", "a", {"a": "", "b": ""}, METRICS, both, surfaces[0], {"b": surfaces[1]}
    )
    table = table.set_index(["hemisphere", "measure"])
    assert table["distance"].dropna().to_dict() == {
        ("left", "relative_power_B4"): pytest.approx(0.1),
        ("left", "relative_power_B5"): pytest.approx(0.1),
        ("left", "shape_index_relative_power_B4"): pytest.approx(0.2),
        ("left", "shape_index_relative_power_B5"): pytest.approx(0.2),
        ("whole", "area"): pytest.approx(0.1),
        ("whole", "surface_distance"): pytest.approx(1.5, abs=0.05),
        ("whole", "surface_distance95"): pytest.approx(1.5, abs=0.05),
    }
    assert table.loc[("left", "relative_power_B6"), "flag"] == "not resolved"
    assert table.loc[("left", "relative_power_B4"), "observed_value"] == 0.4
    # the number of modes has no distance
    assert tuple(table.loc[("left", "weyl_number"), ["value", "observed_value"]]) == (
        600,
        700,
    )
    assert (
        table.loc[("whole", "area"), "unit"],
        table.loc[("left", "weyl_number"), "unit"],
    ) == ("cm2", "1")


def test_a_band_that_one_of_both_has_not_in_full_is_cut_off():
    both = pd.concat(
        [
            spectra("sim", "a", (0.5, 0.2, 0.1)),
            spectra("observed", "b", (0.4, 0.3, 0.1)).assign(complete=False),
        ]
    )
    both = with_parts(both.assign(power=both["relative_power"]))
    surface = {"whole": sphere(10.0, 2)}
    table = member_comparison(
        "sim", "a", {"a": "", "b": ""}, METRICS, both, surface, {"b": surface}
    )
    (row,) = table[table["measure"] == "relative_power_B4"].to_dict("records")
    assert row["flag"] == "cut off"
    assert np.isnan([row["value"], row["observed_value"], row["distance"]]).all()


@pytest.mark.usefixtures("recorded_outputs")
def test_the_script_compares_each_part_with_that_of_each_observed_brain(tmp_path):
    """Parts of unequal size of two observed brains, a millimetre and three larger than
    the simulated one."""
    radii = {"sim": 10.0, "b": 11.0, "c": 13.0}
    for name, radius in radii.items():
        for part, surface in parts(radius).items():
            write_surface(tmp_path / f"{name}.{part}.gii", surface)
    tables = [
        spectra("sim", "a", (0.5, 0.2, 0.1)),
        *(spectra("observed", b, (0.4, 0.3, 0.1)) for b in "bc"),
    ]
    both = pd.concat(tables)
    write_table(
        tmp_path / "spectra.csv", with_parts(both.assign(power=both["relative_power"]))
    )
    write_table(tmp_path / "metrics.csv", METRICS)
    write_table(tmp_path / "modes.csv", pd.DataFrame(columns=COEFFICIENTS))
    files = {
        name: [f"{name}.{part}.gii" for part in ("whole", "left")] for name in radii
    }
    inputs = {
        "metrics": ["metrics.csv"],
        "spectra": ["spectra.csv"],
        "coefficients": ["modes.csv"],
    }
    inputs |= {"simulated": files["sim"], "measured": [*files["b"], *files["c"]]}
    params = {
        "parts": ["whole", "left"],
        "observed": {"b": "one", "c": "two"},
        "population": "two",
    }
    outputs = {"table": "table.csv", "coefficients": "found.csv"}
    wildcards = SimpleNamespace(run="sim", brain="a")
    run_script(
        "compare_member.py", tmp_path, inputs, outputs, params, wildcards=wildcards
    )
    table = read_table(tmp_path / "table.csv")
    assert table.groupby("observed")["same_population"].all().to_dict() == {
        "b": False,
        "c": True,
    }
    found = table[table["measure"] == "surface_distance"].set_index(
        ["observed", "hemisphere"]
    )["distance"]
    expected = {
        ("b", "whole"): 1.0,
        ("b", "left"): 0.5,
        ("c", "whole"): 3.0,
        ("c", "left"): 1.5,
    }
    assert found.to_dict() == pytest.approx(expected, abs=0.05)


def test_a_run_is_compared_with_each_observed_brain_and_its_population_is_named():
    tables = [
        spectra("sim", "a", (0.5, 0.2, 0.1)),
        spectra("observed", "b", (0.4, 0.3, 0.1)),
        spectra("observed", "c", (0.1, 0.1, 0.1)),
    ]
    power = [table.assign(power=table["relative_power"] * 10) for table in tables]
    bands = [
        table.assign(band=band, power=5.0, relative_power=0.1)
        for table in power
        for band in (1, 2, 3)
    ]
    rows = [("observed", "c", "whole", "area", 180.0, "cm2")]
    metrics = pd.concat([METRICS, pd.DataFrame(rows, columns=list(METRICS))])
    populations = {"a": "normal", "b": "normal", "c": "operated"}
    observed = {"b": parts(12.0), "c": parts(15.0)}
    both = pd.concat([*power, *bands], ignore_index=True)
    both = with_parts(both.drop_duplicates(["run", "subject", "proxy", "band"]))
    table = member_comparison(
        "sim", "a", populations, metrics, both, parts(10.0), observed
    )
    assert list(table) == COMPARISON_COLUMNS
    assert set(table["subject"] + table["run"]) == {"asim"}
    named = table.groupby("observed")[
        ["observed_population", "same_population"]
    ].first()
    assert named.to_dict("index") == {
        "b": {"observed_population": "normal", "same_population": True},
        "c": {"observed_population": "operated", "same_population": False},
    }
    distances = table.set_index(["observed", "hemisphere", "measure"])["distance"]
    assert distances["b", "whole", "area"] == pytest.approx(0.1)
    assert distances["c", "whole", "area"] == pytest.approx(0.5)
    assert distances["b", "whole", "surface_distance"] == pytest.approx(2.0, abs=0.1)
    assert distances["c", "whole", "surface_distance95"] == pytest.approx(5.0, abs=0.1)
    assert distances["c", "left", "surface_distance"] == pytest.approx(2.5, abs=0.1)
    # shares of B1 to B4: four times 5/20, and 5/19, 5/19, 5/19, 4/19, an octave from
    # each other
    assert distances["b", "left", "spectral_distance_B4"] == pytest.approx(
        (1 + 2 + 3) * (5 / 19 - 5 / 20), rel=0.02
    )


def test_comparisons_without_rows_keep_their_columns():
    empty = joined_comparisons([])
    assert list(empty) == COMPARISON_COLUMNS
    row = pd.DataFrame([["x"] * len(COMPARISON_COLUMNS)], columns=COMPARISON_COLUMNS)
    assert len(joined_comparisons([empty, row, row])) == 2


def member(run, thickness, through=2.0, diverged=None, growth="rates"):
    return member_row(
        {"sweep": "thickness", "run": run, "subject": "a", "compare_week": 28},
        {"thickness_mm": thickness},
        {
            "thickness_mm": thickness,
            "shear_modulus_cortex_pa": 3000,
            "end_week": 28,
            "growth": {"model": growth},
        },
        {"elements_through_cortex": through, "order": 1},
        {
            "diverged": diverged,
            "reached_week": 28 if diverged is None else 26.5,
            "steps": 7,
            "cpu_seconds": 3.0,
        },
    )


def test_growth_without_layers_is_resolved_by_any_mesh():
    assert member("t", 1.0, 1.94)["resolution"] == "not resolved by the mesh"
    assert (
        member("t", 1.0, 1.96)["resolution"]
        == member("t", 1.0, 1.3, growth="shapes")["resolution"]
        == "ok"
    )


MEMBERS = pd.DataFrame(
    [
        member("t1", 1.0, 1.3),
        member("t2", 2.0),
        member("t3", 3.0),
        member("t4", 9.0, 9, "det F"),
    ]
)


def compared(**distances):
    rows = [
        {
            "subject": "a",
            "run": run,
            "observed": "b",
            "observed_population": "other",
            "same_population": False,
            "hemisphere": "left",
            "measure": "shape_index_relative_power_B4",
            "value": 0.1,
            "observed_value": 0.3,
            "distance": distance,
            "unit": "1",
            "flag": "ok",
        }
        for run, distance in distances.items()
    ]
    return pd.DataFrame(rows)


def test_the_nearest_run_has_the_second_nearest_and_flags():
    (row,) = nearest_runs(
        compared(t1=0.3, t2=0.1, t3=0.2), MEMBERS, ["thickness_mm"]
    ).to_dict("records")
    assert (
        row["thickness_mm"],
        row["distance"],
        row["next_thickness_mm"],
        row["next_distance"],
    ) == (2, 0.1, 3, 0.2)
    assert row["flag"] == "ok"
    (row,) = nearest_runs(
        compared(t1=0.1, t2=0.3, t3=0.2), MEMBERS, ["thickness_mm"]
    ).to_dict("records")
    assert row["flag"] == "not resolved by the mesh; at the end of the range"
    for noise, flag in ((0.09, "ok"), (0.11, WITHIN_NOISE)):
        noisy = compared(t1=0.3, t2=0.1, t3=0.2).assign(noise=noise)
        assert nearest_runs(noisy, MEMBERS, ["thickness_mm"])["flag"].tolist() == [flag]


def test_a_band_that_no_run_resolves_has_no_nearest_run():
    coarse = compared(t1=float("nan"), t2=float("nan")).assign(flag="not resolved")
    (row,) = nearest_runs(coarse, MEMBERS, ["thickness_mm"]).to_dict("records")
    assert (row["run"], row["flag"]) == (
        pytest.approx(float("nan"), nan_ok=True),
        NO_NEAREST,
    )
    (row,) = nearest_runs(
        pd.concat([coarse, compared(t3=0.2)]), MEMBERS, ["thickness_mm"]
    ).to_dict("records")
    assert row["run"] == "t3"


def coefficients(run, subject, *bands):
    """Return modes of unit power in these bands, after the constant."""
    modes = pd.DataFrame(
        {
            "mode": range(len(bands) + 1),
            "band": [0, *bands],
            "coefficient_shape_index": 1.0,
        }
    )
    return modes.assign(run=run, subject=subject, hemisphere="left")


def test_spectra_are_cut_at_the_largest_number_of_modes_of_all_surfaces_compared():
    number = {
        "measure": "weyl_number",
        "value": 5.0,
        "observed_value": 6.0,
        "unit": "1",
        "flag": "ok",
    }
    known = {"measure": "shape_index_relative_power_B5", "flag": "not resolved"}
    bands = [
        {"measure": f"shape_index_relative_power_B{band}", "flag": "ok"}
        for band in (4, 6)
    ]
    labels = {
        "subject": "a",
        "observed": "b",
        "observed_population": "",
        "same_population": True,
        "hemisphere": "left",
    }
    rows = [
        {**labels, "run": run, **row}
        for run in ("thin", "few")
        for row in (number, known, *bands)
    ]
    modes = [
        coefficients("thin", "a", 4, 4, 5, 5, 6, 6),
        coefficients("few", "a", 4, 5, 5),
        coefficients("observed", "b", 4, 5, 5, 5, 5, 6),
    ]
    table = with_common_cut(
        pd.DataFrame(rows, columns=COMPARISON_COLUMNS), pd.concat(modes)
    )
    table = table.set_index(["run", "measure"])[
        ["value", "observed_value", "distance", "flag"]
    ]
    cut = {
        band: tuple(table.loc["thin", f"shape_index_relative_power_B{band}_weyl"])
        for band in (4, 5, 6)
    }
    nan = pytest.approx(float("nan"), nan_ok=True)
    # modes 1 to 5: two of B4, two of B5, one of B6 against one and four; its own
    # number, 5, would leave B6 out
    assert cut[4] == (0.4, 0.2, pytest.approx(0.2), "ok")
    assert cut[5] == (0.4, 0.8, nan, "not resolved")
    assert cut[6] == (0.2, nan, nan, "cut off")
    assert table.loc[("few", "shape_index_relative_power_B4_weyl"), "flag"] == "cut off"


@pytest.mark.usefixtures("recorded_outputs")
def test_the_script_joins_each_run_with_its_own_files_and_finds_the_nearest(tmp_path):
    """The coarse run is the nearer one by area and within the noise of the other."""
    runs = {
        "thin": {"thickness_mm": 1.0, "through": 1.3, "area": 104.0},
        "thick": {"thickness_mm": 2.0, "through": 4.0, "area": 95.0},
    }
    compared = {"subject": "a", "observed": "b", "hemisphere": "left", "flag": "ok"}
    compared |= {"observed_population": "", "same_population": True, "unit": "1"}
    share = {"measure": "shape_index_relative_power_B4", "distance": 0.0}
    number = {"measure": "weyl_number", "value": 3.0, "observed_value": 3.0}
    observed = coefficients("observed", "b", 4, 5)
    for run, of_run in runs.items():
        settings = {"thickness_mm": of_run["thickness_mm"], "end_week": 28.0}
        write_yaml(tmp_path / f"{run}.yaml", settings | {"growth": {"model": "rates"}})
        zones = {"elements_through_cortex": of_run["through"], "order": 1}
        write_json(tmp_path / f"{run}.zones.json", zones)
        summary = {"steps": 10 * of_run["through"], "cpu_seconds": 3.0}
        write_json(tmp_path / f"{run}.json", summary)
        distance = abs(of_run["area"] / 100.0 - 1.0)
        size = {"measure": "area", "value": of_run["area"], "distance": distance}
        rows = [compared | {"run": run} | row for row in (share, number, size)]
        table = pd.DataFrame(rows, columns=COMPARISON_COLUMNS)
        write_table(tmp_path / f"{run}.compared.csv", table)
        modes = pd.concat([coefficients(run, "a", 4, 4), observed])
        write_table(tmp_path / f"{run}.modes.csv", modes)
    noise = {"metrics": {"area": {"cv": 0.02}}, "distances": {}}
    write_yaml(tmp_path / "noise.yaml", noise)
    inputs = {
        name: [f"{run}.{end}" for run in runs]
        for name, end in {
            "comparisons": "compared.csv",
            "coefficients": "modes.csv",
            "params": "yaml",
            "summaries": "json",
            "zones": "zones.json",
        }.items()
    }
    members = [
        {
            "run": run,
            "subject": "a",
            "values": {"thickness_mm": of_run["thickness_mm"]},
        }
        for run, of_run in runs.items()
    ]
    names = ("members", "comparison", "nearest")
    run_script(
        "sweep_tables.py",
        tmp_path,
        inputs | {"noise": "noise.yaml"},
        {name: f"{name}.csv" for name in names},
        {"members": members, "week": 28.0},
        wildcards=SimpleNamespace(sweep="thickness"),
    )
    members, comparison, nearest = (read_table(tmp_path / f"{n}.csv") for n in names)
    assert members["run"].tolist() == ["thin", "thick"]
    assert members["steps"].tolist() == [13.0, 40.0]
    assert members["compare_week"].tolist() == [28.0, 28.0]
    assert (members["resolution"] == "ok").tolist() == [False, True]
    comparison = comparison.set_index(["run", "measure"])
    of_area = comparison.xs("area", level="measure")
    assert of_area["thickness_mm"].to_dict() == {"thin": 1.0, "thick": 2.0}
    # the mean of a difference between two measurements of one brain
    assert of_area["noise"].tolist() == pytest.approx([0.04 / np.sqrt(np.pi)] * 2)
    cut = comparison.xs("shape_index_relative_power_B4_weyl", level="measure")
    assert cut["value"].tolist() == [1.0, 1.0]
    assert cut["observed_value"].tolist() == [0.5, 0.5]
    by_area = nearest.set_index("measure").loc["area"]
    assert (by_area["run"], by_area["next_thickness_mm"]) == ("thin", 2.0)
    assert WITHIN_NOISE in by_area["flag"]
    assert "not resolved by the mesh" in by_area["flag"]
