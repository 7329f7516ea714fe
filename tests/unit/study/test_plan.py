"""What a study consists of, as it follows from its configuration."""

from itertools import pairwise
from pathlib import Path

import pytest
from configurations import LABELLED

from gyriflow.config import load
from gyriflow.errors import InputError
from gyriflow.io.yaml_files import read_yaml
from gyriflow.study import Plan, resolve
from gyriflow.study.figures import asked_for, figures_of
from gyriflow.study.paths import CURVES, FOLDING, MEASURES, PARAMETERS, READY, THICKNESS, job_files, one_of

CURVE = {21: 99, 24: 150}
SIZES = {"model": "sizes", "area_cm2": CURVE, "volume_ml": CURVE}


def brain(week, **given):
    return {"id": f"b{week}", "week": week, **(given or LABELLED)}


def labels(tmp_path, week, **given):
    (tmp_path / "labels.nii.gz").touch()
    return brain(week, labels=str(tmp_path / "labels.nii.gz"), scheme="feta-7", **given)


def plan(brains, **sections):
    return Plan(load({"brains": brains, "start": "first", "folding": {"end_week": 24}, **sections}))


def figures(found):
    return figures_of(resolve(found.config))


@pytest.fixture
def real(tmp_path):
    """Real brains of four weeks, of label volumes."""
    return [labels(tmp_path, week) for week in (21, 22, 23, 24)]


EXAMPLES = Path(__file__).parents[3] / "config" / "examples"


@pytest.mark.parametrize(
    "atlas",
    [
        [{"name": "dhcp-volume", "accept_licence": True}, {"name": "dhcp-surface"}],
        {"name": "crl", "accept_licence": True},
    ],
)
def test_the_paper_is_planned_of_another_atlas_by_one_line(atlas):
    paper = read_yaml(EXAMPLES / "paper.yaml")
    own, other = (Plan(load(paper | one, EXAMPLES)).runs for one in ({}, {"atlas": atlas}))
    assert (len(own.folded), len(own.members)) == (len(other.folded), len(other.members)) == (2, 10)


def test_the_paper_is_planned_with_the_paper_s_steps_and_ratios():
    config = load(read_yaml(EXAMPLES / "paper.yaml"), EXAMPLES)
    steps = {member.values["thickness_mm"]: member.settings.step_s for member in config.members["thickness"]}
    assert steps == {0.8: 86400, 1.5: 43200, 2.25: 86400, 6.0: 86400}
    stiffness = [member.settings for member in config.members["stiffness"]]
    ratios = [run.shear_modulus_cortex_pa / run.shear_modulus_core_pa for run in stiffness]
    assert (ratios[0], ratios[-1], {run.step_s for run in stiffness}) == (1, 20, {43200})


def test_runs_that_write_contact_pressure_have_a_figure_of_it():
    fields = {"fields": ["displacement", "contact_pressure"]}
    runs = {
        "pressed": fields,
        "between": fields | {"contact": {"kind": "planes"}},
        "plain": {"fields": ["displacement"]},
    }
    rows = figures(plan([brain(21), brain(22)], runs=runs))
    assert [row.names["run"] for row in rows if row.name == "contact_maps"] == ["pressed"]


def test_every_run_folds_its_starts():
    both = plan([brain(21), brain(22)], runs={"one": {}, "two": {"start": "all"}})
    assert both.runs.folded == [("one", "b21"), ("two", "b21"), ("two", "b22")]
    assert both.runs.of(PARAMETERS)[-1] == "results/runs/two/b22/params.yaml"
    assert both.runs.week_tags("two", "b22") == ["22.00", "23.00", "24.00"]


def test_a_start_is_carried_to_one_brain_a_week_up_to_the_first_past_the_end(real, tmp_path):
    twin = labels(tmp_path, 23, population=None) | {"id": "twin"}
    late = labels(tmp_path, 27), labels(tmp_path, 30)
    chains = plan([*real[:3], twin, *late], runs={"a": {"growth": "shapes"}}).chains
    assert chains.later("b21") == ["b21", "b22", "b23", "b27"]
    assert chains.later_weeks("b21") == [21, 22, 23, 27]
    assert chains.correspondences_later("b21")[0] == "results/study/registration/b21/b22.h5"
    assert chains.carried == ["b21"]


def test_surfaces_are_registered_by_a_mask(tmp_path):
    (tmp_path / "pial.gii").touch()
    given = brain(22, pial=str(tmp_path / "pial.gii"))
    found = plan([labels(tmp_path, 21), given])
    assert found.brains.registered_volume("b21") == str(tmp_path / "labels.nii.gz")
    assert found.brains.registered_volume("b22") == "results/brains/b22/surface/mask.nii.gz"
    assert [one["scheme"]["name"] for one in found.chains.registered("b21", "b22")] == ["feta-7", "binary"]


def test_one_brain_alone_has_no_growth_and_nothing_to_be_compared_with():
    alone = plan([brain(21)])
    assert alone.chains.series == alone.measuring.comparisons == alone.validating.pairs == []
    assert alone.measuring.tables["similarity"] == []


def test_measured_growth_is_waited_for_by_the_runs_that_use_it(real):
    runs = {
        "plain": {},
        "given": {"growth": SIZES},
        "measured": {"growth": SIZES | {"volume_ml": "measured"}},
    }
    found = plan(real, runs=runs).runs
    assert [found.curves(run) for run in runs] == [[], [], CURVES["curves"]]
    assert [found.estimated_from(run, "b21") for run in runs] == [None, None, "volume"]


def test_maps_are_made_for_the_runs_that_have_any(tmp_path):
    for name in ("left.gii", "right.gii", "soft.nii.gz"):
        (tmp_path / name).touch()
    pair = [str(tmp_path / "left.gii"), str(tmp_path / "right.gii")]
    soft = {"shear_modulus_core_pa": {"map": str(tmp_path / "soft.nii.gz")}}
    runs = {
        "plain": {},
        "thick": {"thickness_mm": {"map": pair, "surface": pair}},
        "soft": soft,
        "local": {"growth": "shapes"},
    }
    search = {"base": "soft", "parameters": {"thickness_mm": [1, 3]}, "score": {"size": 1}, "compare_week": 24}
    found = plan([labels(tmp_path, 21), labels(tmp_path, 24)], runs=runs, calibrate=search).runs
    assert found.with_maps == ["thick", "soft", "local"]
    assert found.map_files("thick") == [*pair, *pair]
    assert found.maps("plain", "b21") == []
    # runs of the calibration have the maps of its base
    assert found.maps("calibration-00", "b21") == "results/runs/soft/b21/folding/maps.h5"


def test_later_scans_of_the_subject_come_first(tmp_path):
    start = labels(tmp_path, 21, subject="s")
    others = [labels(tmp_path, 22) | {"id": "other"}, labels(tmp_path, 22, subject="s") | {"id": "own"}]
    found = plan([start, *others])
    assert found.measuring.after_start("reference", "b21") == {"22.00": ["own", "other"]}
    assert found.validating.compared("reference", "b21") == {"22.00": "own"}


def test_runs_are_compared_with_the_population_and_the_sides_of_their_start_only(tmp_path):
    (tmp_path / "left.nii.gz").touch()
    half = {"hemisphere": {"file": str(tmp_path / "left.nii.gz"), "side": "left"}, "scheme": "binary"}
    brains = [
        labels(tmp_path, 21, population="well"),
        labels(tmp_path, 22, population="ill") | {"id": "ill"},
        labels(tmp_path, 22, population="well"),
        brain(22, **half, population="well") | {"id": "half"},
    ]
    found = plan(brains)
    assert found.measuring.comparisons == [("reference", "b21", "22.00", "b22")]
    assert found.validating.real_surface("b21", "22.00") == "results/brains/b22/surface/pial.surf.gii"
    assert found.validating.adjacent_surface("b21", "22.00") == "results/brains/b21/surface/pial.surf.gii"
    assert found.brains.with_sides("left") == ["half"]
    assert found.measuring.of_sides("left") == ["brains/half/metrics"]


def test_synthetic_brains_are_measured_beside_each_other_but_tell_nothing_of_worth():
    shape = {"shape": {"semi_axes_mm": [23, 23, 23]}}
    found = plan([brain(21, **shape), brain(22, **shape)])
    assert found.measuring.beside("reference", "b21") == {"21.00": "b21", "22.00": "b22"}
    assert found.validating.compared("reference", "b21") == {}


def test_a_week_is_explained_by_growth_that_knows_it_and_else_predicted(real):
    runs = {
        "plain": {},
        "given": {"growth": SIZES},
        "sizes": {"growth": "sizes"},
        "shapes": {"growth": "shapes"},
    }
    kinds = plan(real, runs=runs).validating.kinds
    assert {run: list(kinds(run, "b21").values()) for run in runs} == {
        "plain": ["predicted"] * 3,
        "given": ["predicted"] * 3,
        "sizes": ["explained"] * 3,
        "shapes": ["explained"] * 3,
    }


def test_displacements_are_a_consistency_check_where_growth_is_of_the_same_registration(real):
    runs = {
        "plain": {},
        "uniform": {"growth": SIZES},
        "closed": {"preset": "measured"},
    }
    registered = plan(real, runs=runs).validating.registered
    assert [registered(run, "b21") for run in runs] == [False, False, True]


def test_tables_of_validation_are_joined_from_the_runs_that_are_compared(real):
    tables = plan(real, runs={"a": {}, "late": {"start": "b24", "end_week": 26}}).validating.tables
    assert tables["validation"] == ["results/runs/a/b21/metrics/validation.csv"]
    assert tables["onset"] == ["results/runs/a/b21/metrics/onset.csv"]
    assert tables["registration_ceiling"] == ["results/study/validation/b21/registration.csv"]


def test_what_registration_alone_is_worth_is_asked_at_compared_weeks(real):
    validating = plan(real, folding={"end_week": 24, "output_every_gw": 2}).validating
    assert validating.ceiling_weeks("b21") == [23, 24]
    assert validating.ceiling("b21")["real"] == [
        READY["real"].format(brain="b21", week=week) for week in ("23.00", "24.00")
    ]


def test_a_study_is_compared_at_its_week_and_its_members_are_measured_there(real):
    study = {"base": "reference", "vary": {"thickness_mm": [1.0, 2.0]}, "compare_week": 23}
    found = plan(real, runs={"reference": {"thickness_mm": 1.0}}, studies={"thick": study})
    # the run that is equal to the reference is that one
    assert found.studying.members("thick") == [("reference", "b21"), ("thick-2", "b21")]
    assert found.runs.members == ["thick-2"]
    assert found.studying.inputs("thick")["summaries"] == [
        FOLDING["summary"].format(run=run, brain="b21") for run in ("reference", "thick-2")
    ]
    place = found.measuring.at("runs/thick-2/b21/metrics/week-23.00")
    assert place.labels == {"subject": "b21", "run": "thick-2", "week": 23}
    assert place.thickness == "results/runs/thick-2/b21/surfaces/week-23.00/thickness.shape.gii"
    assert place not in found.measuring.every
    tables = found.studying.tables("thick", "thick-2", "b21")
    own, of_real = MEASURES["metrics"].format(where=place.where), "results/brains/b23/metrics/metrics.csv"
    assert tables["metrics"] == [own, of_real]
    assert found.studying.populations("thick", "b21") == {"b23": "unknown"}


def test_rounds_of_a_calibration_wait_for_the_scores_of_earlier_ones(real):
    rounds = {"first_runs": 3, "rounds": 1, "runs_per_round": 1}
    search = {"base": "reference", "parameters": {"thickness_mm": [1, 3]}, "score": {"size": 1}, "compare_week": 24}
    calibrating = plan(real, calibrate=search | rounds).calibrating
    assert calibrating.of_round(1) == ["calibration-03"]
    assert calibrating.scores_before(0) == []
    assert calibrating.scores_before(1)[-1] == "results/study/calibration/scores/calibration-02.csv"
    assert calibrating.design("calibration-03") == "results/study/calibration/round-1.csv"
    assert calibrating.real == {"b21": ["results/brains/b24/surface/pial.surf.gii"]}


def test_regions_are_those_of_the_nearest_brain_that_has_any(tmp_path):
    (tmp_path / "regions.nii.gz").touch()
    given = {"b21": {"volume": str(tmp_path / "regions.nii.gz"), "names": {1: "frontal"}}}
    shape = brain(22, shape={"semi_axes_mm": [20, 20, 20]}) | {"id": "sphere"}
    found = plan([labels(tmp_path, 21), labels(tmp_path, 22), shape], metrics={"regions": given})
    assert (found.measuring.regioned, found.measuring.given) == (["b21", "b22"], ["b21"])
    assert found.chains.given_regions("b22") == {
        **{f"{side}_regions": f"results/brains/b21/metrics/{side}.regions.label.gii" for side in ("left", "right")},
        **{f"given_{side}": f"results/brains/b21/surface/{side}.pial.surf.gii" for side in ("left", "right")},
        "given_report": "results/brains/b21/surface/surface.json",
        "correspondence": "results/study/registration/b21/b22.h5",
    }
    assert found.measuring.named == []
    # those of a run hold at all its weeks
    regions = found.measuring.at("runs/reference/b21/metrics/week-22.00").regions
    assert regions["left_regions"] == "results/runs/reference/b21/metrics/left.regions.label.gii"


def test_thickness_is_known_of_labels_of_the_cortex(tmp_path):
    brains = [labels(tmp_path, 21), labels(tmp_path, 22, population=None) | {"scheme": "binary"}]
    found = plan(brains)
    assert found.brains.with_thickness == ["b21"]
    known, unknown = (found.measuring.at(f"brains/{name}/metrics").thickness for name in ("b21", "b22"))
    assert (known, unknown) == (THICKNESS["measured"].format(brain="b21"), [])


def test_maps_are_brought_to_a_template_that_is_there(tmp_path):
    found = plan([labels(tmp_path, 21), labels(tmp_path, 22)], metrics={"template": "b22"})
    files = found.measuring.template_files("runs/reference/b21/metrics/week-24.00", "left")
    # a simulated brain keeps the vertices of its start
    assert files["surface"] == "results/runs/reference/b21/surfaces/week-21.00/left.pial.surf.gii"
    assert files["template"] == "results/brains/b22/surface/left.pial.surf.gii"
    assert found.chains.to_template("b21") == ["results/study/registration/b22/b21.h5"]
    assert found.chains.to_template("b22") == []
    assert {len(one["template_maps"]) for one in found.measuring.exported} == {2}
    # a template that was refused holds up nothing
    without = Plan(found.config.without(["b22"]))
    assert [one["template_maps"] for one in without.measuring.exported if one["run"] == "real"] == [{}]
    with pytest.raises(InputError, match=r"metrics.template"):
        plan([labels(tmp_path, 21)], metrics={"template": "b23"})


def test_white_surfaces_of_labels_are_measured_where_they_are_asked_for(tmp_path):
    brains = [labels(tmp_path, 21), labels(tmp_path, 22) | {"scheme": "binary"}]
    given = [plan(brains, metrics={"white_surfaces": which}).measuring for which in ("given", "all")]
    assert [[path for path in one.tables["metrics"] if "white" in path] for one in given] == [
        [],
        ["results/brains/b21/metrics/white.csv"],
    ]
    assert given[1].white_source("b21") == {"labels": str(tmp_path / "labels.nii.gz")}
    assert [sorted(one["white"]) for one in given[1].exported[:2]] == [["left", "right"], []]


@pytest.mark.parametrize(
    ("output", "log"),
    [
        ("results/brains/{brain}/mesh/brain.xdmf", "results/brains/{brain}/logs/r.log"),
        ("results/runs/{run}/{brain}/a/week-{week}/b.stl", "results/runs/{run}/{brain}/logs/r.week-{week}.log"),
        ("results/{where}/metrics.csv", "results/{where}/logs/r.log"),
        ("results/study/{table}.csv", "results/study/logs/r.{table}.log"),
        ("results/study/{study}/members/{run}/{brain}.csv", "results/study/{study}/logs/r.{run}.{brain}.log"),
        ("results/study/calibration/round-{round}.csv", "results/study/calibration/logs/r.{round}.log"),
        ("results/study/matched/{earlier}/{later}.h5", "results/study/logs/r.{earlier}.{later}.log"),
        ("results/report/report.html", "results/report/logs/r.log"),
        ("results/export", "results/study/logs/r.log"),
    ],
)
def test_logs_and_benchmarks_lie_beside_results_and_name_all_wildcards(output, log):
    assert job_files("r", output) == (log, log.replace("logs", "benchmarks").replace(".log", ".tsv"))


def test_a_pattern_of_no_names_matches_nothing():
    assert one_of(["a.b", "c"]) == r"a\.b|c"
    assert one_of([]) == r"(?!)"


EXPECTED = {"runs": {"a": {"preset": "expected"}}}


def of_two(tmp_path, *own_weeks, atlas=(21, 22, 23, 24, 25), population="own"):
    """Returns brains of a population, the first of which is to start, and those of an atlas."""
    own = [labels(tmp_path, week, population=population) | {"id": f"own{week}"} for week in own_weeks]
    return [*own, *(labels(tmp_path, week, population="atlas") for week in atlas)]


@pytest.mark.parametrize(
    ("week", "weeks", "chain"),
    [
        (22.4, (21, 22, 23, 24, 25), ["b22", "b23", "b24"]),
        (22, (21, 22, 23, 24, 25), ["b22", "b23", "b24"]),
        (20.5, (21, 22, 25), ["b21", "b22", "b25"]),
        (22.4, (21, 23.5, 24.5, 26), ["b21", "b23.5", "b24.5"]),
    ],
)
def test_a_brain_is_expected_from_the_atlas_week_before_it_to_the_first_past_the_end(tmp_path, week, weeks, chain):
    found = plan(of_two(tmp_path, week, atlas=weeks), **EXPECTED).expecting
    start = f"own{week}"
    assert found.chain(start, "atlas") == [start, *chain]
    assert found.weeks(start, "atlas") == [float(name[1:]) for name in chain]
    files = [f"results/study/registration/{one}/{two}.h5" for one, two in pairwise([start, *chain])]
    assert found.correspondences(start, "atlas") == files
    assert found.targets("a", start) == f"results/brains/{start}/mesh/targets.atlas.h5"


def test_a_closed_loop_of_its_own_goes_through_the_later_brains_of_its_series(real):
    runs = {"open": {"growth": SIZES}, "own": {"preset": "measured"}}
    found = plan(real, runs=runs)
    assert found.expecting.chain("b21", "self") == ["b21", "b22", "b23", "b24"]
    assert [found.expecting.targets(run, "b21") for run in runs] == [[], "results/brains/b21/mesh/targets.self.h5"]
    assert set(found.validating.kinds("own", "b21").values()) == {"explained"}
    assert found.validating.foretold == found.validating.tables["prediction"] == []
    assert "results/study/figures/prediction.png" not in asked_for(figures(found), "validate")
    # sizes come from the shapes, and growth from no carried mesh
    assert found.runs.curves("own") == []


def unled(found):
    """Returns what is said of the start brains that no brains lead to the end of a run."""
    return {brain: str(error) for brain, error in found.expecting.unled().items()}


def test_a_brain_is_expected_by_one_series_of_another_population_that_reaches_the_end(tmp_path):
    third = [labels(tmp_path, week, population="third") | {"id": f"third{week}"} for week in (22, 24)]
    both = [*of_two(tmp_path, 22), *third]
    for brains, found in (
        (of_two(tmp_path, 22, 24, atlas=()), "none; the growth series are volume"),
        (of_two(tmp_path, 22, atlas=(21, 23)), "own22 (22 GW), b21 (21 GW), b23 (23 GW)"),
        # more than a week before the first brain of the atlas
        (of_two(tmp_path, 22, atlas=(23.5, 24)), "own22 (22 GW), b23.5 (23.5 GW), b24 (24 GW)"),
        (both, "several series: atlas, third"),
    ):
        said = unled(plan(brains, **EXPECTED))["own22"]
        assert f"found {found}; expected brains of one series of another population" in said
        assert "from 22 to 24 GW" in said
    named = plan(both, growth={"estimated_from": "third"}, **EXPECTED)
    assert unled(named) == {}
    assert named.expecting.chain("own22", "atlas") == ["own22", "third22", "third24"]


def test_a_start_before_all_weeks_of_the_atlas_is_led_by_two(tmp_path):
    found = plan(of_two(tmp_path, 20.5), folding={"end_week": 21}, **EXPECTED)
    assert found.expecting.chain("own20.5", "atlas") == ["own20.5", "b21", "b22"]


def test_its_own_growth_is_that_of_the_series_with_the_start_whatever_is_named(tmp_path):
    brains, own = of_two(tmp_path, 22, 23, 24), {"runs": {"a": {"preset": "measured"}}}
    found = plan(brains, growth={"estimated_from": "atlas"}, **own)
    assert found.expecting.chain("own22", "self") == ["own22", "own23", "own24"]
    assert found.chains.carried == ["own22"]
    assert unled(found) == {}
    alone = unled(plan(of_two(tmp_path, 22), growth={"estimated_from": "atlas"}, **own))["own22"]
    assert "found none; the growth series are atlas" in alone
    assert "Add later brains to its series (growth.brains)" in alone
    early = unled(plan(of_two(tmp_path, 22, 23), **own))["own22"]
    assert "found own22 (22 GW), own23 (23 GW); expected brains of the start's own growth series" in early


@pytest.mark.parametrize("preset", ["measured", "expected"])
def test_runs_of_studies_and_of_the_calibration_are_led_to_their_own_end(tmp_path, preset):
    runs, brains = {"runs": {"a": {"preset": preset}}}, of_two(tmp_path, 22, 24, 26)
    later = {"base": "a", "compare_week": 26}
    study = {"studies": {"late": later | {"vary": {"thickness_mm": [1.0, 2.0]}}}}
    search = {"calibrate": later | {"parameters": {"thickness_mm": [1, 3]}, "score": {"size": 1}}}
    assert unled(plan(brains, **runs)) == {}
    whose = "self" if preset == "measured" else "atlas"
    for more in (study, search):
        assert plan(brains, **runs, **more).config.last_week("own22") == 26
        assert plan(brains, **runs, **more).expecting.weeks("own22", "self")[-1] == 26
        if whose == "atlas":
            # its atlas ends at 25 GW
            assert "from 22 to 26 GW" in unled(plan(brains, **runs, **more))["own22"]


def test_a_refused_brain_leaves_the_others_as_they_are(tmp_path):
    runs = {"a": {"preset": "expected"}, "first": {"start": "first", "end_week": 23}}
    config = plan(of_two(tmp_path, 22, 23), start=["own22", "own23"], runs=runs).config
    assert unled(Plan(config)) == {}
    # no other brain is folded in its place
    assert Plan(config.without(["own22"])).runs.folded == [("a", "own23")]
    # without the end of the atlas one run has nowhere to go, which is no matter of the other
    refused = Plan(config.without(["b24", "b25"]))
    assert set(unled(refused)) == {"own22", "own23"}
    left = Plan(config.without(["b24", "b25"], unfolded=["own23"]))
    assert left.runs.folded == [("a", "own22"), ("first", "own22")]
    assert left.config.brain("own23").week == 23


def test_what_is_expected_is_compared_in_the_weeks_of_its_later_brains(tmp_path):
    own = (22.4, 23, 23.4, 23.7, 23.701, 26)
    found = plan(of_two(tmp_path, *own), **EXPECTED)
    assert found.config.weeks("a", "own22.4") == pytest.approx([22.4, 23, 23.4, 23.701, 24])
    assert found.expecting.weeks("own22.4", "atlas") == [22, 23, 24]
    assert found.expecting.further_weeks("own22.4", "atlas") == [23.4, 23.701]
    assert found.expecting.further_weeks("own22.4", "self") == []
    assert found.validating.compared("a", "own22.4") == {"23.00": "own23", "23.40": "own23.4", "23.70": "own23.7"}
    files = found.validating.prediction("a", "own22.4")
    assert [len(files[name]) for name in ("simulated", "real", "whole", "atlas")] == [3, 3, 3, 3]
    # so are runs beside it; others keep the weeks that are asked for
    beside = plan(of_two(tmp_path, *own), runs=EXPECTED["runs"] | {"plain": {}})
    assert beside.config.weeks("plain", "own22.4") == found.config.weeks("a", "own22.4")
    assert beside.validating.foretold == [("a", "own22.4"), ("plain", "own22.4")]
    assert plan(of_two(tmp_path, *own)).config.weeks("reference", "own22.4") == [22.4, 23.4, 24]


def test_brains_correspond_in_their_poses_by_masks_and_else_in_the_worlds_of_their_files(tmp_path):
    (tmp_path / "pial.gii").touch()
    (tmp_path / "labels.nii.gz").touch()
    surface = {"pial": str(tmp_path / "pial.gii"), "population": "own"}
    start = brain(22, **surface) | {"id": "own22"}
    found = plan([start, *of_two(tmp_path)], **EXPECTED)
    assert found.expecting.posed("own22", "atlas") == [[True, False], [False, False], [False, False]]
    # matched vertices say where they are in the world
    matched = [brain(week, pial=str(tmp_path / "pial.gii"), population="atlas") for week in (22, 24)]
    mixed = plan([labels(tmp_path, 22, population="own") | {"id": "own22"}, *matched], **EXPECTED)
    object.__setattr__(mixed.chains, "matched_series", {"atlas": {"b22", "b24"}})
    assert mixed.expecting.posed("own22", "atlas") == [[False, True], [False, False]]


def test_a_brain_is_predicted_where_no_later_brain_that_it_is_compared_with_was_read(tmp_path):
    found = plan(of_two(tmp_path, 22, 23, 24), **EXPECTED)
    assert found.expecting.reads_only_others("own22")
    assert found.validating.kinds("a", "own22") == {23.0: "predicted", 24.0: "predicted"}
    assert found.validating.foretold == [("a", "own22")]
    assert found.validating.prediction("a", "own22")["atlas"] == [
        f"results/brains/b{week}/surface/pial.surf.gii" for week in (22, 23, 24)
    ]
    assert "results/study/figures/prediction.png" in asked_for(figures(found), "validate")
    # a run that no brain tells of stands beside it, and one that later brains explain does not
    runs = {"a": EXPECTED["runs"]["a"], "paper": {}, "measured": {"preset": "measured"}}
    beside = plan(of_two(tmp_path, 22, 23, 24), runs=runs).validating
    assert beside.foretold == [("a", "own22"), ("paper", "own22")]
    assert [beside.predicts(run, "own22") for run in ("a", "paper")] == [True, False]
    # of unknown population, it is compared with the brains that its growth comes from
    unknown = plan(of_two(tmp_path, 22, population=None), **EXPECTED)
    assert not unknown.expecting.reads_only_others("own22")
    assert set(unknown.validating.kinds("a", "own22").values()) == {"explained"}
    # a later scan of the same subject is its own, whatever it is called
    scans = [brain | ({"subject": "s"} if brain["id"] in ("own22", "b24") else {}) for brain in of_two(tmp_path, 22)]
    assert not plan(scans, **EXPECTED).expecting.reads_only_others("own22")


def test_what_real_brains_are_compared_with_is_what_was_expected_of_them_at_their_age(tmp_path):
    scans = of_two(tmp_path, 22, 23, 24)
    scans[0]["subject"] = scans[2]["subject"] = "s"
    found = plan(scans, **EXPECTED)
    files = found.validating.deviation("a", "own22", "24.00")
    assert files["expected"] == "results/runs/a/own22/surfaces/week-24.00/pial.surf.gii"
    assert files["real"] == "results/brains/own24/surface/pial.surf.gii"
    places = [path.split("/")[-2] for path in files["thickness"]]
    assert places == ["surface", "week-22.00", "week-24.00", "surface"]
    subjects = [found.validating.deviating("a", "own22", week)["subject"] for week in ("23.00", "24.00")]
    assert subjects == ["own23", "s"]
    assert len(found.validating.tables["deviation"]) == 2
    names = ("expected", "deviation_log_area", "deviation_thickness_difference_mm")
    assert {f"results/runs/a/own22/figures/{name}.png" for name in names} <= {*asked_for(figures(found), "validate")}
    # whose growth is its own explains
    own = plan(of_two(tmp_path, 22, 23, atlas=()), runs={"a": {"preset": "measured"}}, folding={"end_week": 23})
    assert own.validating.tables["deviation"] == []


def test_of_many_weeks_every_other_one_is_shown_with_the_start_and_the_last(tmp_path):
    weeks = tuple(range(22, 31))
    found = plan(of_two(tmp_path, *weeks, atlas=weeks), folding={"end_week": 30}, **EXPECTED)
    (shown,) = [row for row in figures(found) if row.name == "expected_figure"]
    brains = shown.inputs
    assert list(brains["real"]) == list(brains["runs"]["expected"]) == [22, 24, 26, 28, 30]
    assert sorted(brains["deviations"]) == [24, 26, 28, 30]


def test_named_sulci_are_those_of_real_whole_brains_and_name_what_begins(tmp_path, real):
    shape = brain(22, shape={"semi_axes_mm": [20, 20, 20]}) | {"id": "sphere"}
    found = plan([*real, shape])
    last = found.chains.later("b21")[-1]
    assert last in found.measuring.named
    assert "sphere" not in found.measuring.named
    assert found.measuring.regioned == []
    assert found.validating.onset("reference", "b21")["left_regions"] == (
        f"results/brains/{last}/metrics/left.regions.label.gii"
    )
    assert found.chains.named("b21")["posed"] is False
    everywhere = plan([*real, shape], metrics={"named_sulci": True}).measuring
    assert everywhere.regioned == everywhere.named == found.measuring.named
    assert everywhere.given == []
