"""All of a study in one object, part by part."""

from dataclasses import dataclass
from functools import cached_property

from ..config.root import Config
from .brains import Brains
from .chains import Chains
from .expecting import Expecting
from .measuring import Measuring
from .runs import Runs
from .studying import Calibrating, Studying
from .validating import Validating


@dataclass(frozen=True)
class Plan:
    """What a configuration asks for: its brains, runs and comparisons, without reading data."""

    config: Config

    @cached_property
    def brains(self) -> Brains:
        """What each brain is made from."""
        return Brains(self.config)

    @cached_property
    def runs(self) -> Runs:
        """What each run folds."""
        return Runs(self.config, self.brains)

    @cached_property
    def chains(self) -> Chains:
        """Which brains correspond."""
        return Chains(self.config, self.brains, self.runs)

    @cached_property
    def expecting(self) -> Expecting:
        """Which shapes runs grow towards."""
        return Expecting(self.config, self.brains, self.runs, self.chains)

    @cached_property
    def measuring(self) -> Measuring:
        """What is measured, and where."""
        return Measuring(self.config, self.brains, self.runs)

    @cached_property
    def validating(self) -> Validating:
        """What simulations are worth."""
        return Validating(self.config, self.brains, self.runs, self.chains, self.expecting, self.measuring)

    @cached_property
    def studying(self) -> Studying:
        """The members of studies."""
        return Studying(self.config, self.brains, self.runs)

    @cached_property
    def calibrating(self) -> Calibrating:
        """The runs of the calibration."""
        return Calibrating(self.config, self.runs)
