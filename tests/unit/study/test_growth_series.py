"""Which brains are the series that growth is measured on, and what they are called."""

import pytest
from configurations import LABELLED, both_kinds, labelled, series_for, series_of, study, touched

from gyriflow.config import load
from gyriflow.study import resolve


@pytest.mark.parametrize(
    ("growth", "brains"),
    [({}, ["a", "b", "c"]), ({"brains": ["c", "a"]}, ["a", "c"]), ({"brains": None}, ["a", "b", "c"])],
)
def test_growth_is_of_all_brains_or_those_named(growth, brains):
    assert series_of(resolve(load(study(labelled(21, 22, 22), growth=growth)))) == {"volume": brains}


def test_surfaces_and_volumes_are_two_series_and_the_start_says_which_is_followed(tmp_path):
    raw = both_kinds(tmp_path, (21, 22))
    found = resolve(load(raw, tmp_path))
    assert series_of(found) == {"surface": ["s21", "s22"], "volume": ["v21", "v22"]}
    assert (series_for(found, "s21"), series_for(found, "v21")) == ("surface", "volume")
    named = resolve(load(raw | {"growth": {"series": "volume"}}, tmp_path))
    assert series_for(named, "s21") == "volume"
    chosen = resolve(load(raw | {"growth": {"brains": ["v22", "v21"]}}, tmp_path))
    assert series_of(chosen) == {"volume": ["v21", "v22"]}


def test_hemispheres_that_are_alone_share_no_growth_curve_with_brains_of_other_sides(tmp_path):
    brains = [
        {"id": f"{side}{week}", "week": week, "hemisphere": {"file": "lh.surf.gii", "side": side}}
        for side in ("left", "right")
        for week in (24, 25)
    ]
    brains += [{"id": f"p{week}", "week": week, **LABELLED} for week in (24, 25)]
    found = resolve(load(study(brains, start="left24", folding={"end_week": 26}), touched(tmp_path, "lh.surf.gii")))
    assert series_of(found) == {
        "left hemisphere, surface": ["left24", "left25"],
        "right hemisphere, surface": ["right24", "right25"],
        "volume": ["p24", "p25"],
    }
    assert series_for(found, "left24") == "left hemisphere, surface"
