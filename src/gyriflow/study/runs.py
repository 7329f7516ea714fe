"""The runs of a study: which brains they fold, up to which weeks, with which growth, and from which files."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

from ..config.root import Config
from ..parameters.folding import FoldingSettings
from ..parameters.varying import bounds_of
from ..units import week_tag
from .brains import Brains
from .paths import CURVES, GROWTH, MAPS


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

    def followed(self, run: str, key: str) -> Any:
        """Returns a setting of what the growth of a run follows, None where it follows nothing."""
        follow = self.config.run(run).follow
        return None if follow is None else getattr(follow, key)

    def regional(self, run: str) -> bool:
        """Returns whether a run's growth differs between regions or directions as measured by registration."""
        return not self.closed(run) and bool(self.followed(run, "regional") or self.followed(run, "directional"))

    def closed(self, run: str) -> bool:
        """Returns whether a run grows towards known shapes."""
        return self.followed(run, "loop") == "closed"

    def shaped(self, run: str) -> bool:
        """Returns whether a run's growth and sizes are those of shapes that its brain is to have."""
        return self.closed(run) or self.config.expects(run)

    def follows_measured(self, run: str, *keys: str) -> bool:
        """Returns whether a run follows one of some curves as it is measured."""
        return "measured" in [self.followed(run, key) for key in keys]

    def estimates(self, run: str) -> bool:
        """Returns whether a growth rate of a run is one that is estimated from the brains."""
        return "estimated" in self.config.parameters(run).values()

    def seed(self, run: str) -> int:
        """Returns the seed of the randomness in a run's growth, 0 where there is none."""
        return self.followed(run, "seed") or 0

    def base(self, run: str) -> str:
        """Returns the run whose maps and ranks a run has: the calibration's base for its runs, else itself."""
        return self.config.calibrate.base if self.config.calibrate and run in self.calibrated else run

    def ranks(self, run: str) -> int:
        """Returns the MPI ranks of a run: on one machine its threads; a cluster's profile gives each task one CPU."""
        return self.config.run(self.base(run)).ranks

    @cached_property
    def with_maps(self) -> list[str]:
        """The runs with parameters that have maps, or growth that does."""
        runs = [*self.config.runs, *self.config.study_runs]
        maps_grow = [run for run in runs if self.regional(run) or self.closed(run)]
        grown = [run for run in runs if run in maps_grow or self.followed(run, "ventricles_ml") is not None]
        return [run for run in runs if self.config.maps(run) or run in grown]

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

    def regional_settings(self, run: str) -> dict[str, Any] | None:
        """Returns how a run's growth follows what is measured where it differs between regions, else None."""
        follow = self.config.run(run).follow
        return follow.model_dump() if follow is not None and self.regional(run) else None

    def ventricle_labels(self, run: str, brain: str) -> str | list[str]:
        """Returns the labels of the start brain where the run's ventricles grow by a rate of their own."""
        return [] if self.followed(run, "ventricles_ml") is None else self.brains.label_volume(brain)

    def rates(self, run: str) -> str | list[str]:
        """Returns the table of growth rates where a run uses one of them."""
        return GROWTH["rates"] if self.estimates(run) else []

    def curves(self, run: str) -> str | list[str]:
        """Returns the table of the measured curves where a run follows one of them."""
        sizes = () if self.shaped(run) else ("area_cm2", "volume_ml")
        sizes = (*sizes, "thickness_mm", "ventricles_ml")
        return CURVES["curves"] if self.follows_measured(run, *sizes) else []

    def estimated_from(self, run: str, brain: str) -> str | None:
        """Returns the series that a run's measured growth is taken from, None where it has none."""
        return self.config.estimated_from(brain) if self.rates(run) or self.curves(run) else None
