"""Choice of brains in studies of three or more; the order in the configuration decides
nothing by chance."""

import pytest
from configurations import LABELLED, ids, labelled, resolved

from gyriflow.errors import InputError
from gyriflow.study.brains import comparable


def brain(name, week, side=None, **more):
    """Return a brain of labels, or of the surface of one hemisphere."""
    half = {"hemisphere": {"file": __file__, "side": side}}
    return {"id": name, "week": week, **(half if side else LABELLED), **more}


def sphere(name, week):
    return {"id": name, "week": week, "shape": {}}


@pytest.mark.parametrize("order", [(0, 1, 2, 3), (3, 2, 1, 0), (2, 0, 3, 1)])
def test_the_adjacent_brain_is_the_latest_before_the_week_that_runs_are_compared_in(
    order,
):
    brains = labelled(21, 22, 23, 24)
    others = [
        brain("other", 23.5, population="ill"),
        brain("half", 23.6, side="left"),
        sphere("ball", 23.7),
    ]
    brains = [given | {"population": "well"} for given in brains]
    found = resolved([*(brains[number] for number in order), *others])
    assert {week: ids(pair) for (_, week), pair in found.references.items()} == {
        22: ["b", "a"],
        23: ["c", "b"],
        24: ["d", "c"],
    }
    assert list(found.all_measured["brains/half/metrics"].parts) == [
        "whole",
        "left",
    ]


def test_the_observed_brain_is_the_subject_s_own_or_else_the_first_and_never_a_shape():
    brains = [
        brain("start", 21, subject="s"),
        sphere("ball", 22),
        brain("x", 22),
        brain("own", 22, subject="s"),
    ]
    run = resolved([*brains, brain("y", 22)], start="start").simulations[
        "reference", "start"
    ]
    assert (ids(run.observed_brains[22]), run.observed[22].id) == (
        ["own", "ball", "x", "y"],
        "own",
    )
    # another subject's scan is no brain to be compared with
    run = resolved(
        [*brains[:3], brain("theirs", 22, subject="t")], start="start"
    ).simulations["reference", "start"]
    assert (ids(run.observed_brains[22]), run.observed[22].id) == (["ball", "x"], "x")


@pytest.mark.parametrize(
    ("start", "others"),
    [
        ("whole", ["whole", "whole-well", "whole-ill", "scan", "theirs"]),
        ("whole-well", ["whole-well"]),
        ("left", ["left", "left-well"]),
        ("left-well", ["left-well"]),
        ("right", ["right"]),
        ("scan", ["whole", "whole-well", "whole-ill", "scan"]),
    ],
)
def test_brains_are_comparable_by_their_hemispheres_population_and_subject(
    start, others
):
    brains = [
        brain("whole", 21),
        brain("whole-well", 22, population="well"),
        brain("whole-ill", 22, population="ill"),
        *(brain(side, 22, side=side) for side in ("left", "right")),
        brain("left-well", 23, side="left", population="well"),
        brain("scan", 22, subject="s"),
        brain("theirs", 23, subject="t"),
    ]
    found = resolved(brains, start="whole").brains
    assert ids(comparable(found[start], found.values())) == others


def test_half_a_brain_grows_by_no_atlas_of_whole_ones():
    own = [
        brain("half", 22, side="left", population="own"),
        brain("full", 22, population="own"),
    ]
    atlas = [brain(f"atlas{week}", week, population="atlas") for week in (22, 23, 24)]
    halves = [
        brain(f"left{week}", week, side="left", population="halves")
        for week in (22, 23, 24)
    ]
    runs = {"runs": {"e": {"preset": "expected"}}}
    with pytest.raises(InputError, match="half"):
        resolved([*own, *atlas], start="half", **runs)
    found = resolved([*own, *atlas, *halves], start=["half", "full"], **runs)
    assert ids(found.chains["half", "atlas"].later) == ["left22", "left23", "left24"]
    assert ids(found.chains["full", "atlas"].later) == ["atlas22", "atlas23", "atlas24"]


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 1, 0)])
def test_regions_come_from_the_brain_nearest_in_week_that_has_any(order):
    brains = labelled(21, 22, 26, names="ace")
    brains = [
        *(brains[number] for number in order),
        *labelled(21.4, 23, 24.5, 25.5, names="bdfg"),
    ]
    regions = {name: {"volume": __file__, "names": {1: "frontal"}} for name in "ace"}
    found = resolved(brains, metrics={"regions": regions})
    assert {name: found.brains[name].regions_of for name in "bdfg"} == {
        "b": "a",
        "d": "c",
        "f": "e",
        "g": "e",
    }


def test_the_norm_is_of_the_population_and_the_hemispheres_of_the_first_start():
    brains = [brain("ill21", 21, population="ill"), sphere("ball", 21)]
    brains += [brain(f"well{week}", week, population="well") for week in (21, 22)]
    brains += [
        brain("half", 22, side="right", population="well"),
        brain("ill23", 23, population="ill"),
    ]
    assert resolved(brains, start="well22").norm_reference == ["well21", "well22"]
    assert resolved(brains, start="ill23").norm_reference == ["ill21", "ill23"]
    assert resolved(brains, start=["ill21", "well21"]).norm_reference == [
        "ill21",
        "ill23",
    ]
    assert resolved(brains, start="half").norm_reference == ["half"]
    named = {"metrics": {"norm_reference": ["ill21", "half", "well22"]}}
    assert resolved(brains, start="well22", **named).norm_reference == [
        "ill21",
        "well22",
    ]
    # whatever their files are, and never of simple shapes
    unknown = [
        sphere("ball", 21),
        *labelled(21, 22),
        {"id": "surface", "week": 23, "pial": __file__},
    ]
    assert resolved(unknown, start="ball").norm_reference == ["a", "b", "surface"]
    assert resolved(unknown[:1], start="ball").norm_reference == []


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


def test_a_chain_goes_from_its_own_start_to_the_first_brain_past_its_own_end():
    brains = labelled(21, 22, 23, 24, 25)
    runs = {
        "early": {"preset": "measured", "start": ["a", "b"], "end_week": 22.5},
        "late": {"preset": "measured", "start": "b", "end_week": 23.5},
    }
    found = resolved(brains[::-1], runs=runs, start="a")
    assert ids(found.chains["a", "self"].brains) == ["a", "b", "c"]
    # both runs from a start follow one chain, to the later of their ends
    assert ids(found.chains["b", "self"].brains) == ["b", "c", "d"]
    # a brain that is refused is passed over
    assert ids(resolved(brains, ["c"], runs=runs).chains["b", "self"].brains) == [
        "b",
        "d",
    ]


def test_a_start_that_no_brain_leads_to_the_end_is_left_out_alone():
    brains = [
        brain(f"{who}{week}", week, population=who)
        for who in "xyz"
        for week in (21, 23, 24)
    ]
    asked = {
        "runs": {"m": {"preset": "measured"}, "r": {"start": "x21"}},
        "start": ["x21", "y21", "z21"],
    }
    assert resolved(brains, **asked).pairs == [
        ("m", "x21"),
        ("m", "y21"),
        ("m", "z21"),
        ("r", "x21"),
    ]
    found = resolved(brains, ["y24"], **asked)
    assert (found.pairs, list(found.unreachable)) == (
        [("m", "x21"), ("m", "z21"), ("r", "x21")],
        ["y21"],
    )
    assert "y21 (21 GW), y23 (23 GW)" in str(found.unreachable["y21"])
    # a start takes its runs of other growth with it
    found = resolved(brains, ["x24"], **asked)
    assert (found.pairs, list(found.unreachable)) == (
        [("m", "y21"), ("m", "z21")],
        ["x21"],
    )


def test_of_uneven_weeks_the_nearest_are_taken_and_those_up_to_the_end_are_compared():
    own = {"population": "own", "subject": "s"}
    brains = [
        brain("start", 22.3, **own),
        brain("later", 23.45, **own),
        brain("after", 25.2, **own),
    ]
    atlas = [
        brain(f"a{week}", week, population="atlas")
        for week in (21, 22.1, 22.9, 24.4, 26)
    ]
    runs = {"x": {"preset": "expected", "end_week": 24}}
    found = resolved([*brains, *atlas], start="start", runs=runs)
    simulation = found.simulations["x", "start"]
    # every whole step from the start, the end, and the week of the later scan; the one
    # after the end is left out
    assert simulation.weeks == (22.3, 23.3, 23.45, 24)
    assert {week: one.id for week, one in simulation.observed.items()} == {
        23.45: "later"
    }
    # from the last week up to the start's to the first at or past the end
    assert ids(found.chains["start", "atlas"].later) == ["a22.1", "a22.9", "a24.4"]
    assert found.chains["start", "atlas"].further_weeks == (23.45,)
    assert found.atlas_brain(simulation).id == "a24.4"
    assert {key: ids(pair) for key, pair in found.references.items()} == {
        ("start", 23.45): ["later", "start"]
    }


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_second_hemisphere_is_of_another_series_norm_and_template(side):
    other = {"left": "right", "right": "left"}[side]
    halves = [
        brain(f"{name}{week}", week, name)
        for name in ("left", "right")
        for week in (22, 23.5)
    ]
    found = resolved(
        [*halves, *labelled(21, 24, names="ab")],
        start=f"{side}22",
        metrics={"template": "left22"},
    )
    assert sorted(map(ids, found.series.brains.values())) == [
        ["a", "b"],
        ["left22", "left23.5"],
        ["right22", "right23.5"],
    ]
    assert ids(found.chains[f"{side}22", "self"].brains) == [f"{side}22"]
    assert found.norm_reference == [f"{side}22", f"{side}23.5"]
    assert found.measured[f"brains/{side}22/metrics"].maps == (
        f"results/brains/{side}22/metrics/{side}.shape.gii",
    )
    sides = {
        brain.brain: list(brain.template_maps)
        for brain in found.exported
        if brain.run == "real"
    }
    assert [name for name, found_sides in sides.items() if found_sides == ["left"]] == [
        "left22",
        "left23.5",
        "a",
        "b",
    ]
    assert sides["right22"] == sides["right23.5"] == []
    assert other not in str(found.simulations["reference", f"{side}22"].at(23).parts)


def test_a_brain_has_white_surfaces_that_are_given_or_follow_from_its_labels():
    pial = {"week": 23, "pial": __file__}
    brains = [
        {"id": "bare", **pial},
        {"id": "white", **pial, "white": __file__},
        *labelled(22),
    ]
    for wanted, expected in (("given", {"white"}), ("all", {"white", "a"})):
        found = resolved(brains, start="bare", metrics={"white_surfaces": wanted})
        brains_found = found.brains.values()
        assert {brain.id for brain in brains_found if brain.white} == expected


def test_charts_have_the_colours_of_a_covariate_for_each_scan_of_a_subject():
    brains = [
        brain(f"{subject}w{week}", week, subject=subject, covariates={"sex": sex})
        for subject, sex in (("p", "F"), ("q", "M"), ("r", "F"))
        for week in (21, 22)
    ]
    found = resolved(brains, start="pw21", runs={"reference": {"end_week": 22}})
    assert {name: brain.group for name, brain in found.brains.items()} == {
        given["id"]: f"sex: {given['covariates']['sex']}" for given in brains
    }


@pytest.mark.parametrize(("weeks", "similar"), [((22, 26), "x"), ((21, 23.4), "y")])
def test_thickness_is_of_the_brain_nearest_in_week_with_labels_or_else_white_surfaces(
    weeks, similar
):
    pial = {"pial": __file__}
    brains = [
        {"id": "bare", "week": 23, **pial},
        {"id": "white", "week": 23.1, **pial, "white": __file__},
    ]
    found = resolved([*brains, *labelled(*weeks, names="xy")], start="bare")
    assert found.brains["bare"].thickness_of == similar
    alone = resolved(brains, start="bare")
    assert alone.brains["bare"].thickness_of == "white"
    assert alone.brains["white"].thickness_of is None
