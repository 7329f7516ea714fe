"""The whole configuration."""

from collections.abc import Iterable
from typing import Any

from ..io.yaml_files import read_yaml
from .atlas import AtlasSettings, UsedAtlas
from .atlas_description import Atlas
from .base import Settings, setting
from .brains import KINDS, Brain
from .folding import VARYING, FoldingSettings, output_weeks
from .growth import GrowthSettings, estimated_from, growth_series
from .mesh import MeshSettings
from .metrics import MetricsSettings, age_reference
from .report import ReportSettings
from .schemes import SchemeSettings
from .surface import SurfaceSettings
from .varying import VaryingSettings

REAL_BRAIN = "real brain"
"""What a measured brain is called whose population is not known."""


class Config(Settings):
    """A validated configuration. `folding` is the base of every run, `runs` holds the runs' complete settings."""

    brains: tuple[Brain, ...] = setting(
        ..., "", "The brains: one the folding starts from, others to compare with and to estimate growth from. "
        "May be left out with `atlas`.",
    )  # fmt: skip
    atlas: tuple[AtlasSettings, ...] = setting(
        (), "",
        "An atlas whose weeks are brains: its name, the `atlas.yaml` of one of your own, a section, or a list of "
        "these.",
    )  # fmt: skip
    schemes: dict[str, SchemeSettings] = setting(
        {}, "", "Label schemes by name, beside those that gyriflow has; for the brains' `scheme`."
    )
    start: str = setting(..., "", "The id of the brain whose folding is simulated.")
    surface: SurfaceSettings = setting(SurfaceSettings(), "", "Pial surfaces.")
    mesh: MeshSettings = setting(MeshSettings(), "", "Tetrahedral mesh.")
    growth: GrowthSettings = setting(GrowthSettings(), "", "Growth rates.")
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
        """Returns what measured brains of these ids are called in figures and tables: their populations where known.

        Several populations have their weeks with them. Real brains of no known population are a "real brain"; shapes go
        by their kind where all are of one.
        """
        chosen = [self.brain(name) for name in brains]
        populations: dict[str, list[float]] = {}
        for brain in chosen:
            if not brain.synthetic:
                populations.setdefault(brain.population or REAL_BRAIN, []).append(brain.week)
        several = len(populations) > 1
        kinds = sorted({brain.shape.kind for brain in chosen if brain.shape is not None})
        names = [
            *(f"{name} ({_span(weeks)} GW)" if several else name for name, weeks in populations.items()),
            "phantom" if any(brain.source == "phantom" for brain in chosen) else "",
            (kinds[0] if len(kinds) == 1 else "simple shape") if kinds else "",
        ]
        return " or ".join(name for name in names if name) or REAL_BRAIN

    def scheme(self, brain: Brain) -> dict[str, Any]:
        """Returns the scheme of a brain's labels: its name, and what the configuration says about it.

        Phantoms have the labels of the example atlas.
        """
        name = brain.scheme or "spina-bifida-atlas"
        return {"name": name} | (self.schemes[name].model_dump() if name in self.schemes else {})

    @property
    def atlases(self) -> list[UsedAtlas]:
        """The atlases with what their descriptions say, as the files lie at this moment."""
        return [UsedAtlas(section, Atlas(**read_yaml(section.description))) for section in self.atlas]

    @property
    def start_week(self) -> float:
        """The gestational age at which the folding starts."""
        return self.brain(self.start).week

    def weeks(self, run: str) -> list[float]:
        """Returns the output weeks of a run, the start included."""
        settings = self.runs[run]
        return output_weeks(self.start_week, settings.end_week, settings.output_every_gw)

    @property
    def growth_series(self) -> dict[str, list[str]]:
        """The ids of the brains of each series of growth rates, by its name; none where they are all of one week."""
        kinds = {brain.id: KINDS[brain.source] for brain in self.brains}
        populations = {brain.id: brain.population for brain in self.brains}
        weeks = {brain.id: brain.week for brain in self.brains}
        return growth_series(kinds, weeks, self.growth.brains, populations)

    @property
    def estimated_from(self) -> str | None:
        """The series that `estimated` rates are taken from; None where there is no such series."""
        return estimated_from(self.growth_series, self.growth.estimated_from, self.start)

    @property
    def age_reference(self) -> list[str]:
        """The ids of the brains that ages are told from; none where they are of too few weeks."""
        return age_reference(self.brains, self.metrics.age_reference, self.brain(self.start).population)

    def parameters(self, run: str) -> dict[str, Any]:
        """Returns the settings of a run for its folding program, where a map goes by the name of its parameter.

        The number of ranks is left out, since no result depends on it.
        """
        settings = self.runs[run].model_dump(mode="json", exclude={"ranks"})
        for name, value in self._tables(run).items():
            curve = {"weeks": dict(sorted(value.weeks.items()))} if value.weeks else {}
            settings[name] = curve | ({"map": name} if value.map is not None else {})
        return settings

    def bounds(self, parameter: str) -> dict[str, float]:
        """Returns the bounds (gt, ge, le) of a parameter of the folding that may vary."""
        extra = FoldingSettings.model_fields[parameter].json_schema_extra
        assert isinstance(extra, dict)
        return dict(extra["bounds"])  # type: ignore[arg-type]

    def maps(self, run: str) -> dict[str, dict[str, list[str]]]:
        """Returns for each parameter of a run that has a map its files under "map" and "surface", none for volumes."""

        def listed(files: str | tuple[str, str] | None) -> list[str]:
            return [files] if isinstance(files, str) else list(files or ())

        return {
            name: {"map": listed(value.map), "surface": listed(value.surface)}
            for name, value in self._tables(run).items()
            if value.map is not None
        }

    def _tables(self, run: str) -> dict[str, VaryingSettings]:
        """Returns the parameters of a run that are curves or maps."""
        values = {name: getattr(self.runs[run], name) for name in VARYING}
        return {name: value for name, value in values.items() if isinstance(value, VaryingSettings)}


def _span(weeks: list[float]) -> str:
    first, last = min(weeks), max(weeks)
    return f"{first:g}" if first == last else f"{first:g}–{last:g}"
