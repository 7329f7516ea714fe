"""A study resolved from its configuration: which brains, weeks and files stand behind
each run and comparison."""

from pathlib import Path

import pytest
from configurations import both_kinds, cases, resolved, touched
from facts import Facts
from shapes import sphere

from gyriflow.errors import InputError
from gyriflow.io.surfaces import write_surface
from gyriflow.io.yaml_files import read_yaml
from gyriflow.settings import ensemble
from gyriflow.study import resolve
from gyriflow.study.brains import registered_source
from gyriflow.study.loading import load

EXAMPLES = Path(__file__).parents[3] / "config" / "examples"
EXPECTED = {"runs": {"a": {"preset": "expected"}}}
MEASURED = {"runs": {"a": {"preset": "measured"}}}


@pytest.fixture
def files(tmp_path):
    return touched(tmp_path, "labels.nii.gz", "pial.gii", "white.gii")


@pytest.fixture
def labels(files):
    """What gives a brain of a week from a label volume."""
    given = {"labels": str(files / "labels.nii.gz"), "scheme": "feta-7"}
    return lambda week, **more: {"id": f"b{week}", "week": week, **given, **more}


@pytest.fixture
def of_two(labels):
    """What gives brains of a population, the first of which is to start, and those of
    an atlas."""

    def brains(*weeks, atlas=(21, 22, 23, 24, 25), population="own"):
        own = [labels(week, id=f"own{week}", population=population) for week in weeks]
        return [*own, *(labels(week, population="atlas") for week in atlas)]

    return brains


def study(brains, **sections):
    return resolved(brains, **{"start": "first", **sections})


def message(brains, **sections):
    """Return the message with which a study is refused."""
    with pytest.raises(InputError) as error:
        study(brains, **sections)
    return str(error.value)


# what is folded


def test_the_paper_is_planned_with_the_paper_s_steps_and_ratios():
    found = resolve(load(read_yaml(EXAMPLES / "paper.yaml"), EXAMPLES))
    settings = {}
    for name, rows in found.by_sweep.items():
        settings[name] = [
            found.simulations[row.run, row.brain].settings for row in rows
        ]
    thickness, stiffness = settings["thickness"], settings["stiffness"]
    steps = {run.thickness_mm: run.step_s for run in thickness}
    assert steps == {0.8: 86400, 1.5: 43200, 2.25: 86400, 6.0: 86400}
    assert {run.step_s for run in stiffness} == {43200}
    ends = [stiffness[0], stiffness[-1]]
    ratios = [run.shear_modulus_cortex_pa / run.shear_modulus_core_pa for run in ends]
    assert ratios == [1, 20]


# brains that were refused


def test_a_refused_template_has_no_maps_and_a_refused_brain_is_of_no_norm(labels):
    brains = [labels(week) for week in (21, 22, 23)]
    metrics = {"template": "b23", "norm_reference": ["b21", "b22"]}
    for refused, norm, n_maps in (
        ((), ["b21", "b22"], 2),
        (("b22", "b23"), ["b21"], 0),
    ):
        found = resolved(brains, refused, start="b21", metrics=metrics)
        assert found.norm_reference == norm
        assert {len(row.template_maps) for row in found.exported} == {n_maps}


def test_nothing_is_left_where_no_start_is(labels):
    later = {"base": "reference", "compare_week": 24}
    search = later | {"parameters": {"thickness_mm": [1, 3]}, "score": {"size": 1}}
    empty = resolved([labels(21), labels(24)], ["b21"], calibrate=search, start="b21")
    assert empty.run_simulations == empty.norm_reference == []
    assert empty.calibration == {}


# the brains behind a run's growth


def test_a_brain_is_expected_by_one_series_of_another_population_that_reaches_the_end(
    of_two, labels
):
    third = [labels(week, population="third", id=f"third{week}") for week in (22, 24)]
    for brains, found in (
        (of_two(22, 24, atlas=()), ["volume"]),
        (of_two(22, atlas=(21, 23)), ["own22 (22 GW)", "b21 (21 GW)", "b23 (23 GW)"]),
        # more than a week before the first brain of the atlas
        (of_two(22, atlas=(23.5, 24)), ["b23.5 (23.5 GW)", "b24 (24 GW)"]),
        ([*of_two(22), *third], ["atlas, third"]),
    ):
        assert message(brains, **EXPECTED) == Facts(
            "own22", 22, 24, "growth.series", *found
        )
    named = study([*of_two(22), *third], growth={"series": "third"}, **EXPECTED)
    assert named.chains["own22", "atlas"].later == ("third22", "third24")


def test_scans_of_other_subjects_are_grown_towards_only_if_they_are_named(labels):
    scans = [("a", 22), ("a", 26), ("b", 24), ("b", 27), ("c", 25)]
    cohort = [
        labels(week, id=f"{subject}{week}", subject=subject) for subject, week in scans
    ]
    late = {"folding": {"end_week": 27}, **MEASURED}
    assert message(cohort, start="c25", **late) == Facts("c25", "a, b", 25, 27)
    # a list of brains is no chain
    growth = {"growth": {"brains": ["a22", "b24", "b27"]}}
    assert study(cohort, start="b24", **growth, **late).growth_brains
    assert message(cohort, start="a22", **growth, **late) == Facts("a22", "b", 22, 27)


def test_its_own_growth_lacks_brains_whatever_is_named(of_two):
    named = {"growth": {"series": "atlas"}, **MEASURED}
    assert message(of_two(22), **named) == Facts("atlas", 22, 24, "growth.brains")
    early = message(of_two(22, 23), **MEASURED)
    assert early == Facts("own22 (22 GW)", "own23 (23 GW)", 24, "growth.brains")


def test_an_atlas_has_to_reach_the_end_of_sweeps(of_two):
    sweep = {"base": "a", "compare_week": 26, "vary": {"thickness_mm": [1.0, 2.0]}}
    found = message(of_two(22, 24, 26), **EXPECTED, sweeps={"late": sweep})
    assert found == Facts("own22", 22, 26)


# ensembles


def test_the_age_of_a_member_stays_within_its_atlas(of_two, monkeypatch):
    monkeypatch.setattr(ensemble, "AGE_SD_GW", 2.0)
    run = {"preset": "expected", "ensemble": 6}
    # the start is a week before the atlas, which ends with the run
    found = study(of_two(21, 24, atlas=(22, 23, 24)), runs={"a": run})
    chains = [found.chains["own21", f"atlas.a-member-{n}"] for n in range(1, 7)]
    shifts = [chain.variation.age_shift_gw for chain in chains]
    assert (min(shifts), max(shifts)) == (0.0, 0.5)
    assert all(len(chain.later) > 1 for chain in chains)


@cases(
    ("weeks", "further"),
    """
    [21, 22] | {}
    [21, 22, 23] | {b: {growth: shapes, end_week: 23}}
    """,
)
def test_members_that_would_be_equal_are_refused(tmp_path, weeks, further):
    raw = both_kinds(tmp_path, weeks)
    write_surface(tmp_path / "pial.surf.gii", sphere(30.0, 2))
    runs = {"a": {"growth": "shapes", "ensemble": 3}, **further}
    config = load(raw | {"runs": runs, "folding": {"end_week": 22}}, tmp_path)
    facts = Facts("s21", "ensemble", "growth.matched_surfaces")
    with pytest.raises(InputError, check=facts):
        resolve(config)


@cases(
    ("runs", "facts"),
    """
    {a: {ensemble: 3}} | [runs.a.ensemble, rates, shapes]
    {a: {growth: shapes, ensemble: 2}} | [runs.a.ensemble, 2, 3]
    {a: {growth: shapes, ensemble: 3}, a-member-2: {}} | [runs.a-member-2]
    """,
)
def test_members_need_shapes_and_names_and_are_three_or_more(of_two, runs, facts):
    assert message(of_two(22, 24), runs=runs) == Facts(*facts)


# brains that are filled with labels


def test_surfaces_are_registered_by_labels_that_they_are_filled_with(of_two, files):
    pial = str(files / "pial.gii")
    found = study([{"id": "own22", "week": 22, "pial": pial}, *of_two()])
    filled = registered_source(found.config, found.brains["own22"])
    assert filled.path == "results/brains/own22/surface/filled.nii.gz"
    assert filled.scheme.cortex
    labels = registered_source(found.config, found.brains["b21"])
    assert labels.path == str(files / "labels.nii.gz")


@cases(
    ("surfaces", "cortex", "similar"),
    """
    [own22] | measured | b22
    [b22, b23, b24, b25] | measured | own22
    [own22, b22, b23, b24, b25] | typical | null
    """,
)
def test_brains_without_labels_are_filled_with_their_own_cortex_or_a_similar_brain_s(
    of_two, files, surfaces, cortex, similar
):
    brains = of_two(22, atlas=(22, 23, 24, 25))
    for brain in brains:
        if brain["id"] in surfaces:
            del brain["labels"], brain["scheme"]
            brain["pial"] = str(files / "pial.gii")
    settings = EXPECTED | {"growth": {"matched_surfaces": False}}
    found = study(brains, **settings)
    assert found.chains["own22", "atlas"].weeks[1:] == (22, 23, 24)
    assert found.filled == [{"ids": surfaces, "cortex": cortex, "by_cortex": True}]
    assert {found.brains[name].thickness_of for name in surfaces} == {similar}
    for brain in brains:
        if brain["id"] in surfaces:
            brain["white"] = str(files / "white.gii")
    assert [group["cortex"] for group in study(brains, **settings).filled] == ["white"]


# predictions


def test_a_brain_is_predicted_where_no_later_brain_that_it_is_compared_with_was_read(
    of_two,
):
    runs = EXPECTED["runs"] | {"paper": {}, "measured": {"preset": "measured"}}
    found = study(of_two(22, 23, 24), runs=runs)
    # a run that no brain tells of stands beside it, and one that later brains explain
    # does not
    predictions = [(one.run, one.is_atlas_prediction) for one in found.predictions]
    assert predictions == [("a", True), ("paper", False)]


def test_a_prediction_is_described_by_its_weeks_its_atlas_and_its_files(of_two):
    found = study(of_two(22.4), **EXPECTED, folding={"end_week": 23.9})
    described = found.prediction_facts
    at = "results/runs/a/own22.4/surfaces/week-23.90"
    assert described | {"surfaces": described["surfaces"][:1]} == {
        "run": "a",
        "brain": "own22.4",
        "start_week": 22.4,
        "week": 23.9,
        "atlas_brain": "b24",
        "atlas_week": 24,
        # a series of one's own is no atlas with a licence
        "population": "atlas",
        "atlas": None,
        "surfaces": [f"{at}/fine/pial.surf.gii"],
        "atlas_surface": f"{at}/atlas.pial.surf.gii",
        "labels": "results/export/sub-own224/anat/sub-own224_desc-agw2390_dseg.nii.gz",
    }
    (simulation,) = found.run_simulations
    # the brains that may have the age of a week, or the nearest one
    for week, near in ((23.9, ["b22", "b23", "b24", "b25"]), (30.0, ["b25"])):
        assert [b.id for b in found.atlas_brains_near(simulation, week)] == near


def test_no_prediction_is_explained_by_its_own_later_brains_or_one_of_several_runs(
    of_two,
):
    own = study(of_two(22, 23, 24), **MEASURED)
    assert own.prediction_facts is None
    # its growth is measured on the mesh's surface
    row = own.rows_of(own.run_simulations[0])[-1]
    assert own.measured_parts(row) == row.parts
    several = EXPECTED["runs"] | {"plain": {}}
    assert study(of_two(22), runs=several).prediction_facts is None
