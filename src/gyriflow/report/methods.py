"""The methods of a study in words."""

from collections.abc import Callable, Mapping
from typing import Any

from jinja2 import Environment, StrictUndefined

from ..settings.growth import GROWTH_MODELS
from ..settings.terms import FUSED_AFTER_GW
from .labels import atlas_label


def methods_text(template: str, **used: Any) -> str:
    """Return the methods of a study as reStructuredText, with citations, from a
    template.

    The template gets `growth_sentence(run, number)`, the sentence of the run's growth
    model, where `number` formats numbers; `fused_after_gw`; and `atlas_label`.
    """

    environment = Environment(undefined=StrictUndefined, keep_trailing_newline=True)
    return environment.from_string(template).render(
        growth_sentence=_growth_sentence,
        fused_after_gw=FUSED_AFTER_GW,
        atlas_label=atlas_label,
        **used,
    )


def _growth_sentence(
    run: Mapping[str, Any],
    number: Callable[[Any], str],
) -> str:
    model = run["parameters"]["growth"]["model"]
    return GROWTH_MODELS[model].sentence(run, number)
