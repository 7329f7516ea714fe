"""A study resolved from its configuration: which brains, weeks and files stand behind
each run and comparison."""

from itertools import pairwise
from pathlib import Path

import pytest
from configurations import both_kinds, ids, resolved, touched
from facts import Facts
from shapes import sphere

from gyriflow.errors import InputError
from gyriflow.io.surfaces import write_surface
from gyriflow.io.yaml_files import read_yaml
from gyriflow.settings import ensemble
from gyriflow.study import resolve
from gyriflow.study.brains import registered_source
from gyriflow.study.loading import load
from gyriflow.study.paths import CURVES

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
    members = {
        name: [(values, one.settings) for one, values in compared.members]
        for name, compared in resolve(
            load(read_yaml(EXAMPLES / "paper.yaml"), EXAMPLES)
        ).sweeps.items()
    }
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


def test_maps_are_made_for_the_runs_that_have_any(files, labels):
    pair = [str(files / "left.gii"), str(files / "right.gii")]
    runs = {
        "plain": {},
        "thick": {"thickness_mm": {"map": pair, "surface": pair}},
        "soft": {"shear_modulus_core_pa": {"map": str(files / "map.nii.gz")}},
        "shapes": {"growth": "shapes"},
    }
    search = {
        "base": "soft",
        "parameters": {"thickness_mm": [1, 3]},
        "score": {"size": 1},
        "compare_week": 24,
    }
    found = study([labels(21), labels(24)], runs=runs, calibrate=search)
    maps = {run: found.simulations[run, "b21"].maps for run in runs}
    assert maps == {"plain": []} | {
        run: f"results/runs/{run}/b21/folding/maps.h5" for run in list(runs)[1:]
    }
    # runs of the calibration have the maps of its base
    assert found.simulations["calibration-00", "b21"].maps == maps["soft"]


@pytest.mark.parametrize(
    ("growth", "curves", "series", "kind"),
    [
        ({}, [], None, "predicted"),
        (SIZES, [], None, "predicted"),
        (SIZES | {"volume_ml": "measured"}, CURVES["curves"], "volume", "explained"),
        # its sizes come from its shapes
        ({"model": "shapes"}, [], None, "explained"),
    ],
)
def test_a_run_waits_for_the_sizes_that_it_follows_and_is_explained_by_measured_growth(
    real, growth, curves, series, kind
):
    (one,) = study(real, runs={"r": {"growth": growth}}).run_simulations
    assert (one.curves, one.followed_series) == (curves, series)
    assert one.kind == kind


# brains that were refused


def test_a_refused_brain_leaves_the_others_as_they_are(of_two):
    runs = {"a": {"preset": "expected"}, "first": {"start": "first", "end_week": 23}}
    asked = {"start": ["own22", "own23"], "runs": runs}
    brains = of_two(22, 23)
    assert study(brains, **asked).pairs == [
        ("a", "own22"),
        ("a", "own23"),
        ("first", "own22"),
    ]
    # no other brain is folded in its place
    assert study(brains, ["own22"], **asked).pairs == [("a", "own23")]
    # without the end of the atlas no run of it has anywhere to go
    found = study(brains, ["b24", "b25"], **asked)
    assert (found.run_simulations, set(found.unreachable)) == ([], {"own22", "own23"})
    assert "own22" in found.brains
    # one start of another population's growth is left out, the other goes on by its own
    other = study(
        brains,
        ["b24", "b25"],
        **asked | {"runs": {"a": runs["a"] | {"start": "own22"}, "plain": {}}},
    )
    assert (other.pairs, set(other.unreachable)) == ([("plain", "own23")], {"own22"})


def test_refused_brains_leave_studies_and_comparisons_too(real, files):
    varied = {
        "base": "reference",
        "vary": {"thickness_mm": [1.0, 2.0]},
        "compare_week": 24,
    }
    regions = {"b23": {"volume": str(files / "map.nii.gz"), "names": {1: "frontal"}}}
    twin = real[3] | {"id": "twin"}
    asked = {
        "studies": {"thick": varied, "one": varied | {"base": "late"}},
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
        name: [one.start.id for one, _ in of.members]
        for name, of in found.sweeps.items()
    } == {"thick": ["b21", "b21"]}
    assert ids(found.sweeps["thick"].observed["b21"]) == ["twin"]
    assert found.simulations["reference", "b21"].observed == {24: found.brains["twin"]}
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
    empty = study(real, ["b21"], studies={"thick": varied}, calibrate=search)
    assert empty.run_simulations == empty.norm_reference == [] == list(empty.sweeps)
    assert empty.calibration is None


# which real brains a run is compared with


def test_a_week_of_days_is_one_number_everywhere(labels):
    """24 weeks and 2 days are 24.2857...: of the brain, the end of the runs and the
    comparison."""
    days = 24 + 2 / 7
    varied = {
        "base": "reference",
        "vary": {"thickness_mm": [1.0, 2.0]},
        "compare_week": days,
    }
    found = study(
        [labels(21), labels(days, id="late")],
        folding={"end_week": days},
        studies={"thick": varied},
    )
    one, comparison = found.simulations["reference", "b21"], found.sweeps["thick"]
    assert found.brains["late"].week == one.weeks[-1] == comparison.week == 24.29
    assert ids(one.observed.values()) == ids(comparison.observed["b21"]) == ["late"]
    # the rows of tables that figures look for by their week
    rows = [
        found.brains["late"],
        one.simulated[-1],
        *(member.at(24.29) for member, _ in comparison.members),
    ]
    assert {row.week for row in rows} == {24.29}
    assert one.simulated[-1].place.endswith("/week-24.29")


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


def test_growth_is_of_one_subject_whose_scans_alone_it_leads_to(labels):
    found = study(cohort(labels), **MEASURED)
    assert {name: ids(brains) for name, brains in found.series.brains.items()} == {
        "a": ["a22", "a26"],
        "b": ["b24", "b27"],
    }
    # each up to its own last scan
    assert {
        one.start.id: (ids(one.observed.values()), one.weeks[-1])
        for one in found.run_simulations
    } == {
        "a22": (["a26"], 26.0),
        "b24": (["b27"], 27.0),
    }
    assert [found.growth_source(one) for one in found.run_simulations] == ["own", "own"]
    with pytest.raises(InputError, check=Facts("m", "c25", "a, b", 25, 27)):
        study(cohort(labels), **MEASURED | {"start": "c25"})
    # nor does a brain follow the sizes of another subject
    sizes = MEASURED | {"runs": {"s": {"growth": "sizes"}}}
    alone = study(cohort(labels)[2:], **sizes | {"start": "c25"}).run_simulations[0]
    assert (
        alone.series,
        study(cohort(labels)[2:], **sizes | {"start": "b24"}).run_simulations[0].series,
    ) == (
        None,
        "b",
    )


def test_a_chain_of_several_subjects_is_asked_for_by_name_and_called_a_populations(
    labels,
):
    found = study(cohort(labels), growth={"brains": {"cohort": ["all"]}}, **MEASURED)
    assert ids(found.chains["a22", "self"].brains) == [
        "a22",
        "b24",
        "c25",
        "a26",
        "b27",
    ]
    one = found.run_simulations[0]
    assert (ids(one.observed.values()), one.weeks[-1]) == (
        ["b24", "c25", "a26", "b27"],
        27.0,
    )
    assert found.growth_source(one) == Facts("cohort")
    # a list of brains is no chain
    assert study(
        cohort(labels),
        growth={"brains": ["a22", "b24", "b27"]},
        **MEASURED | {"start": "b24"},
    ).growth_brains
    with pytest.raises(InputError, check=Facts("m", "a22", "b", 22, 27)):
        study(
            cohort(labels),
            growth={"brains": ["a22", "b24", "b27"]},
            **MEASURED | {"start": "a22"},
        )


def test_the_scans_of_another_subject_are_no_atlas(labels):
    atlas = [
        labels(week, id=f"atlas{week}", population="atlas") for week in (24, 25, 26, 27)
    ]
    expected = {
        "runs": {"e": {"preset": "expected"}},
        "folding": {"end_week": 27},
        "start": "c25",
    }
    found = study([*cohort(labels), *atlas], **expected)
    assert ids(found.chains["c25", "atlas"].later) == ["atlas25", "atlas26", "atlas27"]
    assert [found.growth_source(one) for one in found.run_simulations] == [
        Facts("atlas")
    ]
    assert ids(found.run_simulations[0].observed_brains[26]) == ["atlas26"]


def test_synthetic_brains_are_measured_beside_each_other_but_tell_nothing_of_worth():
    found = study([{"id": f"b{week}", "week": week, **SPHERE} for week in (21, 22)])
    (one,) = found.run_simulations
    assert {week: brain.id for week, brain in one.observed_with_start.items()} == {
        21: "b21",
        22: "b22",
    }
    assert one.observed == {}
    alone = study([{"id": "b21", "week": 21, **SPHERE}])
    assert alone.growth_brains == alone.validated == []


# the brains behind a run's growth


def test_a_start_is_carried_to_one_brain_a_week_up_to_the_first_past_the_end(
    real, labels
):
    further = labels(23, id="twin"), labels(27), labels(30)
    found = study(
        [*real[:3], *further],
        runs={"a": {"growth": "shapes"}, "open": {"growth": SIZES}},
    )
    chain = found.chains["b21", "self"]
    assert (ids(chain.brains), chain.weeks[1:]) == (
        ["b21", "b22", "b23", "b27"],
        [22, 23, 27],
    )
    assert chain.correspondences[0] == "results/study/registration/b21/b22.h5"
    assert [one.targets for one in found.run_simulations] == [
        "results/brains/b21/mesh/targets.self.h5",
        [],
    ]


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
    assert ids(found.chains[start, "atlas"].brains) == [start, *chain]
    along = found.chains[start, "atlas"]
    assert list(along.correspondences) == [
        f"results/study/registration/{start}/{chain[0]}.h5"
    ]
    # the path is that of the whole atlas, whatever the start and the end
    path = [f"b{week:g}" for week in weeks]
    assert ids(along.path.brains) == path
    assert list(along.path.correspondences) == [
        f"results/study/registration/{one}/{two}.h5" for one, two in pairwise(path)
    ]
    assert (
        found.simulations["a", start].targets
        == f"results/brains/{start}/mesh/targets.atlas.h5"
    )


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
    assert ids(named.chains["own22", "atlas"].later) == ["third22", "third24"]


def test_members_of_an_ensemble_share_what_is_equal_and_vary_the_rest(of_two, labels):
    third = [
        labels(week, population="third", id=f"third{week}")
        for week in (21, 22, 23, 24, 25)
    ]
    brains, run = (
        [*of_two(22, 24), *third],
        {"preset": "expected", "ensemble": 4},
    )
    found = study(brains, runs={"a": run}, growth={"series": "atlas"})
    simulation = found.simulations["a", "own22"]
    members = found.members(found.simulations["a", "own22"])
    assert [member.run for member in members] == [
        f"a-member-{number}" for number in (1, 2, 3, 4)
    ]
    assert [one.run for one in found.run_simulations] == ["a"]
    assert {member.weeks for member in members} == {simulation.weeks}
    chains = [found.chains["own22", f"atlas.{member.run}"] for member in members]
    assert len({member.targets for member in (simulation, *members)}) == 5
    # the atlases take turns, that of the run first
    assert [chain.later[0].id[:2] for chain in chains] == ["b2", "th", "b2", "th"]
    assert (
        len(
            {chain.correspondences for chain in chains}
            | {found.chains["own22", "atlas"].correspondences}
        )
        == 5
    )
    # all share the paths of the two atlases
    assert [chain.path for chain in chains[:2]] == [chain.path for chain in chains[2:]]
    assert found.chains["own22", "atlas"].path == chains[0].path
    shifts = [chain.variation.age_shift_gw for chain in chains]
    assert len(set(shifts)) == 4
    assert all(abs(shift) < 1.2 for shift in shifts)
    # a shifted age needs shapes up to its own end
    assert all(24 in chain.further_weeks for chain in chains)
    assert [chain.variation for chain in chains] == [
        chain.variation
        for chain in study(
            brains, runs={"a": run}, growth={"series": "atlas"}
        ).chains.values()
        if chain.variation
    ]


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


def test_members_that_grow_as_their_own_series_register_all_pairs_anew(real):
    found = study(real, runs={"a": {"growth": "shapes", "ensemble": 3}})
    chain = found.chains["b21", "self.a-member-1"]
    assert chain.weeks == found.chains["b21", "self"].weeks
    assert all(
        "/smoothing-" in file and ".seed-1" in file for file in chain.correspondences
    )
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
    assert ids(study(of_two(22, 23, 24), **named).chains["own22", "self"].later) == [
        "own23",
        "own24",
    ]
    assert refusal(of_two(22), **named) == Facts("atlas", 22, 24, "growth.brains")
    early = refusal(of_two(22, 23), runs=named["runs"])
    assert early == Facts("own22 (22 GW)", "own23 (23 GW)", 24, "growth.brains")


@pytest.mark.parametrize("preset", ["measured", "expected"])
def test_runs_of_studies_and_of_the_calibration_are_led_to_their_own_end(
    of_two, preset
):
    runs, later = {"runs": {"a": {"preset": preset}}}, {"base": "a", "compare_week": 26}
    varied = {"studies": {"late": later | {"vary": {"thickness_mm": [1.0, 2.0]}}}}
    search = {
        "calibrate": (
            later | {"parameters": {"thickness_mm": [1, 3]}, "score": {"size": 1}}
        )
    }
    for more in (varied, search):
        if preset == "measured":
            assert study(of_two(22, 24, 26), **runs, **more).chains[
                "own22", "self"
            ].weeks[1:] == [24, 26]
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


def test_what_is_expected_is_compared_in_the_weeks_of_its_later_brains(of_two):
    brains = of_two(22.4, 23, 23.4, 23.7, 23.701, 26)
    found = study(brains, runs=EXPECTED["runs"] | {"plain": {}})
    one, chain = found.simulations["a", "own22.4"], found.chains["own22.4", "atlas"]
    assert one.weeks == pytest.approx([22.4, 23, 23.4, 23.7, 24])
    assert (chain.weeks[1:], chain.further_weeks) == ([22, 23, 24], (23.4, 23.7))
    assert found.chains["own22.4", "self"].further_weeks == ()
    assert {week: brain.id for week, brain in one.observed.items()} == {
        23: "own23",
        23.4: "own23.4",
        23.7: "own23.7",
    }
    # so are runs beside it; others keep the weeks that are asked for
    assert found.simulations["plain", "own22.4"].weeks == one.weeks
    assert [one.run for one in found.predictions] == ["a", "plain"]
    assert study(brains).simulations["reference", "own22.4"].weeks == (22.4, 23.4, 24)


def test_brains_correspond_by_masks_in_their_poses_and_else_in_coordinates_of_files(
    of_two, files
):
    start = {
        "id": "own22",
        "week": 22,
        "pial": str(files / "pial.gii"),
        "population": "own",
    }
    found = study([start, *of_two()], **EXPECTED)
    assert list(found.chains["own22", "atlas"].posed) == [[True, False]]
    assert list(found.chains["own22", "atlas"].path.posed) == [[False, False]] * 4
    assert (
        registered_source(found.config, found.brains["own22"]).path
        == "results/brains/own22/surface/filled.nii.gz"
    )
    assert registered_source(found.config, found.brains["own22"]).scheme.cortex
    labels = registered_source(found.config, found.brains["b21"])
    assert labels.path == str(files / "labels.nii.gz")


def test_the_surfaces_of_a_study_are_those_of_all_its_brains(of_two):
    found = study(of_two(22, 23), **EXPECTED)
    for name in found.brains:
        folder = f"results/brains/{name}/surface"
        files = {file for file in found.surfaces if file.startswith(folder)}
        expected = {"pial.surf.gii", "left.pial.surf.gii", "thickness.shape.gii"}
        assert {f"{folder}/{file}" for file in expected} <= files


def test_a_population_that_a_run_is_carried_along_has_rates_of_growth(of_two):
    # its brains have no subject and belong to no known atlas
    found = study(of_two(22), **EXPECTED)
    (atlas,) = {
        found.series.with_brain(brain) for brain in found.chains["own22", "atlas"].later
    }
    assert atlas in found.series_with_rates
    plain = study(of_two(22))
    assert atlas in {name for name, _ in plain.growth_brains}
    assert atlas not in plain.series_with_rates


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
    assert found.chains["own22", "atlas"].weeks[1:] == [22, 23, 24]
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
        "surfaces": [f"{at}/pial.surf.gii"],
        "atlas_surface": f"{at}/atlas.pial.surf.gii",
        "labels": "results/export/sub-own224/anat/sub-own224_desc-agw2390_dseg.nii.gz",
    }
    # no prediction is one that its own later brains explain, or a study of several runs
    assert (
        study(of_two(22, 23, 24), runs={"a": {"preset": "measured"}}).prediction_facts
        is None
    )
    assert (
        study(of_two(22), runs=EXPECTED["runs"] | {"plain": {}}).prediction_facts
        is None
    )


# studies and calibration


def test_a_study_is_compared_at_its_week_and_its_members_are_measured_there(real):
    varied = {
        "base": "reference",
        "vary": {"thickness_mm": [1.0, 2.0]},
        "compare_week": 23,
    }
    found = study(
        real, runs={"reference": {"thickness_mm": 1.0}}, studies={"thick": varied}
    )
    compared = found.sweeps["thick"]
    assert [one.run for one, _ in compared.members] == ["reference", "thick-2"]
    place = found.all_measured["runs/thick-2/b21/metrics/week-23.00"]
    assert place.columns == {"subject": "b21", "run": "thick-2", "week": 23}
    assert (
        place.thickness
        == "results/runs/thick-2/b21/surfaces/week-23.00/thickness.shape.gii"
    )
    assert place.place not in found.measured
    assert [brain.population_name for brain in compared.observed["b21"]] == ["unknown"]


def test_rounds_of_a_calibration_wait_for_the_scores_of_earlier_ones(real):
    rounds = {"rounds": [3, 1]}
    search = {
        "base": "reference",
        "parameters": {"thickness_mm": [1, 3]},
        "score": {"size": 1},
        "compare_week": 24,
    }
    found = study(real, calibrate=search | rounds).calibration
    assert (list(found.rounds.values()), found.scores_before(0)) == ([0, 0, 0, 1], [])
    assert (
        found.scores_before(1)[-1]
        == "results/study/calibration/scores/calibration-02.csv"
    )
    assert found.design("calibration-03") == "results/study/calibration/round-1.csv"
    assert ids(found.observed["b21"]) == ["b24"]


# what is measured


def test_regions_are_those_of_the_nearest_brain_that_has_any(labels, files):
    given = {"b21": {"volume": str(files / "map.nii.gz"), "names": {1: "frontal"}}}
    sphere = {"id": "sphere", "week": 22, **SPHERE}
    found = study([labels(21), labels(22), sphere], metrics={"regions": given})
    assert [brain.regions_of for brain in found.brains.values()] == ["b21", "b21", None]
    # those of a run hold at all its weeks
    regions = found.all_measured["runs/reference/b21/metrics/week-22.00"].regions
    assert regions[0] == "results/runs/reference/b21/metrics/left.regions.label.gii"
