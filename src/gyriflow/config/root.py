"""The whole configuration."""

from collections.abc import Collection, Iterable, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

from pydantic import Field, PrivateAttr, field_validator

from ..errors import InputError
from ..io.yaml_files import SCHEMES, read_keys
from ..parameters.folding import VARYING, FoldingSettings, output_weeks
from ..parameters.schemes import LabelScheme, SchemeSettings
from ..parameters.settings import Settings
from ..parameters.varying import Varying, files_of
from ..units import week_tag
from .atlas import Atlas, AtlasSettings, UsedAtlas
from .brains import Brain
from .participants import ParticipantsSettings
from .runs import (
    ALL,
    FIRST,
    Calibration,
    Compared,
    GrowthSettings,
    Member,
    Run,
    RunName,
    Start,
    Study,
    StudyName,
    estimated_from,
    growth_series,
    members_of,
)
from .stages import MeshSettings, MetricsSettings, ReportSettings, SurfaceSettings

REAL_BRAIN = "real brain"
"""Name of a measured brain of unknown population."""


class Config(Settings):
    """All keys stand in these sections; `folding` is the base of every run."""

    brains: tuple[Brain, ...] = ()
    """The brains: those to fold, and others to compare with and to estimate growth from."""
    atlas: tuple[AtlasSettings, ...] = ()
    """Atlases whose weeks are brains: a name, the `atlas.yaml` of your own, a section, or a list of these."""
    participants: ParticipantsSettings | None = None
    """A table of brains, such as the `participants.tsv` of BIDS."""
    schemes: dict[str, SchemeSettings] = Field({})
    """Your own label schemes by name, for the brains' `scheme`."""
    start: Start | None = None
    """Id of the brain to fold, a list of ids, `first` (of the list, of an atlas the earliest) or `all`."""
    surface: SurfaceSettings = SurfaceSettings()
    """Pial surfaces."""
    mesh: MeshSettings = MeshSettings()
    """Tetrahedral mesh."""
    growth: GrowthSettings = GrowthSettings()
    """Growth rates."""
    folding: FoldingSettings
    """Folding simulation."""
    runs: dict[RunName, Run] = Field({})
    """Runs by name, each with its `start` and what differs from `folding`; `{}`: one run named `reference`."""
    studies: dict[StudyName, Study] = Field({})
    """Studies by name: runs that differ in a few parameters, compared with real brains."""
    calibrate: Calibration | None = None
    """A search for the parameters that meet a real brain best."""
    metrics: MetricsSettings = MetricsSettings()
    """Metrics."""
    report: ReportSettings = ReportSettings()
    """Figures and report."""
    _left_out: dict[str, dict[str, Any]] = PrivateAttr(default_factory=dict)

    @field_validator("atlas", mode="before", json_schema_input_type=AtlasSettings | tuple[AtlasSettings, ...])
    @classmethod
    def _one_or_several(cls, value: Any) -> Any:
        return [value] if isinstance(value, str | dict) else value

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

    def without(self, names: Collection[str], *, unfolded: Collection[str] = ()) -> "Config":
        """Returns the configuration without some brains, which is left to be finished where these are refused.

        Those that are `unfolded` are kept, but no run starts from them. No other brain is folded in their place.
        """
        if not names and not unfolded:
            return self
        kept = tuple(brain for brain in self.brains if brain.id not in names)
        left = {
            run: tuple(brain for brain in self.starts(run) if brain not in {*names, *unfolded}) for run in self.runs
        }
        runs = {name: run.model_copy(update={"start": left[name]}) for name, run in self.runs.items()}
        return self.model_copy(update={"brains": kept, "runs": runs})

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
            (kinds[0] if len(kinds) == 1 else "simple shape") if kinds else "",
        ]
        return " or ".join(name for name in names if name) or REAL_BRAIN

    def scheme(self, brain: Brain) -> dict[str, Any]:
        """Returns the scheme of a brain's labels, the fields of a `LabelScheme`."""
        name = brain.scheme
        assert name is not None
        own = self.schemes.get(name)
        scheme = SCHEMES[name] if own is None else LabelScheme(name=name, **own.model_dump())
        return scheme.model_dump()

    @property
    def atlases(self) -> list[UsedAtlas]:
        """The atlases with what their descriptions say, as the files lie at this moment."""
        return [UsedAtlas(section, Atlas(**read_keys(section.description))) for section in self.atlas]

    @cached_property
    def known_files(self) -> dict[str, tuple[str, str]]:
        """The atlas and the SHA-256 of each file of an atlas where it is known, by the file's path."""
        return {path: known for used in self.atlases for path, known in used.checksums.items()}

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
        if compared.compare_with is not None:
            return list(compared.compare_with)
        of_week = [other for other in self.brains if other.week == compared.compare_week]
        own = [other for other in of_week if other.population == self.brain(brain).population]
        return [other.id for other in own or of_week]

    def starts(self, run: str) -> list[str]:
        """Returns the ids of the brains that a run folds, in the order of `brains`."""
        brains, own = [brain.id for brain in self.brains], self.run(run).start
        start = self.start if own is None else own
        if start == FIRST:
            return brains[:1]
        named = brains if start == ALL else [start] if isinstance(start, str) else start or ()
        return [brain for brain in brains if brain in named]

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
            foretold = any(self.expects(other) for other, start in self.folded if start == brain)
            compared = set(self.compared_weeks(brain) if foretold else ())
        else:
            compared = {
                study.compare_week
                for name, study in self.studies.items()
                if run in [member.run for member in self.members[name]]
            }
        known = {week_tag(week) for week in weeks}
        return sorted([*weeks, *(week for week in compared if week < weeks[-1] and week_tag(week) not in known)])

    def expects(self, run: str) -> bool:
        """Returns whether a run has the growth of another population than the start's."""
        growth = self.run(run).growth
        return growth.model == "shapes" and growth.of == "atlas"

    def comparable(self, brain: str) -> list[Brain]:
        """Returns the brains that a start brain may be compared with.

        They have the same hemispheres, and are of its population where it has one.
        """
        own, sides = self.brain(brain).population, self.brain(brain).sides
        return [other for other in self.brains if own in (None, other.population) and other.sides == sides]

    def compared_weeks(self, brain: str) -> list[float]:
        """Returns the weeks after a start brain of the real brains that it may be compared with, one a file name."""
        start = self.brain(brain).week
        later = [other.week for other in self.comparable(brain) if other.week > start and not other.synthetic]
        return list({week_tag(week): week for week in sorted(later)}.values())

    @property
    def ends(self) -> list[tuple[str, str, float]]:
        """Run, start brain and last week of all that is folded, for studies and the calibration too."""
        ends = [(run, self.run(run).end_week) for run in (*self.runs, *self.study_runs)]
        if self.calibrate is not None:
            ends.append((self.calibrate.base, self.calibrate.compare_week))
        return [(run, brain, end) for run, end in ends for brain in self.starts(run)]

    def last_week(self, brain: str) -> float:
        """Returns the last week that a start brain is folded to."""
        return max(end for _, start, end in self.ends if start == brain)

    @property
    def growth_series(self) -> dict[str, list[str]]:
        """The ids of the brains of each series of growth rates, by its name; none where they are all of one week."""
        return growth_series(self.brains, self.growth.brains)

    @cached_property
    def unmatched_surfaces(self) -> dict[str, str]:
        """Why the vertices of the brains in a growth series of surfaces are not matched, by the series' name.

        The surfaces are read for this, but for files of an atlas that are missing still: its description is believed.
        """
        if not self.growth.matched_surfaces:
            return dict.fromkeys(self._surface_series, "growth.matched_surfaces is false")
        believed = {str(f.path) for used in self.atlases for f in used.missing if used.atlas.series[f.series].matched}
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
        """Returns the series that measured curves are taken from where a brain is the start; None without one."""
        return estimated_from(self.growth_series, self.growth.estimated_from, brain)

    def own_series(self, brain: str) -> str:
        """Returns the growth series that a brain is in, of several that of `growth.estimated_from`; "" for none."""
        own = [name for name, ids in self.growth_series.items() if brain in ids]
        return min(own, key=lambda name: name != self.growth.estimated_from, default="")

    def other_series(self, brain: str) -> list[str]:
        """Returns the growth series of other populations with a brain's hemispheres; of several, that of
        `growth.estimated_from` alone where it is one."""
        start = self.brain(brain)
        own = start.population
        others = [
            name
            for name, ids in self.growth_series.items()
            if brain not in ids
            and all(own is None or self.brain(other).population != own for other in ids)
            and all(self.brain(other).sides == start.sides for other in ids)
        ]
        named = self.growth.estimated_from
        return [named] if named in others else others

    @property
    def norm_reference(self) -> list[str]:
        """The ids of the measured brains that others are compared with: the given ones, or else all real ones.

        They have the hemispheres of the first start brain: half a brain is no measure of whole ones. If none are given
        and the real ones are of several populations, those of the start's are used.
        """
        if not self.start_brains:
            return []
        start, given = self.brain(self.start_brains[0]), self.metrics.norm_reference
        brains = [brain for brain in self.brains if brain.sides == start.sides]
        real = [brain for brain in brains if not brain.synthetic]
        if len({brain.population for brain in real}) > 1:
            real = [brain for brain in real if brain.population == start.population]
        chosen = real if given is None else [brain for brain in brains if brain.id in given]
        return [brain.id for brain in chosen]

    def regions_from(self, brain: str) -> str | None:
        """Returns the brain whose regions a brain gets; None where no regions are given, or it has one side only."""
        if len(self.brain(brain).sides) == 1:
            return None
        given, week = self.metrics.regions, self.brain(brain).week
        return (
            brain if brain in given else min(given, key=lambda other: abs(self.brain(other).week - week), default=None)
        )

    @property
    def scans(self) -> dict[str, list[str]]:
        """The ids of the brains of each subject that was scanned at several weeks, by week."""
        named = {brain.subject for brain in self.brains if brain.subject is not None}
        found = {
            name: sorted((b for b in self.brains if b.subject == name), key=lambda b: b.week) for name in sorted(named)
        }
        return {name: [brain.id for brain in brains] for name, brains in found.items() if len(brains) > 1}

    def parameters(self, run: str) -> dict[str, Any]:
        """Returns the settings of a run for its `params.yaml`, where a map goes by the name of its parameter.

        The number of ranks is left out, since no result depends on it.
        """
        settings = self.run(run).model_dump(mode="json", exclude={"ranks", "start"})
        for name, value in self._tables(run).items():
            curve = {"weeks": value.weeks} if value.weeks else {}
            settings[name] = curve | ({"map": name} if value.map is not None else {})
        return settings

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


def why_unmatched(brains: Sequence[Brain], believed: Collection[str] = ()) -> str | None:
    """Returns why the surfaces of brains are not matched by their vertices; None where they are.

    They are where all brains are given by surface files of one kind, with as many vertices and the same triangles for
    each hemisphere. Files that are `believed` to be so need not be there.
    """
    # files are looked at where growth by vertices is planned, which few configurations ask for
    from ..io.surfaces import connectivity

    first = brains[0]
    for brain in brains:
        if brain.source != first.source:
            return f"{brain.id} is given as {brain.source}, {first.id} as {first.source}"
    known: list[tuple[str, list[tuple[int, int, str]]]] = []
    for brain in brains:
        if believed and all(path in believed for path in brain.files):
            continue
        try:
            known.append((brain.id, [connectivity(Path(path)) for path in brain.files]))
        except InputError as error:
            return str(error)
        (name, expected), (other, found) = known[0], known[-1]
        for one, two in zip(expected, found, strict=True):
            if one[:2] != two[:2]:
                return f"{other} has {two[0]} vertices and {two[1]} triangles where {name} has {one[0]} and {one[1]}"
            if one != two:
                return f"{other} has other triangles than {name}"
    return None
