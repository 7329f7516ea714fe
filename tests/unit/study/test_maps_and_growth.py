"""Maps and growth in a configuration: what the steps of the workflow are handed."""

import yaml
from configurations import cases, labelled, problems, touched
from facts import Facts

from gyriflow.settings.folding import mapped_parameters, plain_settings
from gyriflow.study import resolve
from gyriflow.study.loading import load


def study(folding, **others):
    brains = labelled(21, 22, 22)
    folding = {"end_week": 24} | folding
    return {"brains": brains, "start": "a", "folding": folding, **others}


def test_a_map_has_its_parameter_s_name_and_its_files_are_listed(tmp_path):
    files = ("l.gii", "r.gii", "l.surf.gii", "r.surf.gii", "soft.nii.gz")
    touched(tmp_path, *files)
    text = """
    thickness_mm: {map: [l.gii, r.gii], surface: [l.surf.gii, r.surf.gii]}
    growth_rate_per_s: {map: l.gii, surface: l.surf.gii, weeks: {30: 0.5, 21: 1}}
    shear_modulus_core_pa: {map: soft.nii.gz}
    core_growth_rate_per_s: {weeks: {25: 1.0e-7}}
    """
    mapped = yaml.safe_load(text)
    runs = {"mapped": {}, "plain": dict.fromkeys(mapped, 1e-8)}
    found = resolve(load(study(mapped, runs=runs), tmp_path))
    with_maps, plain = (simulation.settings for simulation in found.run_simulations)
    settings = plain_settings(with_maps)
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
    left, right, left_surface, right_surface, soft = (str(tmp_path / f) for f in files)
    assert {
        name: (value.map, value.surface)
        for name, value in mapped_parameters(with_maps).items()
    } == {
        "thickness_mm": ((left, right), (left_surface, right_surface)),
        "growth_rate_per_s": (left, left_surface),
        "shear_modulus_core_pa": (soft, None),
    }
    assert mapped_parameters(plain) == {}
    assert plain_settings(plain)["thickness_mm"] == 1e-8


@cases(
    ("growth", "found"),
    """
    shapes | []
    {model: shapes, of: atlas} | []
    {model: sizes, area_cm2: {21: 99, 30: 252}} | []
    {area_cm2: {21: 99, 30: 252}} | [["growth.area_cm2:", rates, sizes]]
    {model: shapes, area_cm2: {21: 99}} | [["growth.area_cm2:", shapes, sizes]]
    {model: sizes, of: atlas} | [["growth.of:", sizes, shapes]]
    shape | [["growth.model:", shape, rates, sizes, shapes]]
    """,
)
def test_a_growth_model_has_its_own_keys(growth, found):
    lines = [
        line.removeprefix("folding.").removeprefix("runs.reference.")
        for line in problems(study({"growth": growth}))
    ]
    assert lines == [Facts(*facts) for facts in found]


def test_a_run_keeps_the_keys_of_its_growth_model_and_leaves_those_of_another():
    curve, larger = {21: 99, 30: 252}, {21: 110, 30: 280}
    runs = {
        "large": {"growth": {"area_cm2": larger}},
        "shapes": {"growth": "shapes"},
        "same": {"growth": "sizes"},
    }
    growth = {"model": "sizes", "area_cm2": curve}
    config = load(study({"growth": growth}, runs=runs))
    found = [config.runs[name].growth for name in runs]
    assert [(growth.model, growth.area_cm2) for growth in found] == [
        ("sizes", larger),
        ("shapes", "measured"),
        ("sizes", curve),
    ]


def test_a_run_s_preset_lies_over_folding_and_its_own_keys_over_both():
    runs = {
        "plain": {},
        "paper": {"preset": "fetalfoldsim"},
        "own": {"preset": "fetalfoldsim", "thickness_mm": 3},
    }
    folding = {"preset": "expected", "thickness_mm": 2.2, "step_s": 3600}
    found = load(study(folding, runs=runs)).runs.values()
    assert [(run.thickness_mm, run.step_s, run.support) for run in found] == [
        (2.2, 3600, "free"),
        (1.5, 43200, "ellipsoid"),
        (3, 43200, "ellipsoid"),
    ]
