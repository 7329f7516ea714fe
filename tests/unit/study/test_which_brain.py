"""Choice of brains in studies of three or more; the order in the configuration decides
nothing by chance."""

import pytest
from configurations import LABELLED, ids, labelled, resolved

from gyriflow.errors import InputError
from gyriflow.study.brains import comparable


def brain(name, week, side=None, **more):
    """Return a brain of labels, or of the surface of one hemisphere."""
    half = {"pial": __file__, "side": side}
    return {"id": name, "week": week, **(half if side else LABELLED), **more}


def sphere(name, week):
    return {"id": name, "week": week, "shape": {}}


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
    runs = {"runs": {"e": {"preset": "expected"}}}
    with pytest.raises(InputError, match="half"):
        resolved([*own, *atlas], start="half", **runs)


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
    assert found.norm_reference == [f"{side}22", f"{side}23.5"]
    assert found.measured[f"brains/{side}22/metrics"].maps == (
        f"results/brains/{side}22/metrics/{side}.shape.gii",
    )
    sides = {
        brain.brain: list(brain.template_maps)
        for brain in found.exported
        if brain.run == "observed"
    }
    assert [name for name, found_sides in sides.items() if found_sides == ["left"]] == [
        "left22",
        "left23.5",
        "a",
        "b",
    ]
    assert sides["right22"] == sides["right23.5"] == []
    assert other not in str(found.simulated["reference", f"{side}22", 23].parts)


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
