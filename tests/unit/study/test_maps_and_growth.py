"""Maps and growth in a configuration: what the steps of the workflow are handed."""

import pytest
from configurations import both_kinds, labelled, problems
from facts import Facts

from gyriflow.settings.folding import mapped_parameters, plain_settings
from gyriflow.study import resolve
from gyriflow.study.loading import load


def study(folding, **others):
    return {
        "brains": labelled(21, 22, 22),
        "start": "a",
        "folding": {"end_week": 24} | folding,
        **others,
    }


def test_a_map_has_its_parameter_s_name_and_its_files_are_listed(tmp_path):
    for name in (
        "left.gii",
        "right.gii",
        "left.surf.gii",
        "right.surf.gii",
        "soft.nii.gz",
    ):
        (tmp_path / name).touch()
    mapped = {
        "thickness_mm": {
            "map": ["left.gii", "right.gii"],
            "surface": ["left.surf.gii", "right.surf.gii"],
        },
        "growth_rate_per_s": {
            "map": "left.gii",
            "surface": "left.surf.gii",
            "weeks": {30: 0.5, 21: 1},
        },
        "shear_modulus_core_pa": {"map": "soft.nii.gz"},
        "core_growth_rate_per_s": {"weeks": {25: 1e-7}},
    }
    with_maps, plain = resolve(
        load(
            study(mapped, runs={"mapped": {}, "plain": dict.fromkeys(mapped, 1e-8)}),
            tmp_path,
        )
    ).run_simulations
    settings = plain_settings(with_maps.settings)
    assert {name: settings[name] for name in mapped} == {
        "thickness_mm": {"map": "thickness_mm"},
        "growth_rate_per_s": {
            "weeks": {21.0: 1.0, 30.0: 0.5},
            "map": "growth_rate_per_s",
        },
        "shear_modulus_core_pa": {"map": "shear_modulus_core_pa"},
        "core_growth_rate_per_s": {"weeks": {25.0: 1e-7}},
    }
    assert list(settings["growth_rate_per_s"]["weeks"]) == [21.0, 30.0]
    assert "ranks" not in settings
    mapped = mapped_parameters(with_maps.settings)
    given = {name: (value.map, value.surface) for name, value in mapped.items()}
    left, right = (str(tmp_path / side) for side in ("left", "right"))
    assert given == {
        "thickness_mm": tuple(
            (f"{left}{kind}", f"{right}{kind}") for kind in (".gii", ".surf.gii")
        ),
        "growth_rate_per_s": (f"{left}.gii", f"{left}.surf.gii"),
        "shear_modulus_core_pa": (str(tmp_path / "soft.nii.gz"), None),
    }
    assert mapped_parameters(plain.settings) == {}
    assert plain_settings(plain.settings)["thickness_mm"] == 1e-8


@pytest.mark.parametrize(
    ("growth", "found"),
    [
        (
            {"brains": {"one": ["v21", "x"], "two": ["v21", "v22"]}},
            [Facts("growth.brains.one:", "x", "v21, v22, s21, s22")],
        ),
        (
            {"brains": {"one": ["v21", "s21"], "two": ["v21", "v22"]}},
            [Facts("growth.brains.one:", 1)],
        ),
        ({"brains": []}, [Facts("growth.brains:", 0)]),
        ({"brains": ["s21", "v22"]}, []),
        (
            {"series": "volumes"},
            [Facts("growth.series:", "volumes", "surface, volume")],
        ),
        ({"brains": {"one": "v21"}}, [Facts("growth.brains.one:", "v21")]),
    ],
)
def test_series_that_cannot_be_used_are_refused(tmp_path, growth, found):
    assert (
        problems(both_kinds(tmp_path, (21, 22)) | {"growth": growth}, tmp_path) == found
    )


CURVE = {21: 99, 30: 252}


@pytest.mark.parametrize(
    ("growth", "found"),
    [
        ("shapes", []),
        ({"model": "shapes", "of": "atlas"}, []),
        ({"model": "sizes", "area_cm2": CURVE}, []),
        ({"area_cm2": CURVE}, [Facts("growth.area_cm2:", "rates", "sizes")]),
        (
            {"model": "shapes", "area_cm2": CURVE},
            [Facts("growth.area_cm2:", "shapes", "sizes")],
        ),
        ({"model": "sizes", "of": "atlas"}, [Facts("growth.of:", "sizes", "shapes")]),
        ("shape", [Facts("growth.model:", "shape", "rates", "sizes", "shapes")]),
    ],
)
def test_a_growth_model_has_its_own_keys(growth, found):
    lines = problems(study({"growth": growth}))
    assert [
        line.removeprefix("folding.").removeprefix("runs.reference.") for line in lines
    ] == found


def test_a_run_keeps_the_keys_of_its_growth_model_and_leaves_those_of_another():
    runs = {
        "large": {"growth": {"area_cm2": {21: 110, 30: 280}}},
        "shapes": {"growth": "shapes"},
        "same": {"growth": "sizes"},
    }
    growth = {"model": "sizes", "area_cm2": CURVE}
    config = load(study({"growth": growth}, runs=runs))
    found = {name: config.runs[name].growth for name in runs}
    assert [(growth.model, growth.area_cm2) for growth in found.values()] == [
        ("sizes", {21: 110, 30: 280}),
        ("shapes", "measured"),
        ("sizes", CURVE),
    ]


def test_a_run_s_preset_lies_over_folding_and_its_own_keys_over_both():
    runs = {
        "plain": {},
        "paper": {"preset": "fetalfoldsim"},
        "own": {"preset": "fetalfoldsim", "thickness_mm": 3},
    }
    config = load(
        study({"preset": "expected", "thickness_mm": 2.2, "step_s": 3600}, runs=runs)
    )
    found = {
        name: (run.thickness_mm, run.step_s, run.support, run.end_week)
        for name, run in config.runs.items()
    }
    assert found == {
        "plain": (2.2, 3600, "free", 24),
        "paper": (1.5, 43200, "ellipsoid", 24),
        "own": (3, 43200, "ellipsoid", 24),
    }
