"""The registry of growth models: each has all that the rest of gyriflow asks for, and
an unknown one is refused."""

from typing import get_args

import pytest
from facts import Facts
from pydantic import ValidationError

from gyriflow.errors import InputError
from gyriflow.folding.growth_models import BUILDERS
from gyriflow.report.methods import methods_text
from gyriflow.settings.folding import GROWTH_RATES, FoldingSettings, parameters_from
from gyriflow.settings.growth import GROWTH_MODELS, Growth, ModelName

VALUES = {
    "start_week": 21.0,
    "end_week": 22.0,
    "fissure_x_mm": 0.0,
    "output_weeks": [21.0, 22.0],
}


def test_a_model_is_named_in_the_configuration_the_registry_and_the_solver():
    assert set(get_args(ModelName)) == set(GROWTH_MODELS) == set(BUILDERS)
    described = Growth.model_fields["model"].description
    assert [name for name in GROWTH_MODELS if f"`{name}`" not in described] == []


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
    sentences = set()
    for name, model in GROWTH_MODELS.items():
        growth = {"model": name, "of": "self"}
        parameters = {"growth": growth, **dict.fromkeys(GROWTH_RATES, 3e-7)}
        run = {"parameters": parameters, "growth_of": "population cohort"}
        text = methods_text(template, run=run, number="{:g}".format)
        # it names what the model uses only
        assert ("3e-07" in text) == (name == "rates")
        assert ("cohort" in text) == (model.measured is not None)
        sentences.add(text)
    assert len(sentences) == len(GROWTH_MODELS)


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
