"""A study resolved from its configuration: which brains, weeks and files stand behind
each run, comparison and norm. The order in the configuration decides nothing by chance.

What `plans/` has is not tried again here.
"""

from pathlib import Path

import pytest
from configurations import both_kinds, brain, cases, labelled, resolved
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
BALL = {"id": "ball", "week": 21, "shape": {}}


def study(brains, **sections):
    return resolved(brains, **{"start": "first", **sections})


def own_and_atlas(*weeks, atlas=(21, 22, 23, 24, 25)):
    """Return brains of a population, the first of which is to start, and of an
    atlas."""
    own = [brain(f"own{week}", week, population="own") for week in weeks]
    return own + [brain(f"b{week}", week, population="atlas") for week in atlas]


def message(brains, **sections):
    """Return the message with which a study is refused."""
    with pytest.raises(InputError) as error:
        study(brains, **sections)
    return str(error.value)


def test_the_paper_is_planned_with_the_paper_s_steps_and_ratios():
    found = resolve(load(read_yaml(EXAMPLES / "paper.yaml"), EXAMPLES))
    steps, ratios = {}, []
    for row in found.by_sweep["thickness"]:
        run = found.simulations[row.run, row.brain].settings
        steps[run.thickness_mm] = run.step_s
    for row in found.by_sweep["stiffness"]:
        run = found.simulations[row.run, row.brain].settings
        ratios.append(run.shear_modulus_cortex_pa / run.shear_modulus_core_pa)
        assert run.step_s == 43200
    assert steps == {0.8: 86400, 1.5: 43200, 2.25: 86400, 6.0: 86400}
    assert (ratios[0], ratios[-1]) == (1, 20)


# norms, template and properties of brains


@cases(
    ("start", "named", "reference"),
    """
    well22 | null | [well21, well22]
    ill23 | null | [ill21, ill23]
    [ill21, well21] | null | [ill21, ill23]
    half | null | [half]
    well22 | [ill21, half, well22] | [ill21, well22]
    """,
)
def test_the_norm_is_of_the_population_and_the_hemispheres_of_the_first_start(
    start, named, reference
):
    brains = [
        brain("ill21", 21, population="ill"),
        BALL,
        *(brain(f"well{week}", week, population="well") for week in (21, 22)),
        brain("half", 22, side="right", population="well"),
        brain("ill23", 23, population="ill"),
    ]
    metrics = {"norm_reference": named}
    assert resolved(brains, start=start, metrics=metrics).norm_reference == reference


def test_the_norm_is_of_all_brains_but_shapes_where_no_population_is_known():
    brains = [BALL, *labelled(21, 22), {"id": "surface", "week": 23, "pial": __file__}]
    assert resolved(brains, start="ball").norm_reference == ["a", "b", "surface"]
    assert resolved([BALL], start="ball").norm_reference == []


@pytest.mark.parametrize(("subjects", "drawn"), [(9, False), (10, True)])
def test_norms_are_drawn_of_ten_subjects_however_often_each_was_scanned(
    subjects, drawn
):
    brains = [
        brain(f"s{n}w{week}", week, subject=f"s{n}")
        for n in range(subjects)
        for week in (21, 22)
    ]
    found = resolved(brains, start="s0w21", runs={"reference": {"end_week": 22}})
    assert found.has_norm == drawn


@cases(
    ("refused", "norm", "n_maps"),
    """
    [] | [a, b] | 2
    [b, c] | [a] | 0
    """,
)
def test_a_refused_template_has_no_maps_and_a_refused_brain_is_of_no_norm(
    refused, norm, n_maps
):
    metrics = {"template": "c", "norm_reference": ["a", "b"]}
    found = resolved(labelled(21, 22, 23), refused, metrics=metrics)
    assert found.norm_reference == norm
    assert {len(row.template_maps) for row in found.exported} == {n_maps}


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_second_hemisphere_is_of_another_norm_and_template(side):
    halves = [
        brain(f"{name}{week}", week, name)
        for name in ("left", "right")
        for week in (22, 23.5)
    ]
    metrics = {"template": "left22"}
    found = resolved([*halves, *labelled(21)], start=f"{side}22", metrics=metrics)
    assert found.norm_reference == [f"{side}22", f"{side}23.5"]
    observed = [row for row in found.exported if row.run == "observed"]
    with_maps = {row.brain: [*row.template_maps] for row in observed}
    left, none = ["left"], []
    assert list(with_maps.values()) == [left, left, none, none, left]


def test_nothing_is_left_where_no_start_is():
    later = {"base": "reference", "compare_week": 24}
    search = later | {"parameters": {"thickness_mm": [1, 3]}, "score": {"size": 1}}
    empty = resolved(labelled(21, 24), ["a"], calibrate=search)
    assert empty.run_simulations == empty.norm_reference == []
    assert empty.calibration == {}


@pytest.mark.parametrize(
    ("wanted", "expected"), [("given", {"white"}), ("all", {"white", "a"})]
)
def test_a_brain_has_white_surfaces_that_are_given_or_follow_from_its_labels(
    wanted, expected
):
    pial = {"week": 23, "pial": __file__}
    brains = [{"id": "bare", **pial}, {"id": "white", **pial, "white": __file__}]
    metrics = {"white_surfaces": wanted}
    found = resolved([*brains, *labelled(22)], start="bare", metrics=metrics)
    assert {brain.id for brain in found.brains.values() if brain.white} == expected


# the brains behind a run's growth


def test_a_brain_is_expected_by_one_series_of_another_population_that_reaches_the_end():
    third = [brain(f"third{week}", week, population="third") for week in (22, 24)]
    for brains, found in (
        (own_and_atlas(22, 24, atlas=()), ["volume"]),
        (
            own_and_atlas(22, atlas=(21, 23)),
            ["own22 (22 GW)", "b21 (21 GW)", "b23 (23 GW)"],
        ),
        # more than a week before the first brain of the atlas
        (own_and_atlas(22, atlas=(23.5, 24)), ["b23.5 (23.5 GW)", "b24 (24 GW)"]),
        ([*own_and_atlas(22), *third], ["atlas, third"]),
    ):
        assert message(brains, **EXPECTED) == Facts(
            "own22", 22, 24, "growth.series", *found
        )
    named = study([*own_and_atlas(22), *third], growth={"series": "third"}, **EXPECTED)
    assert named.chains["own22", "atlas"].later == ("third22", "third24")


def test_scans_of_other_subjects_are_grown_towards_only_if_they_are_named():
    cohort = [
        brain(f"{subject}{week}", week, subject=subject)
        for subject, week in (("a", 22), ("a", 26), ("b", 24), ("b", 27), ("c", 25))
    ]
    late = {"folding": {"end_week": 27}, **MEASURED}
    assert message(cohort, start="c25", **late) == Facts("c25", "a, b", 25, 27)
    # a list of brains is no chain
    growth = {"growth": {"brains": ["a22", "b24", "b27"]}}
    assert study(cohort, start="b24", **growth, **late).growth_brains
    assert message(cohort, start="a22", **growth, **late) == Facts("a22", "b", 22, 27)


def test_a_series_needs_a_brain_of_the_end_week_whether_named_or_of_the_start_itself():
    named = {"growth": {"series": "atlas"}, **MEASURED}
    assert message(own_and_atlas(22), **named) == Facts(
        "atlas", 22, 24, "growth.brains"
    )
    early = message(own_and_atlas(22, 23), **MEASURED)
    assert early == Facts("own22 (22 GW)", "own23 (23 GW)", 24, "growth.brains")


def test_an_atlas_has_to_reach_the_end_of_sweeps():
    sweep = {"base": "a", "compare_week": 26, "vary": {"thickness_mm": [1.0, 2.0]}}
    found = message(own_and_atlas(22, 24, 26), **EXPECTED, sweeps={"late": sweep})
    assert found == Facts("own22", 22, 26)


# ensembles


def test_the_age_of_a_member_stays_within_its_atlas(monkeypatch):
    monkeypatch.setattr(ensemble, "AGE_SD_GW", 2.0)
    run = {"preset": "expected", "ensemble": 6}
    # the start is a week before the atlas, which ends with the run
    found = study(own_and_atlas(21, 24, atlas=(22, 23, 24)), runs={"a": run})
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
def test_members_need_shapes_and_names_and_are_three_or_more(runs, facts):
    assert message(own_and_atlas(22, 24), runs=runs) == Facts(*facts)


# brains that are filled with labels


@cases(
    ("surfaces", "cortex", "similar"),
    """
    [own22] | measured | b22
    [b22, b23, b24, b25] | measured | own22
    [own22, b22, b23, b24, b25] | typical | null
    """,
)
def test_brains_without_labels_are_filled_with_their_own_cortex_or_a_similar_brain_s(
    surfaces, cortex, similar
):
    brains = own_and_atlas(22, atlas=(22, 23, 24, 25))
    as_surfaces = [entry for entry in brains if entry["id"] in surfaces]
    for entry in as_surfaces:
        del entry["labels"], entry["scheme"]
        entry["pial"] = __file__
    settings = EXPECTED | {"growth": {"matched_surfaces": False}}
    found = study(brains, **settings)
    assert found.chains["own22", "atlas"].weeks[1:] == (22, 23, 24)
    assert found.filled == [{"ids": surfaces, "cortex": cortex, "by_cortex": True}]
    assert {found.brains[name].thickness_of for name in surfaces} == {similar}
    filled = registered_source(found.config, found.brains[surfaces[0]])
    assert filled.path == f"results/brains/{surfaces[0]}/surface/filled.nii.gz"
    for entry in as_surfaces:
        entry["white"] = __file__
    assert [group["cortex"] for group in study(brains, **settings).filled] == ["white"]


def test_thickness_without_labels_is_that_of_another_brain_s_white_surfaces():
    bare = {"id": "bare", "week": 23, "pial": __file__}
    white = {"id": "white", "week": 23.1, "pial": __file__, "white": __file__}
    found = resolved([bare, white], start="bare").brains
    assert (found["bare"].thickness_of, found["white"].thickness_of) == ("white", None)


# predictions


def test_a_brain_is_predicted_where_no_later_brain_that_it_is_compared_with_was_read():
    runs = EXPECTED["runs"] | {"paper": {}} | {"m": {"preset": "measured"}}
    found = study(own_and_atlas(22, 23, 24), runs=runs)
    # a run that no brain tells of stands beside it, and one that later brains explain
    # does not
    predictions = [(one.run, one.is_atlas_prediction) for one in found.predictions]
    assert predictions == [("a", True), ("paper", False)]


def test_a_prediction_is_described_by_its_weeks_its_atlas_and_its_files():
    found = study(own_and_atlas(22.4), **EXPECTED, folding={"end_week": 23.9})
    at = "results/runs/a/own22.4/surfaces/week-23.90"
    described = found.prediction_facts
    assert described.pop("surfaces")[0] == f"{at}/fine/pial.surf.gii"
    assert described == {
        "run": "a",
        "brain": "own22.4",
        "start_week": 22.4,
        "week": 23.9,
        "atlas_brain": "b24",
        "atlas_week": 24,
        # a series of one's own is no atlas with a licence
        "population": "atlas",
        "atlas": None,
        "atlas_surface": f"{at}/atlas.pial.surf.gii",
        "labels": "results/export/sub-own224/anat/sub-own224_desc-agw2390_dseg.nii.gz",
    }
    (simulation,) = found.run_simulations
    # the brains that may have the age of a week, or the nearest one
    for week, near in ((23.9, ["b22", "b23", "b24", "b25"]), (30.0, ["b25"])):
        assert [b.id for b in found.atlas_brains_near(simulation, week)] == near


def test_no_prediction_is_explained_by_its_own_later_brains_or_one_of_several_runs():
    own = study(own_and_atlas(22, 23, 24), **MEASURED)
    assert own.prediction_facts is None
    # its growth is measured on the mesh's surface
    row = own.rows_of(own.run_simulations[0])[-1]
    assert own.measured_parts(row) == row.parts
    several = EXPECTED["runs"] | {"plain": {}}
    assert study(own_and_atlas(22), runs=several).prediction_facts is None
