"""The growth model of a run, by its name in the configuration."""

from collections.abc import Callable
from functools import partial

from ..geometry.diffusion import ALONE, Share
from ..geometry.triangles import Floats
from ..settings.folding import FoldingParameters
from .growth import GrowthByRates, GrowthInputs, StepModel
from .steering import SteeredGrowth
from .targets import GrowthToTargets

BUILDERS: dict[str, Callable[[FoldingParameters, GrowthInputs, Floats, Share], StepModel]] = {
    "rates": lambda p, inputs, positions_mm, share: partial(GrowthByRates, p),
    "sizes": lambda p, inputs, positions_mm, share: SteeredGrowth(p, inputs, inputs.size(positions_mm)).growth,
    "shapes": lambda p, inputs, positions_mm, share: GrowthToTargets.of(p, inputs, positions_mm, share).growth,
}
"""Functions that return a model, given the parameters, inputs, (n, 3) start positions and this rank's share of work."""


def growth_model(p: FoldingParameters, inputs: GrowthInputs, positions_mm: Floats, share: Share = ALONE) -> StepModel:
    """Return the model of a run that starts at (n, 3) positions, for ranks that `share` its work."""
    return BUILDERS[p.growth.model](p, inputs, positions_mm, share)
