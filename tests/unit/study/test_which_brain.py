"""Choice of brains in studies of three or more; the order in the configuration decides
nothing by chance."""

import pytest
from configurations import LABELLED, cases, ids, labelled, resolved

from gyriflow.errors import InputError
from gyriflow.study.brains import comparable


def brain(name, week, side=None, **more):
    """Return a brain of labels, or of the surface of one hemisphere."""
    half = {"pial": __file__, "side": side}
    return {"id": name, "week": week, **(half if side else LABELLED), **more}


def sphere(name, week):
    return {"id": name, "week": week, "shape": {}}


@cases(
    ("start", "others"),
    """
    whole | [whole, whole-well, whole-ill, scan, theirs]
    whole-well | [whole-well]
    left | [left, left-well]
    left-well | [left-well]
    right | [right]
    scan | [whole, whole-well, whole-ill, scan]
    """,
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
    half = brain("half", 22, side="left", population="own")
    atlas = [brain(f"atlas{week}", week, population="atlas") for week in (22, 23, 24)]
    with pytest.raises(InputError, match="half"):
        resolved([half, *atlas], start="half", runs={"e": {"preset": "expected"}})


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
        sphere("ball", 21),
        *(brain(f"well{week}", week, population="well") for week in (21, 22)),
        brain("half", 22, side="right", population="well"),
        brain("ill23", 23, population="ill"),
    ]
    metrics = {"norm_reference": named}
    assert resolved(brains, start=start, metrics=metrics).norm_reference == reference


def test_the_norm_is_of_all_brains_but_shapes_where_no_population_is_known():
    ball = sphere("ball", 21)
    brains = [ball, *labelled(21, 22), {"id": "surface", "week": 23, "pial": __file__}]
    assert resolved(brains, start="ball").norm_reference == ["a", "b", "surface"]
    assert resolved([ball], start="ball").norm_reference == []


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
def test_a_second_hemisphere_is_of_another_norm_and_template(side):
    halves = [
        brain(f"{name}{week}", week, name)
        for name in ("left", "right")
        for week in (22, 23.5)
    ]
    brains = [*halves, *labelled(21, 24, names="ab")]
    found = resolved(brains, start=f"{side}22", metrics={"template": "left22"})
    assert found.norm_reference == [f"{side}22", f"{side}23.5"]
    template_sides = {
        row.brain: list(row.template_maps)
        for row in found.exported
        if row.run == "observed"
    }
    with_maps = [name for name, sides in template_sides.items() if sides == ["left"]]
    assert with_maps == ["left22", "left23.5", "a", "b"]
    assert template_sides["right22"] == template_sides["right23.5"] == []


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


@pytest.mark.parametrize(
    ("weeks", "similar"), [((22, 26), "x"), ((21, 23.4), "y"), ((), "white")]
)
def test_thickness_is_of_the_brain_nearest_in_week_with_labels_or_else_white_surfaces(
    weeks, similar
):
    bare = {"id": "bare", "week": 23, "pial": __file__}
    white = {"id": "white", "week": 23.1, "pial": __file__, "white": __file__}
    found = resolved([bare, white, *labelled(*weeks, names="xy")], start="bare")
    assert found.brains["bare"].thickness_of == similar
    if not weeks:
        assert found.brains["white"].thickness_of is None
