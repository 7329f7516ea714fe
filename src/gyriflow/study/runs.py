"""The runs of a study: which brains they fold, up to which weeks, with which growth, and from which files."""

from dataclasses import dataclass
from functools import cached_property

from ..config.root import Config
from ..parameters.folding import FoldingSettings
from ..parameters.growth import SIZES
from ..parameters.varying import bounds_of
from ..units import week_tag
from .brains import Brains
from .paths import CURVES, MAPS


@dataclass(frozen=True)
class Runs:
    """The runs of a configuration, those of its studies and of its calibration too."""

    config: Config
    brains: Brains

    @cached_property
    def folded(self) -> list[tuple[str, str]]:
        """Every run with each of the brains that it folds, but for those of studies and of the calibration."""
        return self.config.folded

    @property
    def calibrated(self) -> dict[str, int]:
        """The round of each run of the calibration, by the run's name."""
        return self.config.calibrate.runs if self.config.calibrate else {}

    @property
    def members(self) -> list[str]:
        """The runs that may diverge: those of studies and of the calibration."""
        return [*self.config.study_runs, *self.calibrated]

    def of(self, *patterns: str) -> list[str]:
        """Returns the files of patterns for every run and each brain that it folds."""
        return [pattern.format(run=run, brain=brain) for run, brain in self.folded for pattern in patterns]

    def week_tags(self, run: str, brain: str) -> list[str]:
        """Returns the output weeks of a run from a brain as they stand in file names."""
        return [week_tag(week) for week in self.config.weeks(run, brain)]

    def grows_by(self, run: str) -> str:
        """Returns the growth model of a run."""
        return self.config.run(run).growth.model

    def measured(self, run: str, *keys: str) -> bool:
        """Returns whether a run follows one of some curves as it is measured."""
        growth = self.config.run(run).growth
        return growth.model != "rates" and "measured" in [getattr(growth, key) for key in keys]

    def base(self, run: str) -> str:
        """Returns the run whose maps and ranks a run has: the calibration's base for its runs, else itself."""
        return self.config.calibrate.base if self.config.calibrate and run in self.calibrated else run

    def ranks(self, run: str) -> int:
        """Returns the MPI ranks of a run: on one machine its threads; a cluster's profile gives each task one CPU."""
        return self.config.run(self.base(run)).ranks

    @cached_property
    def with_maps(self) -> list[str]:
        """The runs with parameters that have maps, or growth towards shapes."""
        runs = [*self.config.runs, *self.config.study_runs]
        return [run for run in runs if self.config.maps(run) or self.grows_by(run) == "shapes"]

    def maps(self, run: str, brain: str) -> str | list[str]:
        """Returns the file with the maps of a run from a brain, none where it has no maps."""
        base = self.base(run)
        return MAPS.format(run=base, brain=brain) if base in self.with_maps else []

    def map_files(self, run: str) -> list[str]:
        """Returns the user's files that the maps of a run's parameters are made from."""
        return [file for files in self.config.maps(run).values() for file in (*files["map"], *files["surface"])]

    def map_bounds(self, run: str) -> dict[str, dict[str, float]]:
        """Returns the bounds of the parameters of a run that have maps."""
        return {name: bounds_of(FoldingSettings.model_fields[name]) for name in self.config.maps(run)}

    def curves(self, run: str) -> str | list[str]:
        """Returns the table of the measured curves where a run follows one of them."""
        sizes = SIZES if self.grows_by(run) == "sizes" else ()
        return CURVES["curves"] if self.measured(run, *sizes, "thickness_mm") else []

    def estimated_from(self, run: str, brain: str) -> str | None:
        """Returns the series that a run's measured curves are taken from, None where it has none."""
        return self.config.estimated_from(brain) if self.curves(run) else None
