"""The growth model of a run."""

from functools import partial

from ..parameters.folding import FoldingParameters
from .growth import Floats, Growth, GrowthByRates, GrowthInputs, GrowthModel, StepStart
from .steering import SteeredGrowth
from .targets import GrowthToTargets


def growth_model(p: FoldingParameters, inputs: GrowthInputs, positions_mm: Floats) -> GrowthModel:
    """Returns the model of a run that starts at (n, 3) positions."""
    if p.targets:
        return GrowthToTargets.of(p, inputs).growth
    return (
        SteeredGrowth(p, inputs, inputs.size(positions_mm)).growth
        if p.growth.model == "sizes"
        else partial(GrowthByRates, p)
    )


def growth_at_start(p: FoldingParameters, inputs: GrowthInputs, positions_mm: Floats) -> Growth:
    """Returns the growth of the first step of a run that starts at (n, 3) positions."""
    return growth_model(p, inputs, positions_mm)(StepStart(positions_mm, 0.0, p.step_s))
