"""Norms of brains that are drawn from known curves, and published ones; tables of a
study, by brain, side and week."""

import numpy as np
import pandas as pd
import pytest
import yaml
from configurations import LABELLED, problems, study
from facts import Facts
from scipy.special import ndtr, ndtri, stdtr

from gyriflow.errors import InputError
from gyriflow.io.files import write_json
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
    volume_tables,
)
from gyriflow.metrics.tables import asymmetry, wide_table
from gyriflow.settings.terms import SIDES, SPREAD_UNKNOWN
from gyriflow.shipped import SHIPPED
from gyriflow.study.checks import norm_settings
from gyriflow.study.loading import load

FILE = SHIPPED / "norms" / "svrtk-volumes.yaml"
NORMS = published_norms(yaml.safe_load(FILE.read_text()))
COLUMNS = ["subject", "run", "week", "hemisphere", "metric", "value", "unit"]


def table(weeks, values, *others):
    """Return metrics of reference brains and of others (run, week, value), and the
    reference."""
    reference = [f"s{number}" for number in range(len(weeks))]
    rows = []
    for brain, week, value in zip(reference, weeks, values, strict=True):
        rows.append((brain, "observed", week, "whole", "area", value, "cm2"))
    for run, week, value in others:
        rows.append(("other", run, week, "whole", "area", value, "cm2"))
    return pd.DataFrame(rows, columns=COLUMNS), reference


def near_a_line(*others):
    """Return twelve reference brains, 1 cm² off 10 cm² a week from 21 to 32 GW, and
    others, as `table` does."""
    weeks = np.arange(21.0, 33.0)
    return table(weeks, 10 * weeks + np.tile([1.0, -1.0], 6), *others)


def growing(weeks):
    """Return a mean volume (mL) over the weeks."""
    return 80 + 270 * ((weeks - 21) / 16) ** 1.3


def grown_brains(subjects, last=36.0, scatter=0.08):
    """Return weeks and volumes (mL) of subjects at random around `growing`."""
    random = np.random.default_rng(0)
    weeks = random.uniform(21, last, subjects)
    return weeks, growing(weeks) * (1 + scatter * random.standard_normal(subjects))


def scores(metrics, reference, **options):
    cohort = cohort_norms(metrics, reference, **options)
    return measured_scores(metrics, reference, cohort)


def scores_beside_the_reference(metrics, reference, **options):
    """Return the scores of the brains beside the reference, and of its last one: the
    norm would be fitted without each of a reference."""
    cohort = cohort_norms(metrics, reference, **options)
    others = metrics[~metrics["subject"].isin(reference[:-1])]
    return measured_scores(others, reference, cohort)


def curves(metrics, reference, **options):
    return norm_curves(cohort_norms(metrics, reference, **options))


def published_scores(week, volumes, scheme="dhcp-19", sides=SIDES):
    """Return the scores of a brain's volumes by structure."""
    brain = LabelledBrain("a", week, sides, SCHEMES[scheme], volumes)
    return volume_tables([brain], NORMS)[1].set_index("structure")


def test_published_volumes_of_cortex_and_white_matter() -> None:
    # at 29 weeks: 0.3052·841 − 11.828·29 + 123 and 0.0223·841 + 7.3471·29 − 145.28
    found = published_scores(29.0, {3: 36.66 + 3.787, 5: 86.54, 99: 1.0})
    assert list(found.index) == ["cortex", "white_matter"]
    assert found["expected"].tolist() == pytest.approx([36.66, 86.54], abs=0.01)
    # SD of the cortex: 0.01647·841 − 0.47701·29 + 3.76905
    assert found.loc["cortex", "sd"] == pytest.approx(3.787, abs=0.001)
    assert found.loc["cortex", "z"] == pytest.approx(1.0, abs=0.01)
    assert found["centile"].tolist() == pytest.approx([84.13, 50.0], abs=0.3)
    assert np.isnan(found["brains"]).all()


def test_published_norms_hold_from_their_first_to_their_last_week() -> None:
    first, last = NORMS["cortex"].weeks
    weeks = [first - 0.1, first, last, last + 0.1]
    flags = [published_scores(week, {3: 30.0})["flag"].item() for week in weeks]
    outside = "outside the norm's weeks"
    assert flags == [outside, "ok", "ok", outside]
    for norm in NORMS.values():
        assert np.polyval(norm.sd, np.linspace(*norm.weeks, 201)).min() > 0


def test_few_subjects_of_one_week_are_compared_by_students_distribution() -> None:
    values = np.array([3.0, 5.0, 4.0, 6.5, 2.5, 4.5, 5.5, 3.5, 4.0, 6.0, 3.0, 4.5])
    norm = fit_norm(np.full(12, 25.0), values, np.arange(12), is_positive=False)
    distance = (7.0 - values.mean()) / values.std(ddof=1)
    z, (low, high) = norm.scores([25.0], [7.0])
    # once with the error of the mean: in the spread of new subjects
    student = stdtr(11, distance / np.sqrt(1 + 1 / 12))
    assert z[0] == pytest.approx(ndtri(student), rel=1e-3)
    error = 1.645 * np.sqrt(1 / 12 + distance**2 / 22)
    assert [low[0], high[0]] == pytest.approx(
        [distance - error, distance + error], rel=1e-3
    )
    assert norm.values([25.0], float(z[0])) == pytest.approx([7.0], rel=1e-6)


def test_skewness_is_estimated_from_many_subjects() -> None:
    random = np.random.default_rng(0)
    many, few = 400, MIN_SUBJECTS_FOR_SKEWNESS - 1
    for share, subjects in ((0.0, many), (1.0, many), (1.0, few)):
        weeks = random.uniform(21, 37, subjects)
        z = random.standard_normal(subjects).clip(-3, 3)
        values = growing(weeks) * np.where(share, 1 + 0.25 * z, np.exp(0.25 * z))
        norm = fit_norm(weeks, values, np.arange(subjects), is_positive=True)
        expected = pytest.approx(share, abs=0.35) if subjects == many else SKEWNESS
        assert norm.skewness == expected


@pytest.mark.parametrize(
    ("subjects", "weeks", "is_positive"),
    [(200, 160, True), (200, 7, False), (200, 1, True), (20, 16, False), (20, 3, True)],
)
def test_values_and_scores_are_inverse(subjects, weeks, is_positive) -> None:
    random = np.random.default_rng(2)
    at = random.choice(np.linspace(21, 37, weeks), subjects)
    values = growing(at) * np.exp(0.1 * random.standard_normal(subjects))
    values -= 0 if is_positive else 150
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
    norm = fit_norm(weeks, values, np.arange(500), is_positive=True)
    ends = np.array([22.0, 28.0])
    sd = 0.5 * (norm.values(ends, 1.0) - norm.values(ends, -1.0))
    assert sd == pytest.approx(ends - 20, rel=0.2)
    low = values < norm.values(weeks, ndtri(0.1))
    for week in ends:
        assert low[weeks == week].mean() == pytest.approx(0.1, abs=0.08)


def test_a_brain_of_the_reference_is_compared_with_the_others() -> None:
    weeks, values = grown_brains(60)
    values[0] *= 1.5
    found = scores(*table(weeks, values))
    assert (found["brains"] == 59).all()
    counts, _ = np.histogram(found["centile"], np.linspace(0, 100, 5))
    assert np.abs(counts - 15).max() < 8
    # as if it had never been there, for the odd one and a usual one
    for number in (0, 1):
        others = np.arange(60) != number
        brain = ("it", weeks[number], values[number])
        alone = scores_beside_the_reference(
            *table(weeks[others], values[others], brain)
        ).iloc[-1]
        assert found["z"][number] == pytest.approx(alone["z"], abs=0.03)


def test_norms_of_a_file_are_of_its_hemispheres_and_kind_of_brains() -> None:
    metrics, reference = near_a_line(("new", 25.0, 250.0))
    new = metrics[metrics["run"] == "new"]
    one_side = pd.concat([new, new.assign(hemisphere="left")])
    for individuals, brain, flag in (
        (True, new, "few brains"),
        (False, new, SPREAD_UNKNOWN),
        (True, one_side, "other hemispheres"),
    ):
        cohort = cohort_norms(metrics, reference, individuals=individuals)
        again = cohort_from_plain(cohort.plain)
        assert measured_scores(brain, [], again)["flag"].tolist() == [flag]


def test_norms_are_read_by_another_study_with_the_same_settings(tmp_path) -> None:
    settings = norm_settings(load(study()))
    made_with = settings | {"schemes": [LABELLED["scheme"], "more"]}
    path = tmp_path / "norms.json"
    write_json(path, cohort_norms(*near_a_line(), made_with=made_with).plain)
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


@pytest.mark.parametrize("metric", ["crossing_faces", "area_ratio"])
def test_properties_of_the_mesh_and_of_the_analysis_have_no_norm(metric: str) -> None:
    metrics, reference = near_a_line()
    assert len(curves(metrics, reference))
    assert curves(metrics.assign(metric=metric), reference).empty
    assert scores(metrics.assign(metric=metric), reference).empty


def test_few_brains_make_centiles_cautious() -> None:
    weeks = np.array([21.0, 23.0, 25.0, 27.0, 29.0, 31.0] * 2)
    values = 10 * weeks + np.tile([1.0, -1.0], 6)
    metrics, reference = table(
        weeks, values, ("run", 26.0, 260.0 + 1.5), ("far", 26.0, 280.0)
    )
    found = scores_beside_the_reference(metrics, reference).set_index("run")
    assert (found.loc["run", "brains"], found.loc["run", "flag"]) == (12, "few brains")
    assert found.loc["run", "expected"] == pytest.approx(260.0, abs=0.3)
    # the normal distribution would be surer than twelve brains allow
    assert 80.0 < found.loc["run", "centile"] < 92.0 < 100 * ndtr(1.5)
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
    assert (norm.is_skewed, norm.has_converged) == (False, True)
    at = np.array([22.0, 29.0, 36.0])
    for z in (-1.645, 0.0, 1.645):
        true = skewed_values(at, np.full(3, z))
        found, _ = norm.scores(at, true)
        assert found == pytest.approx(z, abs=0.25)
        assert norm.values(at, z) == pytest.approx(true, abs=0.3)


def test_centiles_of_few_skewed_subjects_end_early() -> None:
    weeks = np.linspace(21.0, 37.0, 40)
    # z of evenly spread subjects, in an order that has nothing to do with their weeks
    z = ndtri((np.arange(40) * 17 % 40 + 0.5) / 40)
    values = skewed_values(weeks, z)
    others = ("low", 29.0, -3.0), ("high", 29.0, 5.0)
    metrics, reference = table(weeks, values, *others)
    metrics["metric"] = "mean_shape_index"
    found = scores(metrics, reference).set_index("run")
    assert set(found["flag"]) == {"skewed"}
    assert found.loc["low", "centile"] == pytest.approx(10.0)
    assert found.loc["high", "centile"] == pytest.approx(90.0)
    # the scale is so large that the skewness matters, and is not known
    wide = fit_norm(weeks, np.exp(values), np.arange(40), is_positive=True)
    assert wide.is_skewed


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


def not_converged(monkeypatch):
    monkeypatch.setattr("gyriflow.metrics.lms.ROUNDS", 1)
    random = np.random.default_rng(7)
    weeks = random.uniform(21.0, 37.0, 40)
    values = 10 * weeks * (1 + 0.02 * (weeks - 20) * random.standard_normal(40))
    return table(weeks, values, ("other", 29.0, 300.0))


GROWN = grown_brains(40)
FLAGGED = {
    "outside the reference's weeks": near_a_line(("a", 33.0, 1.0)),
    "few brains": near_a_line(("b", 25.0, 250.0)),
    "too few brains": table(*[np.arange(21.0, 30.0)] * 2, ("a", 22.0, 1.0)),
    "not positive": table(*GROWN, ("flat", 25.0, 0.0)),
    "no spread": table(GROWN[0], np.full(40, 5.0), ("other", 25.0, 6.0)),
    "not converged": not_converged,
}


@pytest.mark.parametrize("flag", FLAGGED)
def test_what_cannot_be_scored_is_said(flag, monkeypatch) -> None:
    study = FLAGGED[flag]
    tables = study(monkeypatch) if callable(study) else study
    found = scores_beside_the_reference(*tables).iloc[-1]
    assert found["flag"] == flag
    assert np.isnan(found["z"]) == (flag not in ("few brains", "not converged"))


def test_averages_give_a_curve_and_no_centiles() -> None:
    metrics, reference = near_a_line(("b", 25.0, 260.0))
    found = scores_beside_the_reference(metrics, reference, individuals=False).iloc[-1]
    assert found["expected"] == pytest.approx(250.0, abs=0.5)
    assert found[["sd", "z", "centile"]].isna().all()
    assert found["flag"] == SPREAD_UNKNOWN
    found = curves(metrics, reference, individuals=False)
    assert found["expected"].notna().all()
    assert found[["sd", "q05", "q95"]].isna().all(axis=None)


def test_half_a_brain_is_not_compared_with_whole_ones() -> None:
    metrics, reference = near_a_line(("half", 25.0, 125.0), ("all", 25.0, 250.0))
    is_half = metrics["run"] == "half"
    halved = metrics[~is_half].assign(value=metrics["value"] / 2)
    sides = [
        metrics,
        halved.assign(hemisphere="left"),
        halved.assign(hemisphere="right"),
        metrics[is_half].assign(hemisphere="left"),
    ]
    found = scores_beside_the_reference(pd.concat(sides, ignore_index=True), reference)
    found = found.set_index(["run", "hemisphere"])
    assert found.loc[("all", "whole"), "flag"] == "few brains"
    for side in ("whole", "left"):
        half = found.loc[("half", side)]
        assert (half["flag"], half["brains"]) == ("other hemispheres", 0)
        assert half[["z", "centile", "expected"]].isna().all()


def test_structures_of_the_norms_scheme_and_of_others() -> None:
    own = published_scores(21.0, {3: 4.0, 4: 5.0, 7: 1.0, 14: 2.0, 17: 1.0})
    assert own["value"].to_dict() == {
        "cortex": 9.0,
        "deep_grey": 3.0,
        "left_lateral_ventricle": 1.0,
    }
    assert set(own["flag"]) == {"ok"}
    # 2 is the cortex of FeTA and outer CSF of BOUNTI; it has no sides for the
    # ventricles
    other = published_scores(21.0, {2: 8.0, 3: 40.0, 4: 3.0}, "feta-7")
    assert other["value"].to_dict() == {"cortex": 8.0, "white_matter": 40.0}
    assert set(other["flag"]) == {"other labels"}


def rows_of(*regions_and_metrics):
    """Return the rows of a left hemisphere in a table as of `long_table`."""
    rows = pd.DataFrame(regions_and_metrics, columns=["region", "metric", "unit"])
    brain = {"subject": "a", "run": "observed", "week": 21.0, "hemisphere": "left"}
    return rows.assign(**brain, value=1.0)


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
    table = rows_of((*first, "1"), (*second, "1"))
    with pytest.raises(InputError, check=Facts(repr(first[0]), repr(second[0]))):
        wide_table(table, {})


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
