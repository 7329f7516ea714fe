"""The registry of growth models: each has all that the rest of gyriflow asks for, and
an unknown one is refused."""

from typing import get_args

import pytest
from facts import Facts
from pydantic import ValidationError
from shapes import ellipsoid_mesh

from gyriflow.errors import InputError
from gyriflow.folding.growth import GrowthInputs, StepGrowth, StepStart
from gyriflow.folding.growth_models import BUILDERS, growth_model
from gyriflow.folding.zones import zones_of_run
from gyriflow.report.page import methods_text
from gyriflow.settings.folding import GROWTH_RATES, FoldingSettings, parameters_from
from gyriflow.settings.growth import GROWTH_MODELS, Growth, ModelName

VALUES = {
    "start_week": 21.0,
    "end_week": 22.0,
    "fissure_x_mm": 0.0,
    "output_weeks": [21.0, 22.0],
}
RATES = dict.fromkeys(GROWTH_RATES, 3e-7)


def run_of(model, growth_of="own"):
    return {
        "parameters": {"growth": {"model": model, "of": "self"}, **RATES},
        "growth_of": growth_of,
    }


def test_a_model_is_named_in_the_configuration_the_registry_and_the_solver():
    assert set(get_args(ModelName)) == set(GROWTH_MODELS) == set(BUILDERS)
    described = Growth.model_fields["model"].description
    assert [name for name in GROWTH_MODELS if f"`{name}`" not in described] == []


@pytest.mark.parametrize("name", BUILDERS)
def test_a_model_gives_the_growth_of_a_step(name):
    mesh = ellipsoid_mesh(4, (20.0, 26.0, 18.0))
    model, sizes, targets, maps = GROWTH_MODELS[name], {}, {}, {}
    for key, size in (("area_cm2", 50.0), ("volume_ml", 30.0)):
        if key in (*model.keys, *model.resolved):
            sizes[key] = {21.0: size, 22.0: 1.1 * size}
    if model.measured == "shapes":
        targets = {22.0: "target"}
        for axis, values in zip("xyz", 1.05 * mesh.vertices.T, strict=True):
            maps[f"target_{axis}"] = values
    growth = {"model": name, **sizes}
    p = parameters_from(VALUES | {"growth": growth, "targets": targets})
    inputs = GrowthInputs(mesh, zones_of_run(mesh, p), maps)
    step = growth_model(p, inputs)(StepStart(mesh.vertices, 0.0, p.step_s))
    assert isinstance(step, StepGrowth)


@pytest.mark.parametrize("name", GROWTH_MODELS)
def test_a_model_uses_keys_that_there_are_and_refuses_all_others(name):
    model = GROWTH_MODELS[name]
    keys = set(Growth.model_fields) - {"model"}
    assert {*model.keys, *model.resolved} <= keys
    assert set(model.rates) <= set(GROWTH_RATES)
    others = {"of": "atlas", "area_cm2": {21: 9.0}, "volume_ml": {21: 9.0}}
    assert set(others) == keys
    for key in keys - {*model.keys, *model.resolved}:
        with pytest.raises(ValidationError, match=f"{key}\n.*{name}"):
            Growth(model=name, **{key: others[key]})
    for rate in GROWTH_RATES:
        values = {"end_week": 22.0, "growth": name, rate: 1e-7}
        if rate in model.rates:
            assert getattr(FoldingSettings.model_validate(values), rate) == 1e-7
        else:
            with pytest.raises(ValidationError, match=f"{rate}\n.*{name}"):
                FoldingSettings.model_validate(values)


def test_each_model_has_a_sentence_of_its_own_in_the_methods():
    template = "{{ growth_sentence(run, number) }}"
    found = {
        name: methods_text(template, run=run_of(name), number="{:g}".format)
        for name in GROWTH_MODELS
    }
    assert len(set(found.values())) == len(found)
    assert all(text[0].isupper() and text.endswith(".") for text in found.values())
    # no sentence names rates that the model does not use
    assert [name for name, text in found.items() if "3e-07" in text] == ["rates"]
    for name, model in GROWTH_MODELS.items():
        run = run_of(name, "population cohort")
        text = methods_text(template, run=run, number="{:g}".format)
        assert ("cohort" in text) == (model.measured is not None)


def test_target_shapes_are_given_to_the_models_that_need_them_and_to_no_other():
    for name, model in GROWTH_MODELS.items():
        needed = model.measured == "shapes"
        for targets in ({}, {22.0: "target_22.00"}):
            values = VALUES | {"growth": {"model": name}, "targets": targets}
            if bool(targets) == needed:
                assert parameters_from(values).targets == targets
            else:
                with pytest.raises(InputError, check=Facts("targets", name)):
                    parameters_from(values)


def test_an_unknown_model_is_refused():
    with pytest.raises(
        InputError, check=Facts("growth.model", "springs", *GROWTH_MODELS)
    ):
        parameters_from(VALUES | {"growth": {"model": "springs"}})
