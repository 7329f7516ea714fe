"""Norms of brains that are drawn from known curves, and published ones; tables of a
study, by brain, side and week."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from configurations import LABELLED, problems, study
from facts import Facts
from scipy import stats

from gyriflow.errors import InputError
from gyriflow.io.files import read_json, write_json
from gyriflow.io.yaml_files import SCHEMES
from gyriflow.metrics.lms import MIN_SUBJECTS_FOR_SKEWNESS, SKEWNESS, fit_norm
from gyriflow.metrics.norms import (
    LabelledBrain,
    cohort_from_plain,
    cohort_norms,
    measured_scores,
    norm_curves,
    outlying_brains,
    published_norms,
    published_scores,
    volume_tables,
)
from gyriflow.metrics.tables import (
    asymmetry,
    change_between_scans,
    described_columns,
    long_table,
    weekly_norms,
    wide_table,
)
from gyriflow.settings.terms import SIDES, SPREAD_UNKNOWN
from gyriflow.study.checks import norm_settings
from gyriflow.study.loading import load

ROOT = Path(__file__).parents[3]
FILE = ROOT / "norms" / "svrtk-volumes.yaml"
NORMS = published_norms(yaml.safe_load(FILE.read_text()))


def table(
    weeks: np.ndarray, values: np.ndarray, *others: tuple[str, float, float]
) -> tuple[pd.DataFrame, list[str]]:
    """Return metrics of reference brains and of others (run, week, value), and the
    reference."""
    rows = [
        (f"s{i}", "observed", week, "whole", "area", value, "cm2")
        for i, (week, value) in enumerate(zip(weeks, values, strict=True))
    ]
    rows += [
        ("other", run, week, "whole", "area", value, "cm2")
        for run, week, value in others
    ]
    return pd.DataFrame(rows, columns=COLUMNS), [f"s{i}" for i in range(len(weeks))]


def labelled(week, volumes, scheme="dhcp-19", sides=SIDES):
    return LabelledBrain("a", week, sides, SCHEMES[scheme], volumes)


def test_published_volumes_of_cortex_and_white_matter() -> None:
    # at 29 weeks: 0.3052·841 − 11.828·29 + 123 and 0.0223·841 + 7.3471·29 − 145.28
    found = published_scores(
        labelled(29.0, {3: 36.66 + 3.787, 5: 86.54, 99: 1.0}), NORMS
    ).set_index("structure")
    assert found["expected"].tolist() == pytest.approx([36.66, 86.54], abs=0.01)
    assert list(found.index) == ["cortex", "white_matter"]
    # SD of the cortex: 0.01647·841 − 0.47701·29 + 3.76905
    assert found.loc["cortex", "sd"] == pytest.approx(3.787, abs=0.001)
    assert found.loc["cortex", "z"] == pytest.approx(1.0, abs=0.01)
    assert found["centile"].tolist() == pytest.approx([84.13, 50.0], abs=0.3)
    assert np.isnan(found["brains"]).all()
    first, last = NORMS["cortex"].weeks
    outside = "outside the norm's weeks"
    for week, flag in (
        (first - 0.1, outside),
        (first, "ok"),
        (last, "ok"),
        (last + 0.1, outside),
    ):
        assert published_scores(labelled(week, {3: 30.0}), NORMS)["flag"].tolist() == [
            flag
        ]
    assert all(
        np.polyval(norm.sd, np.linspace(*norm.weeks, 201)).min() > 0
        for norm in NORMS.values()
    )


def scores(metrics, reference, **options):
    return measured_scores(
        metrics, reference, cohort_norms(metrics, reference, **options)
    )


def curves(metrics, reference, **options):
    return norm_curves(cohort_norms(metrics, reference, **options))


def growing(weeks):
    """Return a mean volume (mL) over the weeks."""
    return 80 + 270 * ((weeks - 21) / 16) ** 1.3


def test_few_subjects_of_one_week_are_compared_by_students_distribution() -> None:
    values = np.array([3.0, 5.0, 4.0, 6.5, 2.5, 4.5, 5.5, 3.5, 4.0, 6.0, 3.0, 4.5])
    norm = fit_norm(np.full(12, 25.0), values, np.arange(12), is_positive=False)
    distance = (7.0 - values.mean()) / values.std(ddof=1)
    z, (low, high) = norm.scores([25.0], [7.0])
    # once with the error of the mean: in the spread of new subjects
    student = stats.t.cdf(distance / np.sqrt(1 + 1 / 12), 11)
    assert z[0] == pytest.approx(stats.norm.ppf(student), rel=1e-3)
    error = 1.645 * np.sqrt(1 / 12 + distance**2 / 22)
    assert [low[0], high[0]] == pytest.approx(
        [distance - error, distance + error], rel=1e-3
    )
    assert norm.values([25.0], float(z[0])) == pytest.approx([7.0], rel=1e-6)


def test_skewness_is_estimated_from_many_subjects() -> None:
    random = np.random.default_rng(0)
    for share, subjects in (
        (0.0, 400),
        (1.0, 400),
        (1.0, MIN_SUBJECTS_FOR_SKEWNESS - 1),
    ):
        weeks = random.uniform(21, 37, subjects)
        z = random.standard_normal(subjects).clip(-3, 3)
        values = growing(weeks) * np.where(share, 1 + 0.25 * z, np.exp(0.25 * z))
        norm = fit_norm(weeks, values, np.arange(subjects), is_positive=True)
        if subjects == 400:
            assert norm.skewness == pytest.approx(share, abs=0.35)
        else:
            assert norm.skewness == SKEWNESS


def test_a_subject_is_removed_by_one_step_as_by_another_fit() -> None:
    random, people = np.random.default_rng(5), np.arange(150)
    weeks = random.uniform(21, 37, 150)
    values = growing(weeks) * (1 + 0.1 * random.standard_normal(150))
    norm = fit_norm(weeks, values, people, is_positive=True)
    inner = np.flatnonzero(
        (np.abs(weeks - 29) < 5) & (np.abs(norm.scores(weeks, values)[0]) > 1.0)
    )[:5]
    for number in inner:
        scan = [weeks[number]], [values[number]]
        others = people != people[number]
        alone = fit_norm(
            weeks[others], values[others], people[others], is_positive=True
        ).scores(*scan)[0]
        change = alone - norm.scores(*scan)[0]
        one_step = norm.without(weeks[number], values[number]).scores(*scan)[0]
        assert np.abs(one_step - alone).max() < 0.35 * np.abs(change).max() + 0.01


def test_a_run_is_compared_with_all_subjects_and_a_scan_with_the_others() -> None:
    weeks = np.arange(21.0, 33.0)
    metrics, reference = table(weeks, 10 * weeks + np.tile([1.0, -1.0], 6))
    run = metrics[metrics["subject"] == "s5"].assign(run="expected", value=263.0)
    found = (
        scores(pd.concat([metrics, run]), reference)
        .query("subject == 's5'")
        .set_index("run")
    )
    assert found["brains"].to_dict() == {"observed": 11, "expected": 12}


def test_the_interval_of_a_median_is_that_of_a_mean() -> None:
    values = np.random.default_rng(2).normal(50.0, 6.0, 81)
    curve = curves(*table(np.full(81, 25.0), values)).iloc[0]
    half = 0.5 * (curve["expected_high"] - curve["expected_low"])
    assert half == pytest.approx(1.645 * values.std() / 9, rel=0.03)
    assert curve["expected"] == pytest.approx(values.mean(), abs=0.7)
    assert curve["sd"] == pytest.approx(values.std(), rel=0.05)


def test_two_scans_say_as_much_as_two_subjects_unless_they_agree() -> None:
    weeks, subjects = np.full(200, 25.0), np.arange(200)
    values = np.random.default_rng(3).normal(50.0, 6.0, 200)
    variances = [
        fit_norm(weeks, found, people, is_positive=True).covariance[0, 0]
        for found, people in (
            (values, subjects),
            (values, subjects // 2),
            (np.repeat(values[:100], 2), subjects // 2),
        )
    ]
    assert variances[1] / variances[0] == pytest.approx(1.0, abs=0.2)
    assert variances[2] / variances[0] == pytest.approx(2.0, rel=0.3)


@pytest.mark.parametrize(
    ("subjects", "weeks"), [(200, 160), (200, 7), (200, 1), (20, 16), (20, 3)]
)
@pytest.mark.parametrize("is_positive", [True, False])
def test_values_and_scores_are_inverse(
    subjects: int, weeks: int, is_positive: bool
) -> None:
    random = np.random.default_rng(2)
    at = random.choice(np.linspace(21, 37, weeks), subjects)
    values = growing(at) * np.exp(0.1 * random.standard_normal(subjects)) - (
        0 if is_positive else 150
    )
    norm = fit_norm(at, values, np.arange(subjects), is_positive=is_positive)
    some = np.unique(at)[:3]
    for z in (-1.6, 0.0, 1.0):
        assert norm.scores(some, norm.values(some, z))[0] == pytest.approx(
            np.full(len(some), z), abs=1e-6
        )
    assert norm.is_spline == (weeks > 7)


def test_whole_weeks_of_many_subjects_have_their_own_scatter() -> None:
    random = np.random.default_rng(3)
    weeks = random.integers(22, 29, 500).astype(float)
    values = growing(weeks) + (weeks - 20) * random.standard_normal(500)
    found = scores(*table(weeks, values))
    assert set(found["flag"]) == {"ok"}
    for week in (22.0, 28.0):
        of_week = found[found["week"] == week]
        assert of_week["sd"].mean() == pytest.approx(week - 20, rel=0.2)
        assert (of_week["centile"] < 10).mean() == pytest.approx(0.1, abs=0.08)


def test_values_that_a_norm_cannot_have_are_not_scored() -> None:
    random = np.random.default_rng(4)
    weeks = random.uniform(21, 36, 40)
    metrics, reference = table(
        weeks,
        growing(weeks) * (1 + 0.08 * random.standard_normal(40)),
        ("flat", 25.0, 0.0),
    )
    flat = scores(metrics, reference).query("run == 'flat'").iloc[0]
    assert (flat["flag"], np.isnan(flat["centile"])) == ("not positive", True)
    same = (
        scores(*table(weeks, np.full(40, 5.0), ("other", 25.0, 6.0)))
        .query("run == 'other'")
        .iloc[0]
    )
    assert (same["flag"], np.isnan(same["z"])) == ("no spread", True)


def test_a_brain_of_the_reference_is_compared_with_the_others() -> None:
    random = np.random.default_rng(0)
    weeks = random.uniform(21, 36, 60)
    values = growing(weeks) * (1 + 0.08 * random.standard_normal(60))
    values[0] *= 1.5
    metrics, reference = table(weeks, values)
    found = scores(metrics, reference)
    assert (found["brains"] == 59).all()
    counts, _ = np.histogram(found["centile"], np.linspace(0, 100, 5))
    assert np.abs(counts - 15).max() < 8
    # as if it had never been there, for the odd one and a usual one
    for number in (0, 1):
        others = np.arange(60) != number
        without = table(
            weeks[others], values[others], ("it", weeks[number], values[number])
        )
        alone = scores(*without).query("run == 'it'").iloc[0]
        assert found["z"][number] == pytest.approx(alone["z"], abs=0.03)


def test_norms_are_read_by_another_study_with_the_same_settings(tmp_path) -> None:
    random = np.random.default_rng(0)
    weeks = random.uniform(21, 36, 60)
    metrics, reference = table(
        weeks,
        growing(weeks) * (1 + 0.08 * random.standard_normal(60)),
        ("new", 25.0, 120.0),
    )
    own = load(study())
    cohort = cohort_norms(
        metrics,
        reference,
        made_with=norm_settings(own) | {"schemes": [LABELLED["scheme"], "more"]},
    )
    path = tmp_path / "norms.json"
    write_json(path, cohort.plain)
    again = cohort_from_plain(read_json(path))
    pd.testing.assert_frame_equal(norm_curves(cohort), norm_curves(again))
    (score,) = measured_scores(metrics[metrics["run"] == "new"], [], again).to_dict(
        "records"
    )
    assert score["centile"] == pytest.approx(
        scores(metrics, reference).query("run == 'new'")["centile"].iloc[0]
    )
    # averages and hemispheres stay what they are
    averages = cohort_norms(metrics, reference, individuals=False)
    write_json(path, averages.plain)
    new = metrics[metrics["run"] == "new"]
    again = cohort_from_plain(read_json(path))
    assert measured_scores(new, [], again)["flag"].tolist() == [SPREAD_UNKNOWN]
    one_side = pd.concat([new, new.assign(hemisphere="left")])
    assert measured_scores(one_side, [], again)["flag"].tolist() == [
        "other hemispheres"
    ]
    write_json(path, cohort.plain)
    raw = study(metrics={"norms": str(path)})
    assert problems(raw) == []
    other = {
        "surface": {"edge_length_mm": 0.7},
        "metrics": {"norms": str(path), "curvature_radius_mm": 4.0},
    }
    assert problems(raw | other) == [
        Facts(path, "edge_length_mm", 1.0, 0.7),
        Facts("curvature_radius_mm", 4.0),
    ]
    path.write_text("{}")
    assert problems(raw) == [Facts(path, "results/study/norms.json")]


def test_a_norm_gives_median_volumes_within_its_weeks() -> None:
    weeks = np.repeat(np.arange(22.0, 31.0), 2)
    metrics, reference = table(weeks, 20 * weeks * np.tile([1.02, 0.98], 9))
    whole = metrics.assign(
        metric="volume", hemisphere="whole", person=metrics["subject"]
    )
    found = cohort_norms(whole, reference).volumes_by_week([21.0, 24.0, 30.0])
    assert found == pytest.approx({24.0: 480, 30.0: 600}, rel=0.02)
    area = cohort_norms(whole.assign(metric="area"), reference)
    assert area.volumes_by_week([24.0]) == {}


def test_norms_are_of_subjects_and_not_of_their_scans() -> None:
    weeks = np.repeat([24.0, 25.0, 26.0, 27.0], 6)
    values = np.random.default_rng(1).normal(100, 5, 24)
    metrics, reference = table(weeks, values)
    few, many = (
        metrics.assign(person=[f"s{number % count}" for number in range(24)])
        for count in (9, 12)
    )
    # many scans of nine subjects leave nothing to know a scatter by
    assert set(scores(few, reference)["flag"]) == {"too few brains"}
    assert curves(few, reference).empty
    assert set(scores(many, reference)["brains"]) == {11}
    # a scan given twice says no more than once
    own = metrics.assign(person=metrics["subject"])
    twice = pd.concat([own, own.assign(subject=own["subject"] + "again")])
    both = [curves(metrics, reference), curves(twice, list(twice["subject"]))]
    np.testing.assert_allclose(
        both[0][["q05", "q95"]], both[1][["q05", "q95"]], rtol=1e-3
    )


@pytest.mark.parametrize(
    "metric",
    [
        "crossing_faces",
        "curvature_radius",
        "weyl_number",
        "spangy_shape_index_B4_power",
        "area_ratio",
    ],
)
def test_properties_of_the_mesh_and_of_the_analysis_have_no_norm(metric: str) -> None:
    weeks = np.arange(21.0, 33.0)
    metrics, reference = table(weeks, 10 * weeks + np.tile([1.0, -1.0], 6))
    assert len(curves(metrics, reference))
    assert curves(metrics.assign(metric=metric), reference).empty
    assert scores(metrics.assign(metric=metric), reference).empty


def test_few_brains_make_centiles_cautious() -> None:
    weeks = np.array([21.0, 23.0, 25.0, 27.0, 29.0, 31.0] * 2)
    values = 10 * weeks + np.tile([1.0, -1.0], 6)
    metrics, reference = table(
        weeks, values, ("run", 26.0, 260.0 + 1.5), ("far", 26.0, 280.0)
    )
    found = scores(metrics, reference).set_index("run")
    assert (found.loc["run", "brains"], found.loc["run", "flag"]) == (12, "few brains")
    assert found.loc["run", "expected"] == pytest.approx(260.0, abs=0.3)
    # the normal distribution would be surer than twelve brains allow
    assert 80.0 < found.loc["run", "centile"] < 92.0 < 100 * stats.norm.cdf(1.5)
    assert found.loc["far", "centile"] == pytest.approx(95.0)


def skewed_values(weeks: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Return values of either sign whose distances above the median are larger than
    those below."""
    return 0.1 * (weeks - 29) + np.exp(0.5 * z) - 1


def test_centiles_of_skewed_metrics_of_either_sign() -> None:
    random = np.random.default_rng(3)
    weeks = random.uniform(21.0, 37.0, 400)
    values = skewed_values(weeks, random.standard_normal(400))
    norm = fit_norm(weeks, values, np.arange(400), is_positive=False)
    assert not norm.is_skewed
    assert norm.has_converged
    at = np.array([22.0, 29.0, 36.0])
    for z in (-1.645, 0.0, 1.645):
        true = skewed_values(at, np.full(3, z))
        found, _ = norm.scores(at, true)
        assert found == pytest.approx(z, abs=0.25)
        assert norm.values(at, z) == pytest.approx(true, abs=0.3)
        # values are the inverse of scores
        there = norm.values(at, z)
        assert norm.scores(at, there)[0] == pytest.approx(z, abs=1e-6)


def test_centiles_of_few_skewed_subjects_end_early() -> None:
    weeks = np.linspace(21.0, 37.0, 40)
    # z of evenly spread subjects, in an order that has nothing to do with their weeks
    z = stats.norm.ppf((np.arange(40) * 17 % 40 + 0.5) / 40)
    values = skewed_values(weeks, z)
    metrics, reference = table(
        weeks,
        values,
        ("low", 29.0, -3.0),
        ("high", 29.0, 5.0),
    )
    metrics["metric"] = "mean_shape_index"
    found = scores(metrics, reference).set_index("run")
    assert set(found["flag"]) == {"skewed"}
    assert found.loc["low", "centile"] == pytest.approx(10.0)
    assert found.loc["high", "centile"] == pytest.approx(90.0)
    # the scale is so large that the skewness matters, and is not known
    wide = fit_norm(weeks, np.exp(values), np.arange(40), is_positive=True)
    assert wide.is_skewed


def test_a_norm_that_has_not_converged_is_flagged(monkeypatch) -> None:
    monkeypatch.setattr("gyriflow.metrics.lms.ROUNDS", 1)
    random = np.random.default_rng(7)
    weeks = random.uniform(21.0, 37.0, 40)
    values = 10 * weeks * (1 + 0.02 * (weeks - 20) * random.standard_normal(40))
    found = scores(*table(weeks, values, ("other", 29.0, 300.0)))
    assert set(found["flag"]) == {"not converged"}


@pytest.mark.parametrize("subjects", [60, 150])
def test_reference_brains_far_from_the_norm_are_named(subjects) -> None:
    random = np.random.default_rng(11)
    weeks = np.tile(np.linspace(21.0, 37.0, 30), subjects // 30)
    values = 10 * weeks * (1 + 0.05 * random.standard_normal(subjects))
    wrong = np.array([4, 17, 40])
    values[wrong] *= 0.5
    metrics, reference = table(weeks, values)
    cohort = cohort_norms(metrics, reference)
    found = outlying_brains(metrics, reference, cohort)
    assert found == {f"s{number}": ["whole area"] for number in wrong}
    averages = cohort_norms(metrics, reference, individuals=False)
    assert outlying_brains(metrics, reference, averages) == {}


def test_what_cannot_be_scored_is_said() -> None:
    weeks = np.arange(21.0, 33.0)
    metrics, reference = table(
        weeks,
        10 * weeks + np.tile([1.0, -1.0], 6),
        ("a", 33.0, 1.0),
        ("b", 25.0, 250.0),
    )
    found = scores(metrics, reference).set_index("run")["flag"]
    assert (found["a"], found["b"]) == ("outside the reference's weeks", "few brains")
    few = (
        scores(*table(weeks[:9], weeks[:9], ("a", 22.0, 1.0))).set_index("run").loc["a"]
    )
    assert few["flag"] == "too few brains"
    assert np.isnan(few["centile"])


def test_averages_give_a_curve_and_no_centiles() -> None:
    weeks = np.arange(21.0, 29.0)
    metrics, reference = table(
        weeks, 10 * weeks + np.tile([1.0, -1.0], 4), ("b", 25.0, 260.0)
    )
    found = scores(metrics, reference, individuals=False).set_index("run").loc["b"]
    assert found["expected"] == pytest.approx(250.0, abs=0.5)
    assert found[["sd", "z", "centile"]].isna().all()
    assert found["flag"] == SPREAD_UNKNOWN
    found = curves(metrics, reference, individuals=False)
    assert found["expected"].notna().all()
    assert found[["sd", "q05", "q95"]].isna().all(axis=None)


def test_half_a_brain_is_not_compared_with_whole_ones() -> None:
    weeks = np.arange(21.0, 33.0)
    metrics, reference = table(
        weeks,
        10 * weeks + np.tile([1.0, -1.0], 6),
        ("half", 25.0, 125.0),
        ("all", 25.0, 250.0),
    )
    sides = [
        metrics.assign(hemisphere=side, value=metrics["value"] / share)[rows]
        for side, share, rows in (
            ("whole", 1.0, metrics["run"] != ""),
            ("left", 2.0, metrics["run"] != "half"),
            ("right", 2.0, metrics["run"] != "half"),
            ("left", 1.0, metrics["run"] == "half"),
        )
    ]
    found = scores(pd.concat(sides, ignore_index=True), reference).set_index(
        ["run", "hemisphere"]
    )
    assert found.loc[("all", "whole"), "flag"] == "few brains"
    for side in ("whole", "left"):
        assert found.loc[("half", side), "flag"] == "other hemispheres"
        assert found.loc[("half", side), ["z", "centile", "expected"]].isna().all()
        assert found.loc[("half", side), "brains"] == 0


def test_one_hemisphere_is_not_scored_by_volumes_of_both() -> None:
    volumes = {3: 20.0, 7: 2.3, 8: 2.3}
    found = published_scores(labelled(29.0, volumes, sides=("left",)), NORMS).set_index(
        "structure"
    )
    assert found["flag"].tolist() == ["one hemisphere", "ok", "one hemisphere"]
    assert found.loc["cortex", ["expected", "sd", "z", "centile"]].isna().all()
    assert found.loc["left_lateral_ventricle", "z"] == pytest.approx(0.0, abs=0.1)
    assert (published_scores(labelled(29.0, volumes), NORMS)["flag"] == "ok").all()


def test_structures_of_the_norms_scheme_and_of_others() -> None:
    own = published_scores(
        labelled(21.0, {3: 4.0, 4: 5.0, 7: 1.0, 14: 2.0, 17: 1.0}), NORMS
    ).set_index("structure")
    assert own["value"].to_dict() == {
        "cortex": 9.0,
        "deep_grey": 3.0,
        "left_lateral_ventricle": 1.0,
    }
    assert set(own["flag"]) == {"ok"}
    # 2 is the cortex of FeTA and outer CSF of BOUNTI; it has no sides for the
    # ventricles
    other = published_scores(
        labelled(21.0, {2: 8.0, 3: 40.0, 4: 3.0}, "feta-7"), NORMS
    ).set_index("structure")
    assert other["value"].to_dict() == {"cortex": 8.0, "white_matter": 40.0}
    assert set(other["flag"]) == {"other labels"}


def test_tables_of_volumes_have_the_labels_and_the_structures_of_each_brain():
    brains = [
        LabelledBrain("a", 21.0, SIDES, SCHEMES["feta-7"], {2: 8.0, 9: 1.5}),
        LabelledBrain("b", 29.0, ("left",), SCHEMES["dhcp-19"], {7: 2.0, 3: 9.0}),
    ]
    volumes, scores = volume_tables(brains, NORMS)
    assert volumes.to_numpy().tolist() == [
        ["a", "observed", 21.0, 2, "cortex", 8.0],
        ["a", "observed", 21.0, 9, "", 1.5],
        ["b", "observed", 29.0, 7, SCHEMES["dhcp-19"].labels[7], 2.0],
        ["b", "observed", 29.0, 3, SCHEMES["dhcp-19"].labels[3], 9.0],
    ]
    assert scores[
        ["subject", "structure", "value", "week", "flag"]
    ].to_numpy().tolist() == [
        ["a", "cortex", 8.0, 21.0, "other labels"],
        ["b", "cortex", 9.0, 29.0, "one hemisphere"],
        ["b", "left_lateral_ventricle", 2.0, 29.0, "ok"],
    ]


COLUMNS = ["subject", "run", "week", "hemisphere", "metric", "value", "unit"]
METRICS = pd.DataFrame(
    [
        ("early", "observed", 22.0, "whole", "area", 100.0, "cm2"),
        ("late", "observed", 24.0, "whole", "area", 150.0, "cm2"),
        ("early", "follows", 22.0, "whole", "area", 98.0, "cm2"),
        ("early", "follows", 23.0, "whole", "area", 120.0, "cm2"),
        ("early", "follows", 24.0, "whole", "area", 140.0, "cm2"),
        ("other", "observed", 24.0, "whole", "area", 160.0, "cm2"),
        ("other", "observed", 24.0, "left", "mean_curvedness", 0.1, "1/mm"),
    ],
    columns=COLUMNS,
)
REGIONS = pd.DataFrame(
    [
        ("early", "observed", 22.0, "left", "frontal", "area", 20.0, "cm2"),
        ("late", "observed", 24.0, "left", "frontal", "area", 26.0, "cm2"),
    ],
    columns=[*COLUMNS[:4], "region", *COLUMNS[4:]],
)
SCANS = {"one": ["early", "late"]}


def test_change_of_scans_and_of_the_simulation_from_the_first() -> None:
    table = change_between_scans(long_table([METRICS, REGIONS]), SCANS).set_index(
        ["run", "region"]
    )
    scans = table.loc[("observed", "")]
    assert (scans["from_value"], scans["to_value"], scans["change"]) == (
        100.0,
        150.0,
        50.0,
    )
    assert scans["change_per_week"] == pytest.approx(25.0)
    assert scans["relative_change"] == pytest.approx(0.5)
    assert scans["difference"] == 0.0
    run = table.loc[("follows", "")]
    # from the run's own start, beside what was measured
    assert (run["change"], run["measured_change"], run["difference"]) == (
        42.0,
        50.0,
        -10.0,
    )
    assert table.loc[("observed", "frontal"), "change"] == 6.0
    assert ("follows", "frontal") not in table.index
    assert set(table["subject"]) == {"one"}


def test_change_of_a_metric_below_zero_over_uneven_weeks() -> None:
    rows = [
        ("early", "observed", 21.5, "right", "mean_shape_index", -0.2, "1"),
        ("late", "observed", 24.0, "right", "mean_shape_index", 0.05, "1"),
        ("early", "run", 21.5, "right", "mean_shape_index", -0.4, "1"),
        ("early", "run", 24.0, "right", "mean_shape_index", -0.1, "1"),
    ]
    found = change_between_scans(
        long_table([pd.DataFrame(rows, columns=COLUMNS)]), SCANS
    ).set_index("run")
    names = [
        "change",
        "change_per_week",
        "relative_change",
        "measured_change",
        "difference",
    ]
    assert found.loc["observed", names].tolist() == pytest.approx(
        [0.25, 0.1, 1.25, 0.25, 0.0]
    )
    assert found.loc["run", names].tolist() == pytest.approx(
        [0.3, 0.12, 0.75, 0.25, -0.15]
    )
    assert found.loc[
        "run", ["from_brain", "to_brain", "from_week", "to_week"]
    ].tolist() == [
        "early",
        "late",
        21.5,
        24.0,
    ]


def test_wide_has_a_row_per_brain_and_week() -> None:
    table = wide_table(long_table([METRICS, REGIONS]), {})
    assert len(table) == 6
    row = table.set_index(["subject", "run", "week"]).loc[("other", "observed", 24.0)]
    assert row["whole_area_cm2"] == 160.0
    assert row["left_mean_curvedness_1_per_mm"] == 0.1
    assert np.isnan(row["left_frontal_area_cm2"])
    known = wide_table(
        long_table([METRICS, REGIONS]), {"other": {"sex": "F", "run": "3"}}
    ).set_index("subject")
    assert list(known.columns[:3]) == ["run", "week", "sex"]
    assert known.loc["other", "sex"] == "F"
    assert known["run"].isin(table["run"]).all()


@pytest.mark.parametrize(
    ("first", "second"),
    [
        (("upper bank", "area"), ("upper-bank", "area")),
        # the end of one name is the beginning of the other
        (("frontal", "mean_shape_index"), ("frontal_mean", "shape_index")),
        (("", "relative_power_B4"), ("relative", "power_B4")),
    ],
)
def test_regions_of_one_column_are_refused_with_both_names(first, second) -> None:
    rows = [
        {
            "subject": "a",
            "run": "observed",
            "week": 21.0,
            "hemisphere": "left",
            "region": region,
            "metric": metric,
        }
        for region, metric in (first, second)
    ]
    table = pd.DataFrame(rows).assign(value=[1.0, 2.0], unit="1")
    with pytest.raises(InputError, check=Facts(repr(first[0]), repr(second[0]))):
        wide_table(table, {})


def test_columns_are_described_by_side_region_and_unit() -> None:
    columns = described_columns(long_table([METRICS, REGIONS]))
    assert columns["left_frontal_area_cm2"] == (
        Facts("region frontal", "left hemisphere"),
        "cm2",
    )
    assert columns["whole_area_cm2"] == (Facts("both hemispheres"), "cm2")
    assert "region" not in columns["left_mean_curvedness_1_per_mm"][0]
    assert columns["left_mean_curvedness_1_per_mm"][1] == "1/mm"


def test_asymmetry_of_sides() -> None:
    sides = ["right", "left", "left", "right"]
    regions = ["frontal"] * 2 + ["insula"] * 2
    table = pd.DataFrame({"hemisphere": sides, "region": regions})
    table = table.assign(metric="area", unit="cm2", value=[30.0, 10.0, 0.0, 0.0])
    found = asymmetry(table).set_index("region")
    # the sign of the larger side
    assert found.loc["frontal", ["difference", "unit", "asymmetry_index"]].tolist() == [
        -20.0,
        "cm2",
        -1.0,
    ]
    assert np.isnan(found.loc["insula", "asymmetry_index"])
    # 0.01 and −0.01 are nearly equal, not as different as can be
    signed = asymmetry(
        table.assign(metric="mean_shape_index", value=[-0.01, 0.01, 0.1, 0.2])
    )
    assert signed["difference"].tolist() == pytest.approx([0.02, -0.1])
    assert signed["asymmetry_index"].isna().all()


def test_norms_per_week_of_all_and_pial_nodes() -> None:
    start = np.zeros((4, 3))
    first = np.array([[3.0, 4, 0], [0, 0, 1], [0, 0, 0], [0, 0, 2]])
    second = first + np.array([0, 0, 0.5])
    table = weekly_norms([21.0, 22.0, 23.5], [start, first, second], np.array([1, 3]))
    assert table.columns.tolist() == [
        "from_week",
        "to_week",
        "nodes",
        "max_mm",
        "mean_mm",
    ]
    assert table.to_numpy().tolist() == [
        [21.0, 22.0, "all", 5.0, 2.0],
        [21.0, 22.0, "pial", 2.0, 1.5],
        [22.0, 23.5, "all", 0.5, 0.5],
        [22.0, 23.5, "pial", 0.5, 0.5],
    ]
