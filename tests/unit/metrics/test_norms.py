"""Norms of brains that are drawn from known curves, and published ones; tables of a study, by brain, side and week."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from scipy import stats

from gyriflow.io.yaml_files import SCHEMES
from gyriflow.metrics.norms import (
    LabelledBrain,
    measured_norms,
    measured_scores,
    norm_curves,
    published_norms,
    published_scores,
    structure_volumes,
    volume_tables,
)
from gyriflow.metrics.tables import asymmetry, change_between_scans, long_table, weekly_norms, wide_table
from gyriflow.settings.terms import SIDES, SPREAD_UNKNOWN

FILE = Path(__file__).parents[3] / "norms" / "svrtk-volumes.yaml"
NORMS = published_norms(yaml.safe_load(FILE.read_text()))


def table(weeks: np.ndarray, values: np.ndarray, *others: tuple[str, float, float]) -> tuple[pd.DataFrame, list[str]]:
    """Return metrics of reference brains and of others (run, week, value), and the reference."""
    rows = [
        (f"s{i}", "real", week, "whole", "area", value, "cm2")
        for i, (week, value) in enumerate(zip(weeks, values, strict=True))
    ]
    rows += [("other", run, week, "whole", "area", value, "cm2") for run, week, value in others]
    return pd.DataFrame(rows, columns=COLUMNS), [f"s{i}" for i in range(len(weeks))]


def test_published_volumes_of_cortex_and_white_matter() -> None:
    # at 29 weeks: 0.3052·841 − 11.828·29 + 123 and 0.0223·841 + 7.3471·29 − 145.28
    found = published_scores({"cortex": 36.66 + 3.787, "white_matter": 86.54, "tail": 1.0}, 29.0, NORMS).set_index(
        "structure"
    )
    assert found["expected"].tolist() == pytest.approx([36.66, 86.54], abs=0.01)
    assert list(found.index) == ["cortex", "white_matter"]
    # SD of the cortex: 0.01647·841 − 0.47701·29 + 3.76905
    assert found.loc["cortex", "sd"] == pytest.approx(3.787, abs=0.001)
    assert found.loc["cortex", "z"] == pytest.approx(1.0, abs=0.01)
    assert found["centile"].tolist() == pytest.approx([84.13, 50.0], abs=0.3)
    assert np.isnan(found["brains"]).all()
    assert published_scores({"cortex": 30.0}, 18.0, NORMS)["flag"].tolist() == ["outside the norm's weeks"]


def test_quantiles_need_several_brains_of_a_week() -> None:
    weeks = np.repeat([22.0, 26.0, 30.0], [1, 3, 101])
    values = np.concatenate([[5.0], [6.0, 8.0, 10.0], np.arange(101.0)])
    found = measured_norms(*table(weeks, values)).set_index("week")
    assert found["brains"].tolist() == [1, 3, 101]
    assert found["mean"].tolist() == [5.0, 8.0, 50.0]
    assert np.isnan(found.loc[22.0, "sd"])
    assert found.loc[26.0, "sd"] == pytest.approx(2.0)
    assert found.loc[[22.0, 26.0], "q50"].isna().all()
    assert found.loc[30.0, ["q05", "q25", "q50", "q75", "q95"]].tolist() == [5.0, 25.0, 50.0, 75.0, 95.0]


def test_centiles_of_drawn_brains_are_even() -> None:
    random = np.random.default_rng(0)
    weeks = random.uniform(21, 36, 400)
    values = 0.5 * (weeks - 10) ** 2 + 4.0 * random.standard_normal(400)
    found = measured_scores(*table(weeks, values))
    assert (found["flag"] == "ok").all()
    assert found["sd"].mean() == pytest.approx(4.0, rel=0.05)
    # each against the others: a tenth of the brains in each tenth
    counts, _ = np.histogram(found["centile"], np.linspace(0, 100, 11))
    assert np.abs(counts - 40).max() < 20


def test_norms_are_of_subjects_and_not_of_their_scans() -> None:
    weeks, values = np.repeat([24.0, 25.0, 26.0, 27.0], 3), np.random.default_rng(1).normal(100, 5, 12)
    metrics, reference = table(weeks, values)
    three, six = (metrics.assign(person=[f"s{number % few}" for number in range(12)]) for few in (3, 6))
    # twelve scans of three subjects leave nothing to know a scatter by
    assert set(measured_scores(three, reference)["flag"]) == {"too few brains"}
    assert norm_curves(three, reference).empty
    assert set(measured_scores(six, reference)["brains"]) == {5}
    norms = measured_norms(metrics.assign(person="s"), reference)
    assert set(norms["brains"]) == {1}
    assert norms["sd"].isna().all()
    # a scan given twice says no more than once
    own = metrics.assign(person=metrics["subject"])
    twice = pd.concat([own, own.assign(subject=own["subject"] + "again")])
    both = [norm_curves(metrics, reference), norm_curves(twice, list(twice["subject"]))]
    np.testing.assert_allclose(both[0][["low", "high"]], both[1][["low", "high"]])


@pytest.mark.parametrize("metric", ["crossing_faces", "curvature_radius", "weyl_number", "spangy_modes", "area_ratio"])
def test_properties_of_the_mesh_and_of_the_analysis_have_no_norm(metric: str) -> None:
    weeks = np.arange(21.0, 29.0)
    metrics, reference = table(weeks, 10 * weeks + np.tile([1.0, -1.0], 4))
    assert len(norm_curves(metrics, reference))
    assert norm_curves(metrics.assign(metric=metric), reference).empty
    assert measured_scores(metrics.assign(metric=metric), reference).empty


def test_few_brains_make_centiles_cautious() -> None:
    weeks = np.array([21.0, 23.0, 25.0, 27.0, 29.0, 31.0] * 2)
    values = 10 * weeks + np.tile([1.0, -1.0], 6)
    metrics, reference = table(weeks, values, ("run", 26.0, 260.0 + 2.5))
    found = measured_scores(metrics, reference).query("run == 'run'").iloc[0]
    assert (found["brains"], found["brains_of_week"]) == (12, 0)
    assert found["expected"] == pytest.approx(260.0, abs=0.3)
    # the normal distribution would be surer than twelve brains allow
    assert 95.0 < found["centile"] < 100 * stats.norm.cdf(found["z"])


def test_what_cannot_be_scored_is_said() -> None:
    weeks = np.arange(21.0, 29.0)
    metrics, reference = table(weeks, 10 * weeks + np.tile([1.0, -1.0], 4), ("a", 33.0, 1.0), ("b", 25.0, 250.0))
    found = measured_scores(metrics, reference).set_index("run")["flag"]
    assert (found["a"], found["b"]) == ("outside the reference's weeks", "ok")
    few = measured_scores(*table(weeks[:4], weeks[:4], ("a", 22.0, 1.0))).set_index("run").loc["a"]
    assert few["flag"] == "too few brains"
    assert np.isnan(few["centile"])


def test_averages_give_a_curve_and_no_centiles() -> None:
    weeks = np.arange(21.0, 29.0)
    metrics, reference = table(weeks, 10 * weeks + np.tile([1.0, -1.0], 4), ("b", 25.0, 260.0))
    found = measured_scores(metrics, reference, individuals=False).set_index("run").loc["b"]
    assert found["expected"] == pytest.approx(250.0, abs=0.5)
    assert found[["sd", "z", "centile"]].isna().all()
    assert found["flag"] == SPREAD_UNKNOWN
    curves = norm_curves(metrics, reference, individuals=False)
    assert curves["expected"].notna().all()
    assert curves[["low", "high"]].isna().all(axis=None)


def test_half_a_brain_is_not_compared_with_whole_ones() -> None:
    weeks = np.arange(21.0, 29.0)
    metrics, reference = table(weeks, 10 * weeks + np.tile([1.0, -1.0], 4), ("half", 25.0, 125.0), ("all", 25.0, 250.0))
    sides = [
        metrics.assign(hemisphere=side, value=metrics["value"] / share)[rows]
        for side, share, rows in (
            ("whole", 1.0, metrics["run"] != ""),
            ("left", 2.0, metrics["run"] != "half"),
            ("right", 2.0, metrics["run"] != "half"),
            ("left", 1.0, metrics["run"] == "half"),
        )
    ]
    found = measured_scores(pd.concat(sides, ignore_index=True), reference).set_index(["run", "hemisphere"])
    assert found.loc[("all", "whole"), "flag"] == "ok"
    for side in ("whole", "left"):
        assert found.loc[("half", side), "flag"] == "other hemispheres"
        assert found.loc[("half", side), ["z", "centile", "expected"]].isna().all()
        assert found.loc[("half", side), "brains"] == 0


def test_one_hemisphere_is_not_scored_by_volumes_of_both() -> None:
    volumes = {"cortex": 20.0, "left_lateral_ventricle": 2.3, "right_lateral_ventricle": 2.3}
    found = published_scores(volumes, 29.0, NORMS, sides=("left",)).set_index("structure")
    assert found["flag"].tolist() == ["one hemisphere", "ok", "one hemisphere"]
    assert found.loc["cortex", ["expected", "sd", "z", "centile"]].isna().all()
    assert found.loc["left_lateral_ventricle", "z"] == pytest.approx(0.0, abs=0.1)
    assert (published_scores(volumes, 29.0, NORMS)["flag"] == "ok").all()


def test_structures_of_the_norms_scheme_and_of_others() -> None:
    own, others = structure_volumes({3: 4.0, 4: 5.0, 7: 1.0, 14: 2.0, 17: 1.0}, SCHEMES["dhcp-19"], NORMS)
    assert own == {"cortex": 9.0, "deep_grey": 3.0, "left_lateral_ventricle": 1.0}
    assert others == []
    # 2 is the cortex of FeTA and outer CSF of BOUNTI; it has no sides for the ventricles
    found, others = structure_volumes({2: 8.0, 3: 40.0, 4: 3.0}, SCHEMES["feta-7"], NORMS)
    assert found == {"cortex": 8.0, "white_matter": 40.0}
    assert others == ["cortex", "white_matter"]
    scores = published_scores(found | {"cortex": 9.0}, 21.0, NORMS, others)
    assert scores["flag"].tolist() == ["other labels"] * 2


def test_tables_of_volumes_have_the_labels_and_the_structures_of_each_brain():
    brains = [
        LabelledBrain("a", 21.0, SIDES, SCHEMES["feta-7"], {2: 8.0, 9: 1.5}),
        LabelledBrain("b", 29.0, ("left",), SCHEMES["dhcp-19"], {7: 2.0, 3: 9.0}),
    ]
    volumes, scores = volume_tables(brains, NORMS)
    assert volumes.to_numpy().tolist() == [
        ["a", "real", 21.0, 2, "cortex", 8.0],
        ["a", "real", 21.0, 9, "", 1.5],
        ["b", "real", 29.0, 7, SCHEMES["dhcp-19"].labels[7], 2.0],
        ["b", "real", 29.0, 3, SCHEMES["dhcp-19"].labels[3], 9.0],
    ]
    assert scores[["subject", "structure", "value", "week", "flag"]].to_numpy().tolist() == [
        ["a", "cortex", 8.0, 21.0, "other labels"],
        ["b", "cortex", 9.0, 29.0, "one hemisphere"],
        ["b", "left_lateral_ventricle", 2.0, 29.0, "ok"],
    ]


COLUMNS = ["subject", "run", "week", "hemisphere", "metric", "value", "unit"]
METRICS = pd.DataFrame(
    [
        ("early", "real", 22.0, "whole", "area", 100.0, "cm2"),
        ("late", "real", 24.0, "whole", "area", 150.0, "cm2"),
        ("early", "follows", 22.0, "whole", "area", 98.0, "cm2"),
        ("early", "follows", 23.0, "whole", "area", 120.0, "cm2"),
        ("early", "follows", 24.0, "whole", "area", 140.0, "cm2"),
        ("other", "real", 24.0, "whole", "area", 160.0, "cm2"),
        ("other", "real", 24.0, "left", "mean_curvedness", 0.1, "1/mm"),
    ],
    columns=COLUMNS,
)
REGIONS = pd.DataFrame(
    [
        ("early", "real", 22.0, "left", "frontal", "area", 20.0, "cm2"),
        ("late", "real", 24.0, "left", "frontal", "area", 26.0, "cm2"),
    ],
    columns=[*COLUMNS[:4], "region", *COLUMNS[4:]],
)
SCANS = {"one": ["early", "late"]}


def test_change_of_scans_and_of_the_simulation_from_the_first() -> None:
    table = change_between_scans(long_table([METRICS, REGIONS]), SCANS).set_index(["run", "region"])
    scans = table.loc[("real", "")]
    assert (scans["from_value"], scans["to_value"], scans["change"]) == (100.0, 150.0, 50.0)
    assert scans["change_per_week"] == pytest.approx(25.0)
    assert scans["relative_change"] == pytest.approx(0.5)
    assert scans["difference"] == 0.0
    run = table.loc[("follows", "")]
    # from the run's own start, beside what was measured
    assert (run["change"], run["measured_change"], run["difference"]) == (42.0, 50.0, -10.0)
    assert table.loc[("real", "frontal"), "change"] == 6.0
    assert ("follows", "frontal") not in table.index
    assert set(table["subject"]) == {"one"}


def test_wide_has_a_row_per_brain_and_week() -> None:
    table = wide_table(long_table([METRICS, REGIONS]), {})
    assert len(table) == 6
    row = table.set_index(["subject", "run", "week"]).loc[("other", "real", 24.0)]
    assert row["whole_area_cm2"] == 160.0
    assert row["left_mean_curvedness_1_per_mm"] == 0.1
    assert np.isnan(row["left_frontal_area_cm2"])
    known = wide_table(long_table([METRICS, REGIONS]), {"other": {"sex": "F", "run": "3"}}).set_index("subject")
    assert list(known.columns[:3]) == ["run", "week", "sex"]
    assert known.loc["other", "sex"] == "F"
    assert known["run"].isin(table["run"]).all()


def test_asymmetry_of_sides() -> None:
    table = pd.DataFrame({"hemisphere": ["left", "right"] * 2, "region": ["frontal"] * 2 + ["insula"] * 2})
    table = table.assign(metric="area", value=[30.0, 10.0, 0.0, 0.0])
    found = asymmetry(table).set_index("region")["asymmetry_index"]
    assert found["frontal"] == pytest.approx(1.0)
    assert np.isnan(found["insula"])


def test_norms_per_week_of_all_and_pial_nodes() -> None:
    start = np.zeros((4, 3))
    first = np.array([[3.0, 4, 0], [0, 0, 1], [0, 0, 0], [0, 0, 2]])
    second = first + np.array([0, 0, 0.5])
    table = weekly_norms([21.0, 22.0, 23.5], [start, first, second], np.array([1, 3]))
    assert table.columns.tolist() == ["from_week", "to_week", "nodes", "max_mm", "mean_mm"]
    assert table.to_numpy().tolist() == [
        [21.0, 22.0, "all", 5.0, 2.0],
        [21.0, 22.0, "pial", 2.0, 1.5],
        [22.0, 23.5, "all", 0.5, 0.5],
        [22.0, 23.5, "pial", 0.5, 0.5],
    ]
