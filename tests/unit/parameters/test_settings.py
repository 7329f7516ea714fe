"""Settings report all that is wrong with them at once, with the path of each key."""

from collections.abc import Iterator

import pytest
from pydantic import ValidationError

from gyriflow.parameters.settings import Problem, Settings, check, dotted, messages, setting


class Layer(Settings):
    """Bounds of a layer."""

    top: float = setting(0.0, "mm", "Its top.", ge=0)
    bottom: float = setting(1.0, "mm", "Its bottom.", ge=0)
    name: str = setting(..., "", "Its name.")

    @check
    def _bottom_below_top(self) -> Iterator[Problem]:
        if self.bottom <= self.top:
            yield Problem(f"found {self.bottom:g}; it should be above {self.top:g}", ("bottom",))

    @check
    def _short_name(self) -> Iterator[Problem]:
        if len(self.name) > 3:
            yield Problem("is too {long}", ("name",))


class Stack(Settings):
    """Layers with a total."""

    layers: tuple[Layer, ...] = setting((), "", "The layers.")
    named: dict[str, Layer] = setting({}, "", "Others.")
    total: float = setting(10.0, "mm", "Their height.", gt=0)

    @check
    def _total(self) -> Iterator[Problem]:
        depth = max((layer.bottom for layer in self.layers), default=0.0)
        if depth > self.total:
            yield Problem(f"found {self.total:g}; the layers reach {depth:g}", ("total",))


def found(kind, raw):
    with pytest.raises(ValidationError) as caught:
        kind.model_validate(raw)
    return {dotted(path): text for path, text in messages(caught.value, kind)}


def test_all_wrong_keys_are_named_and_checks_wait_until_each_is_valid():
    assert found(Layer, {"top": -1, "naem": "x"}) == {
        "top": "found -1; it should be greater than or equal to 0",
        "name": "is missing",
        "naem": "unknown key; did you mean name?",
    }
    assert found(Layer, {"top": 2, "bottom": 1, "name": "long"}) == {
        "name": "is too {long}",
        "bottom": "found 1; it should be above 2",
    }
    assert found(Layer, {"bottom": 0, "name": "a"}) == {"bottom": "found 0; it should be above 0"}


def test_problems_in_lists_and_tables_have_their_paths():
    wrong = {"layers": [{"name": 1, "bottom": 30}, 7], "named": {"x": {"top": 3, "name": "x"}}}
    assert found(Stack, wrong) == {
        "layers[0].name": "found 1; it should be a valid string",
        "layers[1]": "found 7; it should hold keys and values",
        "named.x.bottom": "found 1; it should be above 3",
    }
    assert found(Stack, {"layers": [{"name": "a", "bottom": 30}]}) == {"total": "found 10; the layers reach 30"}


def test_nothing_given_is_all_defaults_and_truth_values_are_no_numbers():
    assert Stack.model_validate({"layers": []}) == Stack() == Stack.model_validate(None)
    assert found(Stack, {"total": True}) == {"total": "found True; it should be a number or text, not true or false"}


def test_bounds_of_texts_and_lists_read_as_sentences():
    class Named(Settings):
        """A name and a pair."""

        name: str = setting("a", "", "Letters.", pattern="^[a-z]+$")
        pair: tuple[int, ...] = setting((1, 2), "", "Two or more.", min_length=2)

    with pytest.raises(ValidationError) as caught:
        Named.model_validate({"name": "A 1", "pair": [1]})
    said = [text for _, text in messages(caught.value, Named)]
    assert said[0] == "found 'A 1'; it should match pattern '^[a-z]+$'"
    assert said[1].startswith("found [1]; it should have at least 2 items")
