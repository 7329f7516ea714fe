"""The whole configuration."""

from typing import Any

from pydantic import Field, PrivateAttr, field_validator, model_validator

from .atlas import AtlasSettings
from .base import Settings
from .brains import BrainConfig, ParticipantsSettings
from .folding import FoldingSettings
from .runs import (
    CalibrationSettings,
    GrowthSettings,
    Run,
    RunName,
    Start,
    SweepName,
    SweepSettings,
    complete_runs,
)
from .schemes import SchemeSettings
from .stages import MeshSettings, MetricsSettings, SurfaceSettings

FOLDING_SECTIONS = ("start", "folding", "runs", "sweeps", "calibrate")
"""Sections that are absent if a study only measures."""


class Config(Settings):
    """All keys stand in these sections; `folding` is the base of every run."""

    brains: tuple[BrainConfig, ...] = ()
    """The brains: those to fold, and others to compare with and to estimate growth
    from."""
    atlas: tuple[AtlasSettings, ...] = ()
    """Atlases whose weeks are brains: a name, the `atlas.yaml` of your own, a section,
    or a list of these."""
    participants: ParticipantsSettings | None = None
    """A table of brains, such as the `participants.tsv` of BIDS."""
    schemes: dict[str, SchemeSettings] = Field({})
    """Your own label schemes by name, for the brains' `scheme`."""
    start: Start | None = None
    """Id of the brain to fold, a list of ids, `first` (of the list, of an atlas the
    earliest) or `all`."""
    surface: SurfaceSettings = SurfaceSettings()
    """Pial surfaces."""
    mesh: MeshSettings = MeshSettings()
    """Tetrahedral mesh."""
    growth: GrowthSettings = GrowthSettings()
    """Growth rates."""
    folding: FoldingSettings | None = None
    """Folding simulation; `null`, and no `start` or other key of folding: brains are
    measured only."""
    runs: dict[RunName, Run] = Field({})
    """Runs by name, each with its `start` and what differs from `folding`; `{}`: one
    run named `reference`."""
    sweeps: dict[SweepName, SweepSettings] = Field({})
    """Sweeps by name: runs that differ in a few parameters, compared with observed
    brains."""
    calibrate: CalibrationSettings | None = None
    """A search for the parameters that meet an observed brain best."""
    metrics: MetricsSettings = MetricsSettings()
    """Metrics."""
    _left_out: dict[str, dict[str, Any]] = PrivateAttr(default_factory=dict)
    _age_sources: dict[str, str] = PrivateAttr(default_factory=dict)

    @model_validator(mode="before")
    @classmethod
    def _fill_in_presets(cls, raw: Any) -> Any:
        if not isinstance(raw, dict):
            return raw
        sections = [raw.get(section) for section in FOLDING_SECTIONS]
        if all(section is None for section in sections):
            return raw
        return complete_runs(raw)

    @field_validator(
        "atlas",
        mode="before",
        json_schema_input_type=AtlasSettings | tuple[AtlasSettings, ...],
    )
    @classmethod
    def _one_or_several(cls, value: Any) -> Any:
        return [value] if isinstance(value, str | dict) else value

    def brain(self, name: str) -> BrainConfig:
        """Return the brain of an id; KeyError if there is none."""
        for brain in self.brains:
            if brain.id == name:
                return brain
        raise KeyError(name)

    @property
    def left_out(self) -> dict[str, dict[str, Any]]:
        """The rows of `participants` that can't be used, by id: their week, if it is
        known, and the cause."""
        return self._left_out

    @property
    def age_sources(self) -> dict[str, str]:
        """The table and column of the ages of brains from `participants`, by id."""
        return self._age_sources

    @property
    def measured_only(self) -> "Config":
        """This configuration without simulations."""
        fields = type(self).model_fields
        absent = {name: fields[name].get_default() for name in FOLDING_SECTIONS}
        return self.model_copy(update=absent)
