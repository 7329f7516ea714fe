"""The whole configuration."""

from collections.abc import Collection, Iterable, Iterator
from functools import cached_property
from typing import Any

from pydantic import PrivateAttr, field_validator

from ..io.yaml_files import read_yaml
from ..parameters.folding import VARYING, FoldingSettings, bounds_of, output_weeks
from ..parameters.schemes import SCHEMES, LabelScheme, SchemeSettings
from ..parameters.settings import Problem, Settings, check, refused, setting
from ..parameters.synthetic import PhantomSettings
from ..parameters.varying import Varying, files_of
from . import checks
from .atlas import AtlasSettings, UsedAtlas
from .atlas_description import Atlas
from .brains import Brain
from .calibration import Calibration, calibration_problems
from .growth import GrowthSettings, estimated_from, growth_series
from .matching import believed_files, why_unmatched
from .mesh import MeshSettings
from .metrics import MetricsSettings, age_reference, reference_brains
from .participants import ParticipantsSettings
from .regions import nearest_given
from .report import ReportSettings
from .runs import Run, Start, start_ids
from .studies import Compared, Member, Study, members_of, real_brains, study_problems
from .surface import SurfaceSettings

REAL_BRAIN = "real brain"
"""Name of a measured brain of unknown population."""


class Config(Settings):
    """A validated configuration. `folding` is the base of every run, `runs` holds the runs' complete settings."""

    brains: tuple[Brain, ...] = setting(
        (), "", "The brains: those to fold, and others to compare with and to estimate growth from. Required without "
        "`atlas` and `participants`.",
    )  # fmt: skip
    atlas: tuple[AtlasSettings, ...] = setting(
        (), "",
        "An atlas whose weeks are brains: its name, the `atlas.yaml` of one of your own, a section, or a list of "
        "these.",
    )  # fmt: skip
    participants: ParticipantsSettings | None = setting(
        None, "", "A table of brains, such as the `participants.tsv` of BIDS."
    )
    schemes: dict[str, SchemeSettings] = setting({}, "", "Your own label schemes by name, for the brains' `scheme`.")
    start: Start | None = setting(
        None,
        "",
        "Id of the brain to fold, a list of ids, `first` (of the list of brains, of an atlas the earliest) or `all`; "
        "required if a run has no `start` of its own.",
    )
    surface: SurfaceSettings = setting(SurfaceSettings(), "", "Pial surfaces.")
    mesh: MeshSettings = setting(MeshSettings(), "", "Tetrahedral mesh.")
    growth: GrowthSettings = setting(GrowthSettings(), "", "Growth rates.")
    folding: FoldingSettings = setting(..., "", "Folding simulation.")
    runs: dict[str, Run] = setting(
        {}, "",
        "Runs by name, each with its `start` and what differs from `folding`; without any, one run named `reference`.",
    )  # fmt: skip
    studies: dict[str, Study] = setting(
        {},
        "",
        "Studies by name: runs that differ from one in a few parameters, compared with the real brains of a week.",
    )
    calibrate: Calibration | None = setting(None, "", "A search for the parameters that meet a real brain best.")
    metrics: MetricsSettings = setting(MetricsSettings(), "", "Metrics.")
    report: ReportSettings = setting(ReportSettings(), "", "Figures and report.")
    _left_out: dict[str, dict[str, Any]] = PrivateAttr(default_factory=dict)

    @field_validator("brains", mode="before")
    @classmethod
    def _list_of_brains(cls, value: Any) -> Any:
        if not isinstance(value, list | tuple):
            raise refused(f"found {value!r}; expected a list of brains, each with id, week and a source")
        return value

    @field_validator("runs", mode="before")
    @classmethod
    def _table_of_runs(cls, value: Any) -> Any:
        if not isinstance(value, dict):
            raise refused(f"found {value!r}; expected names, each with the settings that differ from folding")
        return value

    @check
    def _some_brains(self) -> Iterator[Problem]:
        if not self.brains and self.has("atlas") and not self.atlas:
            text = "found nothing; expected a list of brains, each with id, week and a source"
            yield Problem(text, ("brains",))

    @check
    def _names(self) -> Iterator[Problem]:
        yield from checks.name_problems(self.brains, self.runs)

    @check
    def _schemes(self) -> Iterator[Problem]:
        yield from checks.scheme_problems(self.brains, self.schemes)

    # the ids of an atlas section that is wrong are not known: these checks ask for `atlas` first

    @check
    def _starts(self) -> Iterator[Problem]:
        if self.has("atlas"):
            yield from checks.start_problems(self.start, self.brains, self.runs)

    @check
    def _runs(self) -> Iterator[Problem]:
        start = self.start if self.has("start") else None
        yield from checks.run_problems(start, self.brains, self.runs)
        yield from checks.ventricle_problems(start, self.brains, self.runs, self.schemes)

    @check
    def _growth(self) -> Iterator[Problem]:
        if self.has("atlas"):
            start = self.start if self.has("start") else None
            yield from checks.growth_problems(self.growth, start, self.brains, self.runs)

    @check
    def _mesh(self) -> Iterator[Problem]:
        if self.has("atlas", "mesh", "start") and self.mesh.sized_for == "end":
            yield from checks.mesh_size_problems(self.growth, self.start, self.brains, self.runs)

    @check
    def _studies(self) -> Iterator[Problem]:
        if self.has("atlas", "brains", "runs"):
            yield from study_problems(self.studies, self.runs, self.brains)

    @check
    def _calibrate(self) -> Iterator[Problem]:
        if self.has("atlas", "brains", "runs"):
            yield from calibration_problems(self.calibrate, self.runs, self.brains)

    @check
    def _age_reference(self) -> Iterator[Problem]:
        if self.has("atlas"):
            yield from checks.age_reference_problems(self.brains, self.metrics.age_reference)

    @check
    def _brains_of_metrics(self) -> Iterator[Problem]:
        if self.has("atlas"):
            yield from checks.metrics_problems(self.brains, self.metrics)

    def brain(self, name: str) -> Brain:
        """Returns the brain of an id; KeyError if there is none."""
        for brain in self.brains:
            if brain.id == name:
                return brain
        raise KeyError(name)

    @property
    def left_out(self) -> dict[str, dict[str, Any]]:
        """The rows of `participants` that can't be used, by id: their week, if it is known, and the cause."""
        return self._left_out

    def leave_out(self, rows: dict[str, dict[str, Any]]) -> "Config":
        """Returns the configuration with rows of `participants` that can't be used."""
        self._left_out = rows
        return self

    def without(self, names: Collection[str]) -> "Config":
        """Returns the configuration without some brains, which is left to be finished where these are refused."""
        kept = tuple(brain for brain in self.brains if brain.id not in names)
        return self.model_copy(update={"brains": kept}) if names else self

    def measured_name(self, brains: Iterable[str]) -> str:
        """Returns the name of measured brains in figures and tables: their populations if known.

        Several populations are listed with their weeks. Real brains of unknown population are called "real brain";
        shapes are called by their kind if they share one.
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
        """Returns the scheme of a brain's labels, the fields of a `LabelScheme`; for a phantom too."""
        name = brain.scheme or (brain.phantom or PhantomSettings()).scheme
        own = self.schemes.get(name)
        scheme = SCHEMES[name] if own is None else LabelScheme(name=name, **own.model_dump())
        return scheme.model_dump()

    @property
    def atlases(self) -> list[UsedAtlas]:
        """The atlases with what their descriptions say, as the files lie at this moment."""
        return [UsedAtlas(section, Atlas(**read_yaml(section.description))) for section in self.atlas]

    def run(self, name: str) -> Run:
        """Returns the complete settings of a run, of one of a study too."""
        return self.runs[name] if name in self.runs else self.study_runs[name]

    @cached_property
    def members(self) -> dict[str, list[Member]]:
        """The members of each study, by its name."""
        return members_of(
            self.studies, self.runs, lambda run, week: all(week in self.weeks(run, brain) for brain in self.starts(run))
        )

    @cached_property
    def study_runs(self) -> dict[str, Run]:
        """The runs that studies have besides those of `runs`, by name."""
        every = {member.run: member.settings for members in self.members.values() for member in members}
        return {name: run for name, run in every.items() if name not in self.runs}

    def compared_with(self, compared: Compared, brain: str) -> list[str]:
        """Returns the ids of the brains that the runs of a study or a calibration from a brain are compared with."""
        return real_brains(compared, self.brain(brain), self.brains)

    def starts(self, run: str) -> list[str]:
        """Returns the ids of the brains that a run folds, in the order of `brains`."""
        own = self.run(run).start
        return start_ids(self.start if own is None else own, [brain.id for brain in self.brains])

    @property
    def folded(self) -> list[tuple[str, str]]:
        """All (run, start brain) pairs."""
        return [(run, brain) for run in self.runs for brain in self.starts(run)]

    @property
    def start_brains(self) -> list[str]:
        """The ids of the brains that some run folds, each once, in the order of `brains`."""
        folded = {brain for _, brain in self.folded}
        return [brain.id for brain in self.brains if brain.id in folded]

    def weeks(self, run: str, brain: str) -> list[float]:
        """Returns the output weeks of a run from a start brain, whose own week is the first."""
        settings = self.run(run)
        weeks = output_weeks(self.brain(brain).week, settings.end_week, settings.output_every_gw)
        if run in self.runs:
            return weeks
        compared = {
            study.compare_week
            for name, study in self.studies.items()
            if run in [member.run for member in self.members[name]]
        }
        return sorted({*weeks, *compared})

    def last_week(self, brain: str) -> float:
        """Returns the last week that a run folds a start brain to."""
        return max(self.runs[run].end_week for run, start in self.folded if start == brain)

    @property
    def growth_series(self) -> dict[str, list[str]]:
        """The ids of the brains of each series of growth rates, by its name; none where they are all of one week."""
        kinds = {brain.id: brain.kind for brain in self.brains}
        populations = {brain.id: brain.population for brain in self.brains}
        weeks = {brain.id: brain.week for brain in self.brains}
        return growth_series(kinds, weeks, self.growth.brains, populations)

    @cached_property
    def unmatched_surfaces(self) -> dict[str, str]:
        """Why the vertices of the brains in a growth series of surfaces are not matched, by the series' name."""
        if not self.growth.matched_surfaces:
            return dict.fromkeys(self._surface_series, "growth.matched_surfaces is false")
        believed = believed_files(self.atlases)
        causes = {name: why_unmatched(brains, believed) for name, brains in self._surface_series.items()}
        return {name: cause for name, cause in causes.items() if cause is not None}

    @property
    def matched_surfaces(self) -> dict[str, set[str]]:
        """The ids of the brains of each growth series of surfaces that have the same vertices, by its name."""
        return {
            name: {brain.id for brain in brains}
            for name, brains in self._surface_series.items()
            if name not in self.unmatched_surfaces
        }

    @property
    def _surface_series(self) -> dict[str, list[Brain]]:
        """The brains of each growth series that are all from surface files, by week."""
        series = {
            name: sorted(map(self.brain, ids), key=lambda brain: brain.week) for name, ids in self.growth_series.items()
        }
        return {name: brains for name, brains in series.items() if all(brain.has_vertices for brain in brains)}

    def estimated_from(self, brain: str) -> str | None:
        """Returns the series that `estimated` rates are taken from where a brain is the start; None without one."""
        return estimated_from(self.growth_series, self.growth.estimated_from, brain)

    @property
    def age_reference(self) -> list[str]:
        """The ids of the brains from which apparent ages are estimated; none where they are of too few weeks."""
        if not self.start_brains:
            return []
        start = self.brain(self.start_brains[0])
        return age_reference(self._with_sides_of(start), self.metrics.age_reference, start.population)

    @property
    def norm_reference(self) -> list[str]:
        """The ids of the measured brains that centiles are of."""
        if not self.start_brains:
            return []
        start = self.brain(self.start_brains[0])
        return reference_brains(self._with_sides_of(start), self.metrics.norm_reference, start.population)

    def _with_sides_of(self, start: Brain) -> list[Brain]:
        """Returns the brains that have the hemispheres of a start brain: half a brain is no measure of whole ones."""
        return [brain for brain in self.brains if brain.sides == start.sides]

    def regions_from(self, brain: str) -> str | None:
        """Returns the brain whose regions a brain gets; None where no regions are given, or it has one side only."""
        if len(self.brain(brain).sides) == 1:
            return None
        return nearest_given(brain, self.metrics.regions, {brain.id: brain.week for brain in self.brains})

    @property
    def scans(self) -> dict[str, list[str]]:
        """The ids of the brains of each subject that was scanned at several weeks, by week."""
        named = {brain.subject for brain in self.brains if brain.subject is not None}
        found = {
            name: sorted((b for b in self.brains if b.subject == name), key=lambda b: b.week) for name in sorted(named)
        }
        return {name: [brain.id for brain in brains] for name, brains in found.items() if len(brains) > 1}

    def followed(self, run: str) -> list[str]:
        """Returns the metrics that the growth of a run was made to follow, or was estimated from."""
        settings = self.runs[run]
        put_in = {
            "area": settings.follow is not None or settings.growth_rate_per_s == "estimated",
            "volume": settings.follow is not None or settings.core_growth_rate_per_s == "estimated",
        }
        return [metric for metric, used in put_in.items() if used]

    def parameters(self, run: str) -> dict[str, Any]:
        """Returns the settings of a run for its `params.yaml`, where a map goes by the name of its parameter.

        The number of ranks is left out, since no result depends on it.
        """
        settings = self.run(run).model_dump(mode="json", exclude={"ranks", "start"})
        for name, value in self._tables(run).items():
            curve = {"weeks": value.weeks} if value.weeks else {}
            settings[name] = curve | ({"map": name} if value.map is not None else {})
        return settings

    def bounds(self, parameter: str) -> dict[str, float]:
        """Returns the bounds (gt, ge, le) of a parameter of the folding that may vary."""
        return bounds_of(parameter)

    def maps(self, run: str) -> dict[str, dict[str, list[str]]]:
        """Returns for each parameter of a run that has a map its files under "map" and "surface", none for volumes."""
        return {
            name: {"map": files_of(value.map), "surface": files_of(value.surface)}
            for name, value in self._tables(run).items()
            if value.map is not None
        }

    def _tables(self, run: str) -> dict[str, Varying]:
        """Returns the parameters of a run that are curves or maps."""
        values = {name: getattr(self.run(run), name) for name in VARYING}
        return {name: value for name, value in values.items() if isinstance(value, Varying)}


def _span(weeks: list[float]) -> str:
    first, last = min(weeks), max(weeks)
    return f"{first:g}" if first == last else f"{first:g}–{last:g}"
