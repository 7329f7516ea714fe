"""A study resolved from its configuration: which brains, weeks and files stand behind
each run and comparison."""

from pathlib import Path

import pytest
from configurations import both_kinds, resolved, touched
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
CURVE = {21: 99, 24: 150}
SIZES = {"model": "sizes", "area_cm2": CURVE, "volume_ml": CURVE}
SPHERE = {"shape": {}}
EXPECTED = {"runs": {"a": {"preset": "expected"}}}


@pytest.fixture
def files(tmp_path):
    for name in (
        "labels.nii.gz",
        "left.gii",
        "right.gii",
        "pial.gii",
        "white.gii",
        "map.nii.gz",
    ):
        (tmp_path / name).touch()
    return tmp_path


@pytest.fixture
def labels(files):
    """What gives a brain of a week from a label volume."""
    given = {"labels": str(files / "labels.nii.gz"), "scheme": "feta-7"}
    return lambda week, **more: {"id": f"b{week}", "week": week, **given, **more}


@pytest.fixture
def real(labels):
    """Brains of four weeks, from label volumes."""
    return [labels(week) for week in (21, 22, 23, 24)]


@pytest.fixture
def of_two(labels):
    """What gives brains of a population, the first of which is to start, and those of
    an atlas."""

    def brains(*weeks, atlas=(21, 22, 23, 24, 25), population="own"):
        own = [labels(week, id=f"own{week}", population=population) for week in weeks]
        return [*own, *(labels(week, population="atlas") for week in atlas)]

    return brains


def study(brains, refused=(), **sections):
    return resolved(brains, refused, **{"start": "first", **sections})


def refusal(brains, **sections):
    with pytest.raises(InputError) as error:
        study(brains, **sections)
    return str(error.value)


# what is folded


def test_the_paper_is_planned_with_the_paper_s_steps_and_ratios():
    found = resolve(load(read_yaml(EXAMPLES / "paper.yaml"), EXAMPLES))
    members = {}
    for name, rows in found.by_sweep.items():
        members[name] = [
            (row.values, found.simulations[row.run, row.brain].settings) for row in rows
        ]
    steps = {values["thickness_mm"]: run.step_s for values, run in members["thickness"]}
    assert steps == {0.8: 86400, 1.5: 43200, 2.25: 86400, 6.0: 86400}
    ratios = [
        run.shear_modulus_cortex_pa / run.shear_modulus_core_pa
        for _, run in members["stiffness"]
    ]
    assert (ratios[0], ratios[-1], {run.step_s for _, run in members["stiffness"]}) == (
        1,
        20,
        {43200},
    )


# brains that were refused


def test_refused_brains_leave_studies_and_comparisons_too(real, files):
    varied = {
        "base": "reference",
        "vary": {"thickness_mm": [1.0, 2.0]},
        "compare_week": 24,
    }
    regions = {"b23": {"labels": str(files / "map.nii.gz"), "names": {1: "frontal"}}}
    twin = real[3] | {"id": "twin"}
    asked = {
        "sweeps": {"thick": varied, "one": varied | {"base": "late"}},
        "runs": {
            "reference": {"start": ["b21", "b22"]},
            "late": {"start": "b22", "poisson_ratio": 0.3},
        },
        "metrics": {
            "regions": regions,
            "template": "b23",
            "norm_reference": ["b21", "b22"],
        },
    }
    found = study([*real, twin], ["b22", "b23", "b24"], **asked)
    # a study none of whose runs has a start is none
    assert {
        name: [row.brain for row in rows] for name, rows in found.by_sweep.items()
    } == {"thick": ["b21", "b21"]}
    assert found.by_sweep["thick"][0].observed == ("twin",)
    simulation = found.simulations["reference", "b21"]
    assert found.observed(simulation) == {24: found.brains["twin"]}
    assert (found.norm_reference, found.brains["b21"].regions_of) == (["b21"], None)
    # maps are brought to a template that is there
    in_both = study(real[:3], metrics={"template": "b23"}), found
    assert [{len(row.template_maps) for row in one.exported} for one in in_both] == [
        {2},
        {0},
    ]
    # nothing is left where no start is
    search = {
        "base": "reference",
        "parameters": {"thickness_mm": [1, 3]},
        "score": {"size": 1},
        "compare_week": 24,
    }
    empty = study(real, ["b21"], sweeps={"thick": varied}, calibrate=search)
    assert empty.run_simulations == empty.norm_reference == [] == list(empty.sweeps)
    assert empty.calibration == {}


# which real brains a run is compared with


def cohort(labels):
    scans = [("a", 22), ("a", 26), ("b", 24), ("b", 27), ("c", 25)]
    return [
        labels(week, id=f"{subject}{week}", subject=subject) for subject, week in scans
    ]


MEASURED = {
    "runs": {"m": {"preset": "measured"}},
    "folding": {"end_week": 27},
    "start": ["a22", "b24"],
}


# the brains behind a run's growth


@pytest.mark.parametrize(
    ("week", "weeks", "chain"),
    [
        (22.4, (21, 22, 23, 24, 25), ["b22", "b23", "b24"]),
        (22, (21, 22, 23, 24, 25), ["b22", "b23", "b24"]),
        (20.5, (21, 22, 25), ["b21", "b22", "b25"]),
        (22.4, (21, 23.5, 24.5, 26), ["b21", "b23.5", "b24.5"]),
    ],
)
def test_a_brain_is_expected_from_the_atlas_week_before_it_to_the_first_past_the_end(
    of_two, week, weeks, chain
):
    start = f"own{week}"
    found = study(of_two(week, atlas=weeks), **EXPECTED)
    along = found.chains[start, "atlas"]
    assert along.brains == (start, *chain)
    assert along.links == (f"results/study/registration/{start}/{chain[0]}.h5",)
    # the path is that of the whole atlas, whatever the start and the end
    path = tuple(f"b{week:g}" for week in weeks)
    assert found.paths[along.path].brains == path
    targets = f"results/brains/{start}/mesh/targets.atlas.h5"
    assert found.simulations["a", start].targets == targets


def test_a_brain_is_expected_by_one_series_of_another_population_that_reaches_the_end(
    of_two, labels
):
    both = [
        *of_two(22),
        *(labels(week, population="third", id=f"third{week}") for week in (22, 24)),
    ]
    for brains, found in (
        (of_two(22, 24, atlas=()), ["volume"]),
        (of_two(22, atlas=(21, 23)), ["own22 (22 GW)", "b21 (21 GW)", "b23 (23 GW)"]),
        # more than a week before the first brain of the atlas
        (
            of_two(22, atlas=(23.5, 24)),
            ["own22 (22 GW)", "b23.5 (23.5 GW)", "b24 (24 GW)"],
        ),
        (both, ["atlas, third"]),
    ):
        assert refusal(brains, **EXPECTED) == Facts(
            "own22", 22, 24, "growth.series", *found
        )
    named = study(both, growth={"series": "third"}, **EXPECTED)
    assert named.chains["own22", "atlas"].later == ("third22", "third24")


def test_members_of_an_ensemble_have_ages_of_their_own_in_each_study_the_same(of_two):
    chains = []
    for _ in range(2):
        runs = {"a": {"preset": "expected", "ensemble": 4}}
        found = study(of_two(22, 24), runs=runs)
        chains.append([chain for chain in found.chains.values() if chain.variation])
    assert chains[0] == chains[1]
    shifts = [chain.variation.age_shift_gw for chain in chains[0]]
    assert len(set(shifts)) == 4
    assert all(abs(shift) < 1.2 for shift in shifts)


def test_scans_of_other_subjects_are_grown_towards_only_if_they_are_named(labels):
    with pytest.raises(InputError, check=Facts("m", "c25", "a, b", 25, 27)):
        study(cohort(labels), **MEASURED | {"start": "c25"})
    # a list of brains is no chain
    growth = {"growth": {"brains": ["a22", "b24", "b27"]}}
    own = study(cohort(labels), **growth, **MEASURED | {"start": "b24"})
    assert own.growth_brains
    with pytest.raises(InputError, check=Facts("m", "a22", "b", 22, 27)):
        study(cohort(labels), **growth, **MEASURED | {"start": "a22"})


def test_surfaces_are_registered_by_labels_that_they_are_filled_with(of_two, files):
    pial = str(files / "pial.gii")
    found = study([{"id": "own22", "week": 22, "pial": pial}, *of_two()])
    filled = registered_source(found.config, found.brains["own22"])
    assert filled.path == "results/brains/own22/surface/filled.nii.gz"
    assert filled.scheme.cortex
    labels = registered_source(found.config, found.brains["b21"])
    assert labels.path == str(files / "labels.nii.gz")


def test_the_age_of_a_member_stays_within_its_atlas(of_two, monkeypatch):
    monkeypatch.setattr(ensemble, "AGE_SD_GW", 2.0)
    run = {"preset": "expected", "ensemble": 6}
    # the start is a week before the atlas, which ends with the run
    found = study(of_two(21, 24, atlas=(22, 23, 24)), runs={"a": run})
    chains = [
        found.chains["own21", f"atlas.a-member-{number}"] for number in range(1, 7)
    ]
    shifts = [chain.variation.age_shift_gw for chain in chains]
    assert (min(shifts), max(shifts)) == (0.0, 0.5)
    assert all(len(chain.later) > 1 for chain in chains)


def test_members_that_would_be_equal_are_refused(tmp_path):
    raw = both_kinds(touched(tmp_path), (21, 22)) | {
        "runs": {"a": {"growth": "shapes", "ensemble": 3}}
    }
    write_surface(tmp_path / "pial.surf.gii", sphere(30.0, 2))
    with pytest.raises(
        InputError, check=Facts("s21", "ensemble", "growth.matched_surfaces")
    ):
        resolve(load(raw | {"folding": {"end_week": 22}}, tmp_path))
    # whatever the weeks of another run
    further = both_kinds(tmp_path, (21, 22, 23)) | {
        "runs": raw["runs"] | {"b": {"growth": "shapes", "end_week": 23}}
    }
    with pytest.raises(
        InputError, check=Facts("s21", "ensemble", "growth.matched_surfaces")
    ):
        resolve(load(further | {"folding": {"end_week": 22}}, tmp_path))


def test_members_need_shapes_and_names_and_are_three_or_more(real):
    assert refusal(real, runs={"a": {"ensemble": 3}}) == Facts(
        "runs.a.ensemble", "rates", "shapes"
    )
    taken = {"a": {"growth": "shapes", "ensemble": 3}, "a-member-2": {}}
    assert refusal(real, runs=taken) == Facts("runs.a-member-2", "ensemble of a")
    assert refusal(real, runs={"a": {"growth": "shapes", "ensemble": 2}}) == Facts(
        "runs.a.ensemble", 2, 3
    )


def test_its_own_growth_is_that_of_the_series_with_the_start_whatever_is_named(of_two):
    named = {"growth": {"series": "atlas"}, "runs": {"a": {"preset": "measured"}}}
    found = study(of_two(22, 23, 24), **named)
    assert found.chains["own22", "self"].later == ("own23", "own24")
    assert refusal(of_two(22), **named) == Facts("atlas", 22, 24, "growth.brains")
    early = refusal(of_two(22, 23), runs=named["runs"])
    assert early == Facts("own22 (22 GW)", "own23 (23 GW)", 24, "growth.brains")


@pytest.mark.parametrize("preset", ["measured", "expected"])
def test_runs_of_sweeps_and_of_the_calibration_grow_until_their_own_end(of_two, preset):
    runs, later = {"runs": {"a": {"preset": preset}}}, {"base": "a", "compare_week": 26}
    varied = {"sweeps": {"late": later | {"vary": {"thickness_mm": [1.0, 2.0]}}}}
    search = {
        "calibrate": (
            later | {"parameters": {"thickness_mm": [1, 3]}, "score": {"size": 1}}
        )
    }
    for more in (varied, search):
        if preset == "measured":
            found = study(of_two(22, 24, 26), **runs, **more)
            assert found.chains["own22", "self"].weeks[1:] == (24, 26)
        else:
            # the atlas ends at 25 GW
            assert refusal(of_two(22, 24, 26), **runs, **more) == Facts("own22", 22, 26)


def test_a_brain_of_the_last_week_is_one_that_is_compared(of_two):
    # between two weeks of the atlas
    found = study(
        of_two(22, 22.7, 23.6),
        runs={"a": EXPECTED["runs"]["a"]},
        folding={"end_week": 23.6},
    )
    assert found.chains["own22", "atlas"].further_weeks == (22.7, 23.6)


@pytest.mark.parametrize("surfaces", ["start", "atlas", "both"])
def test_brains_without_labels_are_filled_with_their_own_cortex_or_a_similar_brain_s(
    of_two, files, surfaces
):
    names = {
        "start": ["own22"],
        "atlas": ["b22", "b23", "b24", "b25"],
        "both": ["own22", "b22", "b23", "b24", "b25"],
    }

    def given(brain, **more):
        if brain["id"] not in names[surfaces]:
            return brain
        return (
            {key: brain[key] for key in ("id", "week", "population")}
            | {"pial": str(files / "pial.gii")}
            | more
        )

    settings = EXPECTED | {"growth": {"matched_surfaces": False}}
    brains = of_two(22, atlas=(22, 23, 24, 25))
    found = study(map(given, brains), **settings)
    assert found.chains["own22", "atlas"].weeks[1:] == (22, 23, 24)
    source = "typical" if surfaces == "both" else "measured"
    ids = names[surfaces]
    assert found.filled == [{"ids": ids, "cortex": source, "by_cortex": True}]
    similar = {found.brains[name].thickness_of for name in ids}
    expected = {"start": "b22", "atlas": "own22", "both": None}[surfaces]
    assert similar == {expected}
    with_white = study(
        [given(brain, white=str(files / "white.gii")) for brain in brains], **settings
    )
    assert [group["cortex"] for group in with_white.filled] == ["white"]
    assert study(of_two(22), **EXPECTED).filled == []


def test_a_brain_is_predicted_where_no_later_brain_that_it_is_compared_with_was_read(
    of_two,
):
    runs = {"a": EXPECTED["runs"]["a"], "paper": {}, "measured": {"preset": "measured"}}
    found = study(of_two(22, 23, 24), runs=runs)
    # a run that no brain tells of stands beside it, and one that later brains explain
    # does not
    assert [(one.run, one.is_atlas_prediction) for one in found.predictions] == [
        ("a", True),
        ("paper", False),
    ]
    assert [one.kind for one in found.run_simulations] == [
        "predicted",
        "predicted",
        "explained",
    ]
    # of unknown population, it is compared with the brains that its growth comes from
    assert (
        study(of_two(22, population=None), **EXPECTED).run_simulations[0].kind
        == "explained"
    )
    # a later scan of the same subject is its own, whatever it is called
    scans = [
        brain | ({"subject": "s"} if brain["id"] in ("own22", "b24") else {})
        for brain in of_two(22)
    ]
    atlas = [brain["id"] for brain in scans[1:]]
    assert (
        not study(scans, growth={"brains": {"with it": atlas}}, **EXPECTED)
        .run_simulations[0]
        .is_atlas_prediction
    )
    # which is of no other subject's series but by name
    assert study(scans, **EXPECTED).run_simulations[0].is_atlas_prediction


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
    near = [brain.id for brain in found.atlas_brains_near(simulation, 23.9)]
    assert near == ["b22", "b23", "b24", "b25"]
    assert [b.id for b in found.atlas_brains_near(simulation, 30.0)] == ["b25"]
    # growth of the brain itself is measured on the mesh's surface
    own = study(of_two(22, 23, 24), runs={"a": {"preset": "measured"}})
    row = own.rows_of(own.run_simulations[0])[-1]
    assert own.measured_parts(row) == row.parts
    # no prediction is one that its own later brains explain, or a study of several runs
    assert (
        study(of_two(22, 23, 24), runs={"a": {"preset": "measured"}}).prediction_facts
        is None
    )
    assert (
        study(of_two(22), runs=EXPECTED["runs"] | {"plain": {}}).prediction_facts
        is None
    )


# sweeps and calibration


# what is measured
