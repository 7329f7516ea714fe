"""The models that tissue grows by, and which one a run has."""

from dataclasses import dataclass

from ..parameters.folding import FoldingParameters
from .growth import Floats, Growth, GrowthByRates, GrowthInputs, GrowthModel, StepStart
from .steering import SteeredGrowth
from .targets import GrowthToTargets


@dataclass(frozen=True, eq=False)
class PrescribedGrowth:
    """The model of growth by the run's own rates."""

    parameters: FoldingParameters

    def growth(self, start: StepStart) -> Growth:
        """Returns the growth of a step."""
        return GrowthByRates(self.parameters, start)


def growth_model(p: FoldingParameters, inputs: GrowthInputs, positions_mm: Floats) -> GrowthModel:
    """Returns the model of a run that starts at (n, 3) positions."""
    if p.targets:
        return GrowthToTargets.of(p, inputs)
    return SteeredGrowth(p, inputs, inputs.size(positions_mm)) if p.growth.model == "sizes" else PrescribedGrowth(p)


def growth_at_start(p: FoldingParameters, inputs: GrowthInputs, positions_mm: Floats) -> Growth:
    """Returns the growth of the first step of a run that starts at (n, 3) positions."""
    return growth_model(p, inputs, positions_mm).growth(StepStart(positions_mm, 0.0, p.step_s))
