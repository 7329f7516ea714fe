"""The growth model of a run, by its name in the configuration."""

from collections.abc import Callable
from functools import partial

from ..settings.folding import FoldingParameters
from .growth import GrowthByRates, GrowthInputs, StepModel
from .steering import steered_growth
from .targets import growth_on_path, path_of_run

BUILDERS: dict[str, Callable[[FoldingParameters, GrowthInputs], StepModel]] = {
    "rates": lambda p, inputs: partial(GrowthByRates, p),
    "sizes": lambda p, inputs: partial(
        steered_growth, p, inputs, inputs.size(inputs.mesh.vertices)
    ),
    "shapes": lambda p, inputs: partial(
        growth_on_path, p, inputs, path_of_run(p, inputs)
    ),
}
"""Functions that return a model, given the parameters and inputs of a run."""


def growth_model(p: FoldingParameters, inputs: GrowthInputs) -> StepModel:
    """Return the model of a run."""
    return BUILDERS[p.growth.model](p, inputs)
