"""The whole configuration."""

from collections.abc import Iterable

from .base import Settings, setting
from .brains import Brain
from .folding import FoldingSettings, output_weeks
from .mesh import MeshSettings
from .metrics import MetricsSettings
from .report import ReportSettings
from .surface import SurfaceSettings


class Config(Settings):
    """A validated configuration. `folding` is the base of every run, `runs` holds the runs' complete settings."""

    brains: tuple[Brain, ...] = setting(
        ..., "", "The brains: one the folding starts from, others to compare with and to estimate growth from."
    )
    start: str = setting(..., "", "The id of the brain whose folding is simulated.")
    surface: SurfaceSettings = setting(SurfaceSettings(), "", "Pial surfaces.")
    mesh: MeshSettings = setting(MeshSettings(), "", "Tetrahedral mesh.")
    folding: FoldingSettings = setting(..., "", "Folding simulation.")
    runs: dict[str, FoldingSettings] = setting(
        {}, "", "Runs by name, each with what differs from `folding`; without any, one run named `reference`."
    )
    metrics: MetricsSettings = setting(MetricsSettings(), "", "Metrics.")
    report: ReportSettings = setting(ReportSettings(), "", "Figures and report.")

    def brain(self, name: str) -> Brain:
        """Returns the brain of an id; KeyError if there is none."""
        for brain in self.brains:
            if brain.id == name:
                return brain
        raise KeyError(name)

    def measured_name(self, brains: Iterable[str]) -> str:
        """Returns what measured brains of these ids are called in figures: phantoms only where all of them are."""
        phantoms = [self.brain(name).source == "phantom" for name in brains]
        if any(phantoms):
            return "phantom" if all(phantoms) else "real brain or phantom"
        return "real brain"

    @property
    def start_week(self) -> float:
        """The gestational age at which the folding starts."""
        return self.brain(self.start).week

    def weeks(self, run: str) -> list[float]:
        """Returns the output weeks of a run, the start included."""
        settings = self.runs[run]
        return output_weeks(self.start_week, settings.end_week, settings.output_every_gw)
