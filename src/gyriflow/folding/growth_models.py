"""The growth model of a run, by its name in the configuration."""

from collections.abc import Callable
from functools import partial

from ..geometry.triangles import Floats
from ..settings.folding import FoldingParameters
from .growth import GrowthByRates, GrowthInputs, StepModel
from .steering import SteeredGrowth
from .targets import GrowthToTargets

BUILDERS: dict[str, Callable[[FoldingParameters, GrowthInputs, Floats, Callable[[int], int]], StepModel]] = {
    "rates": lambda p, inputs, positions_mm, total: partial(GrowthByRates, p),
    "sizes": lambda p, inputs, positions_mm, total: SteeredGrowth(p, inputs, inputs.size(positions_mm)).growth,
    "shapes": lambda p, inputs, positions_mm, total: GrowthToTargets.of(p, inputs, positions_mm, total).growth,
}
"""Functions that return a model, given the parameters, inputs, (n, 3) start positions and the sum over ranks."""


def growth_model(
    p: FoldingParameters, inputs: GrowthInputs, positions_mm: Floats, total: Callable[[int], int] = int
) -> StepModel:
    """Return the model of a run that starts at (n, 3) positions; `total` adds up a count over the ranks."""
    return BUILDERS[p.growth.model](p, inputs, positions_mm, total)
