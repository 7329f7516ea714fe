"""Distances of runs from observed brains, the nearest run, and verdicts on the results of the paper."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from facts import Facts
from shapes import sphere

from gyriflow.compare.published import (
    AGREES,
    MISSING,
    NOT_COMPARABLE,
    NOT_RUN,
    NOT_TESTABLE,
    NOT_TESTED,
    SweepTables,
    comparison_caption,
    mirror_distance,
    place_of_largest,
    published_nearest,
    replication_table,
)
from gyriflow.compare.sweeps import (
    COMPARISON_COLUMNS,
    NO_NEAREST,
    WITHIN_NOISE,
    comparison_table,
    joined_comparisons,
    member_row,
    nearest_runs,
    with_common_cut,
)
from gyriflow.geometry.alignment import motion
from gyriflow.geometry.triangles import merged, transformed
from gyriflow.io.yaml_files import read_yaml
from gyriflow.metrics.spangy import PART_POWERS
from gyriflow.settings.stages import CostSettings


def spectra(run, subject, powers):
    rows = [
        {"subject": subject, "run": run, "hemisphere": "left", "proxy": proxy, "band": band,
         "relative_power": power * factor, "complete": True, "resolved": band < 6}
        for proxy, factor in (("mean_curvature", 1), ("shape_index", 2))
        for band, power in zip((4, 5, 6), powers, strict=True)
    ]  # fmt: skip
    return pd.DataFrame(rows).assign(week=28.0)


def with_parts(table):
    """Add the powers of the parts of bands, all in the middle of a band of a brain with L = 128 mm."""
    table = table.assign(wavelength_max_mm=256.0 / 2.0 ** table["band"], is_open=False)
    table[PART_POWERS] = np.outer(table["power"], np.arange(16) == 7)
    return table


METRICS = pd.DataFrame(
    [
        ("sim", "a", "whole", "area", 90.0, "cm2"),
        ("real", "b", "whole", "area", 100.0, "cm2"),
        ("sim", "a", "left", "weyl_number", 600.0, "1"),
        ("real", "b", "left", "weyl_number", 700.0, "1"),
    ],
    columns=["run", "subject", "hemisphere", "metric", "value", "unit"],
)


def parts(radius):
    return {"whole": sphere(radius, 3), "left": sphere(radius / 2, 3)}


def test_distances_are_those_of_bands_sizes_spectra_and_surfaces():
    both = pd.concat([spectra("sim", "a", (0.5, 0.2, 0.1)), spectra("real", "b", (0.4, 0.3, 0.1))])
    both = with_parts(both.assign(power=both["relative_power"]))
    surfaces = [{"whole": sphere(radius, 3)} for radius in (10.0, 11.5)]
    table = comparison_table("sim", "a", {"a": "", "b": ""}, METRICS, both, surfaces[0], {"b": surfaces[1]})
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
    assert tuple(table.loc[("left", "weyl_number"), ["value", "observed_value"]]) == (600, 700)
    assert (table.loc[("whole", "area"), "unit"], table.loc[("left", "weyl_number"), "unit"]) == ("cm2", "1")


def test_a_band_that_one_of_both_has_not_in_full_is_cut_off():
    both = pd.concat(
        [spectra("sim", "a", (0.5, 0.2, 0.1)), spectra("real", "b", (0.4, 0.3, 0.1)).assign(complete=False)]
    )
    both = with_parts(both.assign(power=both["relative_power"]))
    surface = {"whole": sphere(10.0, 2)}
    table = comparison_table("sim", "a", {"a": "", "b": ""}, METRICS, both, surface, {"b": surface})
    (row,) = table[table["measure"] == "relative_power_B4"].to_dict("records")
    assert row["flag"] == "cut off"
    assert np.isnan([row["value"], row["observed_value"], row["distance"]]).all()


def test_a_run_is_compared_with_each_observed_brain_and_its_population_is_named():
    tables = [
        spectra("sim", "a", (0.5, 0.2, 0.1)),
        spectra("real", "b", (0.4, 0.3, 0.1)),
        spectra("real", "c", (0.1, 0.1, 0.1)),
    ]
    power = [table.assign(power=table["relative_power"] * 10) for table in tables]
    bands = [table.assign(band=band, power=5.0, relative_power=0.1) for table in power for band in (1, 2, 3)]
    rows = [("real", "c", "whole", "area", 180.0, "cm2")]
    metrics = pd.concat([METRICS, pd.DataFrame(rows, columns=list(METRICS))])
    populations = {"a": "normal", "b": "normal", "c": "operated"}
    observed = {"b": parts(12.0), "c": parts(15.0)}
    both = pd.concat([*power, *bands], ignore_index=True)
    both = with_parts(both.drop_duplicates(["run", "subject", "proxy", "band"]))
    table = comparison_table("sim", "a", populations, metrics, both, parts(10.0), observed)
    assert list(table) == COMPARISON_COLUMNS
    assert set(table["subject"] + table["run"]) == {"asim"}
    named = table.groupby("observed")[["observed_population", "same_population"]].first()
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
    # shares of B1 to B4: four times 5/20, and 5/19, 5/19, 5/19, 4/19, an octave from each other
    assert distances["b", "left", "spectral_distance_B4"] == pytest.approx((1 + 2 + 3) * (5 / 19 - 5 / 20), rel=0.02)


def test_comparisons_without_rows_keep_their_columns():
    empty = joined_comparisons([])
    assert list(empty) == COMPARISON_COLUMNS
    row = pd.DataFrame([["x"] * len(COMPARISON_COLUMNS)], columns=COMPARISON_COLUMNS)
    assert len(joined_comparisons([empty, row, row])) == 2


def member(run, thickness, through=2.0, diverged=None, growth="rates"):
    return member_row(
        {"study": "thickness", "run": run, "subject": "a", "compare_week": 28},
        {"thickness_mm": thickness},
        {
            "thickness_mm": thickness,
            "shear_modulus_cortex_pa": 3000,
            "end_week": 28,
            "growth": {"model": growth},
        },
        {"elements_through_cortex": through, "order": 1},
        {"diverged": diverged, "reached_week": 28 if diverged is None else 26.5, "steps": 7, "cpu_seconds": 3.0},
    )


def test_growth_without_layers_is_resolved_by_any_mesh():
    assert member("t", 1.0, 1.94)["resolution"] == "not resolved by the mesh"
    assert member("t", 1.0, 1.96)["resolution"] == member("t", 1.0, 1.3, growth="shapes")["resolution"] == "ok"


MEMBERS = pd.DataFrame([member("t1", 1.0, 1.3), member("t2", 2.0), member("t3", 3.0), member("t4", 9.0, 9, "det F")])


def compared(**distances):
    rows = [
        {"subject": "a", "run": run, "observed": "b", "observed_population": "other", "same_population": False,
         "hemisphere": "left", "measure": "shape_index_relative_power_B4",
         "value": 0.1, "observed_value": 0.3, "distance": distance, "unit": "1", "flag": "ok"}
        for run, distance in distances.items()
    ]  # fmt: skip
    return pd.DataFrame(rows)


def test_the_nearest_run_has_the_second_nearest_and_flags():
    (row,) = nearest_runs(compared(t1=0.3, t2=0.1, t3=0.2), MEMBERS, ["thickness_mm"]).to_dict("records")
    assert (row["thickness_mm"], row["distance"], row["next_thickness_mm"], row["next_distance"]) == (2, 0.1, 3, 0.2)
    assert row["flag"] == "ok"
    (row,) = nearest_runs(compared(t1=0.1, t2=0.3, t3=0.2), MEMBERS, ["thickness_mm"]).to_dict("records")
    assert row["flag"] == "not resolved by the mesh; at the end of the range"
    for noise, flag in ((0.09, "ok"), (0.11, WITHIN_NOISE)):
        noisy = compared(t1=0.3, t2=0.1, t3=0.2).assign(noise=noise)
        assert nearest_runs(noisy, MEMBERS, ["thickness_mm"])["flag"].tolist() == [flag]


def test_a_band_that_no_run_resolves_has_no_nearest_run():
    coarse = compared(t1=float("nan"), t2=float("nan")).assign(flag="not resolved")
    (row,) = nearest_runs(coarse, MEMBERS, ["thickness_mm"]).to_dict("records")
    assert (row["run"], row["flag"]) == (pytest.approx(float("nan"), nan_ok=True), NO_NEAREST)
    (row,) = nearest_runs(pd.concat([coarse, compared(t3=0.2)]), MEMBERS, ["thickness_mm"]).to_dict("records")
    assert row["run"] == "t3"


def coefficients(run, subject, *bands):
    """Return modes of unit power in these bands, after the constant."""
    modes = pd.DataFrame({"mode": range(len(bands) + 1), "band": [0, *bands], "coefficient_shape_index": 1.0})
    return modes.assign(run=run, subject=subject, hemisphere="left")


def test_spectra_are_cut_at_the_largest_number_of_modes_of_all_surfaces_compared():
    number = {"measure": "weyl_number", "value": 5.0, "observed_value": 6.0, "unit": "1", "flag": "ok"}
    known = {"measure": "shape_index_relative_power_B5", "flag": "not resolved"}
    bands = [{"measure": f"shape_index_relative_power_B{band}", "flag": "ok"} for band in (4, 6)]
    labels = {"subject": "a", "observed": "b", "observed_population": "", "same_population": True, "hemisphere": "left"}
    rows = [{**labels, "run": run, **row} for run in ("thin", "few") for row in (number, known, *bands)]
    modes = [
        coefficients("thin", "a", 4, 4, 5, 5, 6, 6),
        coefficients("few", "a", 4, 5, 5),
        coefficients("real", "b", 4, 5, 5, 5, 5, 6),
    ]
    table = with_common_cut(pd.DataFrame(rows, columns=COMPARISON_COLUMNS), pd.concat(modes))
    table = table.set_index(["run", "measure"])[["value", "observed_value", "distance", "flag"]]
    cut = {band: tuple(table.loc["thin", f"shape_index_relative_power_B{band}_weyl"]) for band in (4, 5, 6)}
    nan = pytest.approx(float("nan"), nan_ok=True)
    # modes 1 to 5: two of B4, two of B5, one of B6 against one and four; its own number, 5, would leave B6 out
    assert cut[4] == (0.4, 0.2, pytest.approx(0.2), "ok")
    assert cut[5] == (0.4, 0.8, nan, "not resolved")
    assert cut[6] == (0.2, nan, nan, "cut off")
    assert table.loc[("few", "shape_index_relative_power_B4_weyl"), "flag"] == "cut off"


PUBLISHED = read_yaml(Path(__file__).parents[3] / "workflow" / "published" / "fetalfoldsim.yaml")
SIDES = ("left", "right")
SUMMARY = {"weeks": [21.0, 23.0], "reached_week": 23.0, "seconds": 3600, "cpu_seconds": 7200, "tets": 9, "ranks": 2}


def moves(**largest: float) -> pd.DataFrame:
    """Return displacements of 21 to 22 GW, half as large on average."""
    rows = [(21.0, 22.0, nodes, value, value / 2) for nodes, value in largest.items()]
    return pd.DataFrame(rows, columns=["from_week", "to_week", "nodes", "max_mm", "mean_mm"])


def sweep(shares: dict[tuple[str, str], tuple[float, ...]], real: tuple[float, ...], crossing: int = 0) -> SweepTables:
    """Return a study of thickness from shares of B4 to B6 (cut) by run and side, and those of the real brain."""
    rows = []
    for (run, side), own in shares.items():
        cut = zip((4, 5, 6), own, real, strict=False)
        rows += [(run, side, f"shape_index_relative_power_B{band}_weyl", value, true) for band, value, true in cut]
        rows.append((run, "whole", "crossing_faces", crossing, 0))
        rows.append((run, side, "weyl_number", 1800.0 if side == "left" else 700.0, 600.0))
    comparison = pd.DataFrame(rows, columns=["run", "hemisphere", "measure", "value", "observed_value"]).assign(
        observed="r28", flag="ok"
    )
    members = pd.DataFrame({"run": ["thin", "thick"], "outcome": ["finished", "diverged"]})
    nearest = pd.DataFrame(
        {
            "hemisphere": SIDES,
            "measure": "shape_index_relative_power_B4_weyl",
            "thickness_mm": [2.25, 0.8],
            "run": ["thin", "thick"],
            "flag": ["ok", "not resolved by the mesh"],
        }
    )
    return SweepTables(["thickness_mm"], 28, members, comparison, nearest)


SHARES = {("thin", "left"): (0.5, 0.3, 0.1), ("thin", "right"): (0.6, 0.2, 0.02), ("thick", "left"): (0.1, 0.4)}


def verdicts(displacement: pd.DataFrame, *studies: SweepTables, **facts) -> dict[str, tuple[str, str]]:
    table = replication_table(PUBLISHED, displacement, studies, SUMMARY, **({"costs": CostSettings()} | facts))
    assert list(table) == ["result", "place", "paper", "here", "verdict"]
    return {row["result"]: (row["here"], row["verdict"]) for row in table.to_dict("records")}


def test_displacements_agree_by_all_nodes_with_the_papers_and_with_measured_ones():
    found = verdicts(moves(all=1.25, pial=2.5))
    largest, mean, real_largest, real_mean = (row for result, row in found.items() if result == Facts("21-22 GW"))
    # the paper's 2.51, which those of the surface would meet, and 0.42; the measured 1.24 and 0.45
    assert largest == (Facts("1.25", "2.50"), "-50%")
    assert mean == (Facts("0.62", "1.25"), "+49%")
    assert (real_largest[1], real_mean[1]) == (AGREES, "+39%")
    assert [row for result, row in found.items() if result == Facts("22-23 GW")] == [(MISSING, NOT_RUN)] * 4


def test_the_largest_displacement_is_in_the_occipital_lobe_or_not():
    before = np.array([[0.0, -40.0, 0.0], [0.0, -30.0, 5.0], [0.0, 0.0, 9.0], [0.0, 40.0, 0.0]])
    # a node inside moves more, but is not on the surface
    moved = np.array([0.1, 1.0, 5.0, 0.5])[:, None] * [0.0, 0.0, 1.0]
    from_back = place_of_largest(before, before + moved, np.array([0, 1, 3]))
    assert from_back == pytest.approx(0.125)
    name = PUBLISHED["largest"]["finding"]
    assert [verdicts(moves(), from_back=x)[name][1] for x in (from_back, 0.9)] == [AGREES, "not as in the paper"]


def test_growth_rates_are_held_against_the_papers_least():
    rates = pd.DataFrame({"from_week": [21, 22, 30], "to_week": [22, 23, 31], "rate_per_s": [0.8e-7, 2e-7, 0.1e-7]})
    *_, (here, verdict) = (
        row for result, row in verdicts(moves(), rates=rates, used_rate=2e-7).items() if "growth rate" in result
    )
    assert (here, verdict) == (Facts("8e-08", "2e-07", "used"), "in part")


def test_energy_and_emissions_are_those_of_a_week_of_the_run():
    *_, hours, energy, emissions = verdicts(moves()).items()
    assert hours == (Facts("hours"), (Facts(0.5, 9, 2), NOT_COMPARABLE))
    # 2 h of a core of 12 W in two weeks
    assert energy == (Facts("(Wh)"), (Facts(12, 9, 2), NOT_COMPARABLE))
    assert emissions == (Facts("(g CO2e)"), (Facts(5.7, 9, 2, "475 g/kWh"), NOT_COMPARABLE))
    *_, emissions = verdicts(moves(), costs=CostSettings(core_power_w=6, carbon_g_per_kwh=50)).values()
    assert emissions[0] == Facts(0.3, "6 W", "50 g/kWh")


def test_findings_of_a_sweep_are_checked_one_by_one():
    found = verdicts(moves(), sweep(SHARES, (0.4, 0.35, 0.04)), mirror_mm=1.0)
    checked = {entry["check"]: found[entry["finding"]] for entry in PUBLISHED["findings"][::-1]}
    assert checked["all_without_collisions"] == (Facts(1, 2), "in part")
    name = "shape_index_relative_power_B4"
    (nearest,) = (row for result, row in found.items() if result == Facts("thickness_mm", name, "28 GW"))
    assert nearest == (Facts("left", 2.25, "right", 0.8, "not resolved by the mesh"), "in part")
    # three simulated hemispheres and the two of the real brain, of which the thick one has more B5
    assert checked["most_B4"] == (Facts(4, 5), "in part")
    # the thick one has no B6, which is no case
    assert checked["little_B6"] == (Facts(3, 4), "in part")
    # of thin alone both sides are there; the real one has the same on both
    assert checked["right_B4"] == (Facts(1, 2), "in part")
    assert checked["left_B5_B6"] == (Facts(2, 4), "in part")
    # the real 0.35 is above 0.2 on the right, not above 0.4 on the left
    assert found["B5 of the real brain is above that of any simulation"] == ("1 of 2 cases", "in part")
    assert checked["all_finish"] == ("–", "not run")
    assert found[PUBLISHED["untested"][0]["finding"]][1] == NOT_TESTED


@pytest.mark.parametrize(("crossing", "verdict"), [(0, AGREES), (7, "not as in the paper")])
def test_runs_come_to_a_week_without_collisions(crossing, verdict):
    own = sweep({("thin", "left"): SHARES["thin", "left"]}, (0.4, 0.35, 0.04), crossing)
    alone = SweepTables(own.varied, own.week, own.members[:1], own.comparison, own.nearest)
    assert verdicts(moves(), alone)[PUBLISHED["findings"][0]["finding"]] == (
        Facts("1" if not crossing else "0", crossing),
        verdict,
    )


@pytest.mark.parametrize("mirror_mm", [0.09, None])
def test_a_brain_that_is_its_own_mirror_image_shows_no_asymmetry(mirror_mm):
    found = verdicts(moves(), sweep(SHARES, (0.4, 0.35, 0.04)), mirror_mm=mirror_mm)
    asymmetries = [entry for entry in PUBLISHED["findings"] if entry["check"] in ("right_B4", "left_B5_B6")]
    assert [found[entry["finding"]][1] for entry in asymmetries] == [NOT_TESTABLE] * 2
    left, right = (sphere(10.0, 3, (x, 0, 0)) for x in (-11.0, 11.0))
    assert mirror_distance(left, right) < 0.01 < mirror_distance(left, sphere(10.5, 3, (11.0, 0, 0)))


def test_bands_that_are_not_resolved_decide_nothing():
    own = sweep(SHARES, (0.4, 0.35, 0.04))
    own.comparison.loc[own.comparison["measure"].str.contains("B[56]"), "flag"] = "not resolved"
    found = verdicts(moves(), own, mirror_mm=1.0)
    checked = {entry["check"]: found[entry["finding"]][1] for entry in PUBLISHED["findings"]}
    unresolved = ("most_B4", "little_B6", "left_B5_B6", "real_B5")
    assert [checked[name] for name in unresolved] == [NOT_TESTABLE] * 4
    assert checked["right_B4"] == "in part"


@pytest.mark.parametrize(("week", "varied"), [(27, ["thickness_mm"]), (28, ["thickness_mm", "poisson_ratio"])])
def test_another_sweep_is_not_the_papers(week, varied):
    own = sweep(SHARES, (0.4, 0.35, 0.04))
    other = SweepTables(varied, week, own.members, own.comparison, own.nearest)
    assert {verdict for _, verdict in verdicts(moves(), other).values()} == {NOT_RUN, NOT_TESTED, NOT_COMPARABLE}


def test_nearest_runs_are_listed_with_the_papers_value_if_it_reports_one():
    nearest = nearest_runs(compared(t1=0.3, t2=0.1), MEMBERS, ["thickness_mm"])
    others = [nearest.assign(measure=name) for name in ("shape_index_relative_power_B5_weyl", "area")]
    nearest = pd.concat([nearest, *others])
    tables = {"members": MEMBERS, "comparison": compared(t1=0.3, t2=0.1), "nearest": nearest}
    sweeps = {
        "thickness": SweepTables(["thickness_mm"], 28, **tables),
        "earlier": SweepTables(["thickness_mm"], 27, **tables),
        "ratio": SweepTables(["poisson_ratio"], 28, **tables),
        "both": SweepTables(["thickness_mm", "poisson_ratio"], 28, **tables),
    }
    table = published_nearest(PUBLISHED, sweeps)
    names = ["study", "measure", "parameter", "nearest", "run", "paper", "place"]
    assert table[names].to_numpy().tolist() == [
        ["thickness", "shape_index_relative_power_B4", "thickness_mm", 2.0, "t2", 2.25, "section 4.1.3"],
        ["thickness", "shape_index_relative_power_B5_weyl", "thickness_mm", 2.0, "t2", 0.8, "section 4.1.3"],
    ]
    none = published_nearest(PUBLISHED, {"ratio": sweeps["ratio"]})
    assert len(none) == 0
    assert list(none) == list(table)


def test_the_papers_gyrification_index_has_one_hull_for_both_hemispheres():
    # a ball of 10 mm on either side, 30 mm apart: two spheres over a capsule
    halves = [transformed(sphere(10.0, 4), motion(shift=(x, 0, 0))) for x in (-15, 15)]
    found = verdicts(moves(), surfaces={"half": halves[0], "both": merged(*halves)})
    ratio = 2 * 4 * np.pi * 100 / (4 * np.pi * 100 + 2 * np.pi * 10 * 30)
    name = PUBLISHED["gyrification_index"]["finding"]
    assert found[name] == (f"half: 1.00; both: {ratio:.2f}", NOT_TESTABLE)
    assert verdicts(moves())[name] == (MISSING, NOT_RUN)


def test_a_caption_names_the_observed_brains_and_another_population():
    table = compared(t1=0.3)
    both = pd.concat([table, table.assign(observed="c")])
    mixed, same = (
        comparison_caption("thickness", 28.0, both.assign(same_population=known)) for known in ([False, True], True)
    )
    assert same == Facts("thickness", "28 GW", "b (other)", "c (other)")
    assert len(mixed) > len(same)
    none = comparison_caption("thickness", 28.0, table[:0])
    assert "No run" in none
    assert "28 GW" in none
