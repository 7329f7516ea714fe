"""Settings report all that is wrong with them at once, with the path of each key."""

from collections.abc import Iterator

import pytest
from pydantic import Field, ValidationError

from gyriflow.parameters.settings import Problem, Settings, dotted, messages


class Layer(Settings):
    """Bounds of a layer."""

    top: float = Field(0.0, ge=0)
    bottom: float = Field(1.0, ge=0)
    name: str = Field(pattern="^[a-z]+$")

    def problems(self) -> Iterator[Problem]:
        if self.bottom <= self.top:
            yield Problem(f"found {self.bottom:g}; it should be above {self.top:g}", ("bottom",))
        if len(self.name) > 3:
            yield Problem("is too {long}", ("name",))


class Stack(Settings):
    """Layers with a total."""

    layers: tuple[Layer, ...] = ()
    named: dict[str, Layer] = Field({})
    total: float = Field(10.0, gt=0)


def problems(kind, raw):
    with pytest.raises(ValidationError) as caught:
        kind.model_validate(raw)
    return {dotted(path): text for path, text in messages(caught.value, kind)}


def test_all_wrong_keys_are_named_and_checks_wait_until_each_is_valid():
    assert problems(Layer, {"top": -1, "bottom": 0, "naem": "x"}) == {
        "top": "Input should be greater than or equal to 0; found -1",
        "name": "Field required",
        "naem": "unknown key; did you mean name?",
    }
    assert problems(Layer, {"top": 2, "name": "long"}) == {
        "name": "is too {long}",
        "bottom": "found 1; it should be above 2",
    }


def test_problems_in_lists_and_tables_have_their_paths():
    wrong = {"layers": [{"name": "A"}, 7], "named": {"x": {"top": 3, "name": "x"}, "y": {"tpo": 1, "name": "y"}}}
    assert problems(Stack, wrong) == {
        "layers[0].name": "String should match pattern '^[a-z]+$'; found 'A'",
        "layers[1]": "Input should be a valid dictionary or instance of Layer; found 7",
        "named.x.bottom": "found 1; it should be above 3",
        "named.y.tpo": "unknown key; did you mean top?",
    }


def test_nothing_given_is_all_defaults_and_truth_values_are_no_numbers():
    assert Stack.model_validate({"layers": []}) == Stack() == Stack.model_validate(None)
    assert problems(Stack, {"total": True}) == {"total": "should be a number or text, not true or false; found True"}
