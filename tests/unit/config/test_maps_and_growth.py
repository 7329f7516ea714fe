"""Maps and estimated growth in a configuration: what the steps of the workflow are handed."""

import pytest

from gyriflow.config import load
from gyriflow.config.checks import growth_problems

BRAINS = [
    {"id": "a", "week": 21, "phantom": {}},
    {"id": "b", "week": 22, "phantom": {}},
    {"id": "c", "week": 22, "phantom": {}},
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


def test_the_folding_program_reads_curves_and_maps(tmp_path):
    from gyriflow.folding.parameters import parameters_from

    (tmp_path / "soft.nii.gz").touch()
    varying = {
        "growth_rate_per_s": {"weeks": {"21.5": "1e-7", "22.5": 3e-7}},
        "shear_modulus_core_pa": {"map": "soft.nii.gz", "weeks": {21: 1.0, 23: 2.0}},
    }
    config = load(study(varying), tmp_path)
    known = {"start_week": 21.0, "output_weeks": config.weeks("reference"), "fissure_x_mm": 0.0}
    read = parameters_from(known | config.parameters("reference"))
    assert read.growth_rate_per_s.at(22.0, {}) == pytest.approx(2e-7)
    assert read.maps == {"shear_modulus_core_pa"}
    assert read.shear_modulus_core_pa.at(22.0, {"shear_modulus_core_pa": 300.0}) == pytest.approx(450.0)


@pytest.mark.parametrize(
    ("growth", "brains"),
    [({}, ["a", "b", "c"]), ({"brains": ["c", "a"]}, ["a", "c"]), ({"brains": None}, ["a", "b", "c"])],
)
def test_growth_is_estimated_from_all_brains_or_those_named(growth, brains):
    assert load(study({}, growth=growth)).growth_brains == brains


def test_brains_of_one_week_give_no_growth():
    assert load({"brains": BRAINS[:1], "start": "a", "folding": {"end_week": 22}}).growth_brains == []


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
        ({"brains": []}, {}, ["growth.brains: found brains of 0 weeks; a growth rate needs two or more"]),
    ],
)
def test_brains_that_give_no_growth_rate_are_refused(growth, settings, found):
    assert growth_problems(BRAINS, growth, {"reference": settings}) == found


def test_an_estimate_without_two_weeks_is_refused_where_it_stands():
    reason = "can't be estimated: found brains of 1 week; a growth rate needs two or more"
    assert growth_problems(BRAINS[:1], None, {"x": ESTIMATED, "y": ESTIMATED}) == [
        f"folding.growth_rate_per_s: {reason}"
    ]
    assert growth_problems(BRAINS[:1], {}, {"x": ESTIMATED, "y": {}}) == [f"runs.x.growth_rate_per_s: {reason}"]
