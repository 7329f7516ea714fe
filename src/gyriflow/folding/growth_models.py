"""The growth model of a run."""

from functools import partial

from ..geometry.diffusion import ALONE, Share
from ..settings.folding import FoldingParameters
from .growth import Floats, GrowthByRates, GrowthInputs, GrowthModel
from .steering import SteeredGrowth
from .targets import GrowthToTargets


def growth_model(p: FoldingParameters, inputs: GrowthInputs, positions_mm: Floats, share: Share = ALONE) -> GrowthModel:
    """Return the model of a run that starts at (n, 3) positions, for ranks that `share` its work."""
    if p.targets:
        return GrowthToTargets.of(p, inputs, share).growth
    if p.growth.model == "sizes":
        return SteeredGrowth(p, inputs, inputs.size(positions_mm)).growth
    return partial(GrowthByRates, p)
