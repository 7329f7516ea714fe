"""Maps and estimated growth in a configuration: what the steps of the workflow are handed."""

import pytest
from configurations import LABELLED, problems

from gyriflow.config import load

BRAINS = [
    {"id": "a", "week": 21, **LABELLED},
    {"id": "b", "week": 22, **LABELLED},
    {"id": "c", "week": 22, **LABELLED},
]
ESTIMATED = {"end_week": 24, "growth_rate_per_s": "estimated"}


def study(folding, **others):
    return {"brains": BRAINS, "start": "a", "folding": {"end_week": 24} | folding, **others}


def test_a_map_goes_by_its_parameters_name_and_its_files_stand_apart(tmp_path):
    for name in ("left.gii", "right.gii", "left.surf.gii", "right.surf.gii", "soft.nii.gz"):
        (tmp_path / name).touch()
    mapped = {
        "thickness_mm": {"map": ["left.gii", "right.gii"], "surface": ["left.surf.gii", "right.surf.gii"]},
        "growth_rate_per_s": {"map": "left.gii", "surface": "left.surf.gii", "weeks": {30: 0.5, 21: 1}},
        "shear_modulus_core_pa": {"map": "soft.nii.gz"},
        "radial_growth_rate_per_s": {"weeks": {25: 1e-7}},
        "core_growth_rate_per_s": "estimated",
    }
    config = load(study(mapped, runs={"mapped": {}, "plain": dict.fromkeys(mapped, 1e-8)}), tmp_path)
    settings = config.parameters("mapped")
    assert {name: settings[name] for name in mapped} == {
        "thickness_mm": {"map": "thickness_mm"},
        "growth_rate_per_s": {"weeks": {21.0: 1.0, 30.0: 0.5}, "map": "growth_rate_per_s"},
        "shear_modulus_core_pa": {"map": "shear_modulus_core_pa"},
        "radial_growth_rate_per_s": {"weeks": {25.0: 1e-7}},
        "core_growth_rate_per_s": "estimated",
    }
    assert list(settings["growth_rate_per_s"]["weeks"]) == [21.0, 30.0]
    assert "ranks" not in settings
    assert config.maps("mapped") == {
        "thickness_mm": {
            "map": [str(tmp_path / "left.gii"), str(tmp_path / "right.gii")],
            "surface": [str(tmp_path / "left.surf.gii"), str(tmp_path / "right.surf.gii")],
        },
        "growth_rate_per_s": {"map": [str(tmp_path / "left.gii")], "surface": [str(tmp_path / "left.surf.gii")]},
        "shear_modulus_core_pa": {"map": [str(tmp_path / "soft.nii.gz")], "surface": []},
    }
    assert config.maps("plain") == {}
    assert config.parameters("plain")["thickness_mm"] == 1e-8


@pytest.mark.parametrize(
    ("growth", "brains"),
    [({}, ["a", "b", "c"]), ({"brains": ["c", "a"]}, ["a", "c"]), ({"brains": None}, ["a", "b", "c"])],
)
def test_growth_is_estimated_from_all_brains_or_those_named(growth, brains):
    assert load(study({}, growth=growth)).growth_series == {"volume": brains}


def both_kinds(tmp_path, weeks):
    """Returns a study with a phantom and a closed surface of each of some weeks, the phantoms first."""
    (tmp_path / "pial.surf.gii").touch()
    made = [{"id": f"v{week}", "week": week, **LABELLED} for week in weeks]
    given = [{"id": f"s{week}", "week": week, "pial": "pial.surf.gii"} for week in weeks]
    return {"brains": [*made, *given], "start": "s21", "folding": {"end_week": 24}}


def test_surfaces_and_volumes_are_two_series_and_the_start_says_which_is_estimated_from(tmp_path):
    raw = both_kinds(tmp_path, (21, 22))
    config = load(raw, tmp_path)
    assert config.growth_series == {"surface": ["s21", "s22"], "volume": ["v21", "v22"]}
    assert (config.estimated_from("s21"), config.estimated_from("v21")) == ("surface", "volume")
    assert load(raw | {"growth": {"estimated_from": "volume"}}, tmp_path).estimated_from("s21") == "volume"
    assert load(raw | {"growth": {"brains": ["v22", "v21"]}}, tmp_path).growth_series == {"volume": ["v21", "v22"]}


def test_kinds_of_which_one_has_a_single_week_are_one_series(tmp_path):
    raw = both_kinds(tmp_path, (21, 22))
    assert load(raw | {"growth": {"brains": ["s21", "v22"]}}, tmp_path).growth_series == {"all": ["v22", "s21"]}
    chosen = {"brains": ["s21", "v21", "v22"]}
    assert load(raw | {"growth": chosen}, tmp_path).growth_series == {"all": ["v21", "v22", "s21"]}


def test_series_may_be_named(tmp_path):
    raw = both_kinds(tmp_path, (21, 22, 23))
    named = {"early": ["s21", "s22"], "late": ["v22", "s23"]}
    config = load(raw | {"growth": {"brains": named, "estimated_from": "late"}}, tmp_path)
    assert config.growth_series == {"early": ["s21", "s22"], "late": ["v22", "s23"]}
    assert config.estimated_from("s21") == "late"


@pytest.mark.parametrize(
    ("growth", "found"),
    [
        (
            {"brains": {"one": ["v21", "x"], "two": ["v21", "v22"]}},
            ["growth.brains.one: found x; expected ids of brains: v21, v22, s21, s22"],
        ),
        (
            {"brains": {"one": ["v21", "s21"], "two": ["v21", "v22"]}},
            ["growth.brains.one: found brains of 1 week; a growth rate needs two or more"],
        ),
        (
            {"brains": {"one": ["v21", "v22"], "two": ["v21", "v22"]}},
            [
                "folding.growth_rate_per_s: can't be estimated: the start brain s21 is in none of the series one, two; "
                "name one under growth.estimated_from"
            ],
        ),
        ({"estimated_from": "volumes"}, ["growth.estimated_from: found 'volumes'; the series are surface, volume"]),
        ({"brains": {"one": "v21"}}, ["growth.brains.one: found 'v21'; it should be a valid tuple"]),
    ],
)
def test_series_that_cannot_be_used_are_refused(tmp_path, growth, found):
    assert problems(both_kinds(tmp_path, (21, 22)) | {"growth": growth, "folding": ESTIMATED}, tmp_path) == found


@pytest.mark.parametrize(
    ("growth", "settings", "found"),
    [
        ({}, ESTIMATED, []),
        ({"brains": ["a", "c"]}, ESTIMATED, []),
        (None, ESTIMATED, []),
        ({"brains": ["a", "d"]}, ESTIMATED, ["growth.brains: found d; expected ids of brains: a, b, c"]),
        (
            {"brains": ["b", "c"]},
            {"end_week": 24},
            ["growth.brains: found brains of 1 week; a growth rate needs two or more"],
        ),
        ({"brains": []}, {"end_week": 24}, ["growth.brains: found brains of 0 weeks; a growth rate needs two or more"]),
    ],
)
def test_brains_that_give_no_growth_rate_are_refused(growth, settings, found):
    assert problems({"brains": BRAINS, "start": "a", "growth": growth, "folding": settings}) == found


def test_an_estimate_without_two_weeks_is_refused_where_it_stands():
    reason = "can't be estimated: found brains of 1 week; a growth rate needs two or more"
    alone = {"brains": BRAINS[:1], "start": "a", "folding": {"end_week": 24}}
    estimated = {"growth_rate_per_s": "estimated"}
    assert problems(alone | {"runs": {"x": estimated, "y": estimated}}) == [f"folding.growth_rate_per_s: {reason}"]
    assert problems(alone | {"runs": {"x": estimated, "y": {}}}) == [f"runs.x.growth_rate_per_s: {reason}"]


@pytest.mark.parametrize(
    ("follow", "told"),
    [
        ({"growth_of": "another"}, ""),
        ({"growth_of": "another", "known_until_gw": 22}, "known_until_gw: has no meaning with growth of another"),
        ({"growth_of": "another", "ventricles_ml": "measured"}, "follow.ventricles_ml: is measured on the start's own"),
        ({"growth_of": "another", "area_cm2": {21: 99, 30: 252}}, ""),
        ({"loop": "closed", "area_cm2": {21: 99, 30: 252}}, "area_cm2: has no meaning where growth leads to whole"),
        ({"loop": "closed", "known_until_gw": 22}, "known_until_gw: has no meaning where growth leads to whole shapes"),
        ({"loop": "closed", "growth_of": "another"}, ""),
        ({"loop": "open", "known_until_gw": 22}, ""),
    ],
)
def test_growth_towards_shapes_knows_whole_shapes(follow, told):
    found = problems(study({"follow": follow}))
    assert not found if not told else [line for line in found if told in line]


def test_sizes_by_hand_are_refused_in_studies_of_growth_towards_shapes_too():
    table = {"follow": {"area_cm2": {21: 99, 30: 252}}}
    vary = {"base": "reference", "compare_week": 22, "vary": {"follow.loop": ["open", "closed"]}}
    (found,) = problems(study(table, studies={"loops": vary}))
    assert "has no meaning where growth leads to whole shapes: set it to measured" in found


def test_what_is_expected_is_a_preset():
    folding = load(study({"preset": "expected"})).run("reference")
    assert (folding.follow.loop, folding.follow.growth_of) == ("closed", "another")
    assert folding.shear_modulus_cortex_pa == folding.shear_modulus_core_pa
