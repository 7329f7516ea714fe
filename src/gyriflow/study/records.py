"""Records of a study: brains, simulations and sweeps as the configuration defines them,
with their files."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

from ..io.volumes import LabelSource
from ..settings.brains import BrainConfig
from ..settings.folding import VARYING
from ..settings.growth import Origin
from ..settings.runs import Run, members_of
from ..settings.schemes import FILLED
from ..settings.terms import MEASURED, OBSERVED_BRAIN, Side
from ..settings.varying import Varying
from . import paths


@dataclass(frozen=True)
class Measurement:
    """The files of one measured brain, observed or simulated.

    `where` is the folder of its metrics under `results`, `surfaces` that of its
    surfaces. `subject` is the brain's id, for a simulated brain that of the start;
    `run` is "real" for observed brains. Files of thickness, report (volumes of tissues)
    and regions (by side) are empty if they are not made.
    """

    where: str
    subject: str
    run: str
    week: float
    sides: tuple[Side, ...]
    surfaces: str
    thickness: str | list[str]
    report: str | list[str]
    regions: Mapping[str, str]

    @property
    def folder(self) -> str:
        return f"results/{self.where}"

    @property
    def spectra(self) -> str:
        return f"{self.folder}/spectra.csv"

    @property
    def labels(self) -> dict[str, Any]:
        """The first columns of its tables, with values."""
        return {"subject": self.subject, "run": self.run, "week": self.week}

    @property
    def parts(self) -> dict[str, str]:
        """The files of its surfaces: whole, left, right."""
        return paths.surfaces_in(self.surfaces, self.sides)

    @property
    def hemispheres(self) -> list[str]:
        return [self.parts[side] for side in self.sides]

    @property
    def maps(self) -> list[str]:
        """The files with the vertex maps of its hemispheres."""
        return [f"{self.folder}/{side}.shape.gii" for side in self.sides]

    @property
    def halves(self) -> list[list[str]]:
        """Its hemispheres, each with its maps."""
        return _pairs(self.hemispheres, self.maps)

    @property
    def halves_with_regions(self) -> list[list[str]]:
        """Its hemispheres, each with its regions."""
        return _pairs(self.hemispheres, self.regions.values())


def _pairs(surfaces: Iterable[str], files: Iterable[str]) -> list[list[str]]:
    pairs = zip(surfaces, files, strict=True)
    return [list(pair) for pair in pairs]


@dataclass(frozen=True, eq=False)
class Brain:
    """A brain of the study; `config` is its entry in the configuration.

    `labels` is None if it is defined by surfaces. `has_thickness`, `has_white`: there
    are results for its cortical thickness and its white surfaces, from labels or from
    white surfaces of the configuration. `regions_from` is the source of its regions:
    given for this brain, carried from another brain, or None without regions.
    `checksums` has atlas and SHA-256 of its files that belong to an atlas, by path.
    """

    config: BrainConfig
    labels: LabelSource | None
    has_thickness: bool
    has_white: bool
    regions_from: Literal["given", "carried"] | None
    checksums: Mapping[str, tuple[str, str]]

    @property
    def id(self) -> str:
        return self.config.id

    @property
    def names(self) -> dict[str, str]:
        """The values of its wildcards."""
        return {"brain": self.id}

    @property
    def week(self) -> float:
        return self.config.week

    @property
    def sides(self) -> tuple[Side, ...]:
        return self.config.sides

    @property
    def source(self) -> str:
        return self.config.source

    @property
    def subject(self) -> str:
        """The subject that was scanned; the brain's own id if none is named."""
        return self.config.subject or self.id

    @property
    def population(self) -> str:
        """Its population in tables; "synthetic" or "unknown" if none is named."""
        if self.config.population is not None:
            return self.config.population
        return "synthetic" if self.config.synthetic else "unknown"

    def comparable(self, brains: Iterable["Brain"]) -> list["Brain"]:
        """Return the brains with the same hemispheres, population and subject.

        A brain without a population or subject, as of an atlas, may be compared with
        any.
        """
        population = self.config.population
        subject = self.config.subject
        comparable = []
        for brain in brains:
            is_of_population = population in (None, brain.config.population)
            is_of_subject = subject is None or brain.config.subject in (None, subject)
            if brain.sides == self.sides and is_of_population and is_of_subject:
                comparable.append(brain)
        return comparable

    @property
    def registered(self) -> LabelSource:
        """The volume for its registration: its labels, or those that its surfaces are
        filled with."""
        if self.labels is not None:
            return self.labels
        filled = paths.FILLED_LABELS.format(brain=self.id)
        return LabelSource(filled, "auto", FILLED)

    @property
    def pial(self) -> str:
        return paths.PIAL["whole"].format(brain=self.id)

    @property
    def report(self) -> str:
        """The report of its surface, which contains its pose."""
        return paths.PIAL["report"].format(brain=self.id)

    @property
    def has_regions(self) -> bool:
        """Whether its metrics are also measured by region."""
        return self.regions_from is not None

    @property
    def regions(self) -> Mapping[str, str]:
        if not self.has_regions:
            return {}
        return paths.region_files(f"results/brains/{self.id}/metrics")

    @cached_property
    def measurement(self) -> Measurement:
        thickness: str | list[str] = []
        if self.has_thickness:
            thickness = paths.THICKNESS["measured"].format(brain=self.id)
        return Measurement(
            where=f"brains/{self.id}/metrics",
            subject=self.id,
            run=MEASURED,
            week=self.week,
            sides=self.sides,
            surfaces=f"results/brains/{self.id}/surface",
            thickness=thickness,
            report=self.report,
            regions=self.regions,
        )


def observed_name(brains: Iterable[Brain]) -> str:
    """Return the name of observed brains in figures and tables: their populations if
    known.

    Several populations are listed with their weeks. Brains of unknown population are
    called "observed brain"; shapes are called by their kind if they share one.
    """
    weeks: dict[str, list[float]] = {}
    shapes = set()
    for brain in brains:
        if brain.config.shape is not None:
            shapes.add(brain.config.shape.kind)
        else:
            name = brain.config.population or OBSERVED_BRAIN
            weeks.setdefault(name, []).append(brain.week)
    names = list(weeks)
    if len(names) > 1:
        names = []
        for name, of_name in weeks.items():
            ends = sorted({min(of_name), max(of_name)})
            names.append(f"{name} ({'-'.join(f'{week:g}' for week in ends)} GW)")
    if len(shapes) == 1:
        names.append(shapes.pop())
    elif shapes:
        names.append("simple shape")
    return " or ".join(names) or OBSERVED_BRAIN


@dataclass(frozen=True, eq=False)
class Simulation:
    """A run from one start brain.

    The first of the output `weeks` is that of the start brain. `series` is the growth
    series with curves of sizes for the start. `base` is the run whose maps it uses: its
    own or the calibration's.

    `observed_brains` are the observed brains of its later weeks, by week, scans of the
    start's own subject first. `observed`: the brain each week is compared with. `kind`
    is `explained` if that brain's growth was an input, else `predicted`.
    `is_atlas_prediction`: growth came from another population only, without later
    brains of the start's. A member of an ensemble is a simulation itself, with
    `member_of` the name of its run.
    """

    run: str
    start: Brain
    settings: Run
    weeks: tuple[float, ...]
    series: str | None
    base: str
    observed_brains: Mapping[float, tuple[Brain, ...]]
    observed: Mapping[float, Brain]
    kind: Literal["explained", "predicted"]
    is_atlas_prediction: bool
    has_regions: bool
    member_of: str | None = None

    @property
    def shapes(self) -> Origin | None:
        """The source of the shapes that it grows towards; None for growth by rates or
        sizes."""
        return self.settings.growth.shapes

    @property
    def has_growth_rate(self) -> bool:
        """Whether its cortex grows at a rate of the settings."""
        return "growth_rate_per_s" in self.settings.growth.definition.rates

    @property
    def curves(self) -> str | list[str]:
        """The table of the curves of measured sizes, if it follows one."""
        if self.settings.growth.follows_sizes:
            return paths.CURVES["curves"]
        return []

    @property
    def ensemble(self) -> tuple[str, ...]:
        """The names of its members."""
        return tuple(members_of(self.run, self.settings))

    @property
    def chain(self) -> str | None:
        """The name of the brains that its growth is measured on, or None (see
        `Study.chains`)."""
        if self.shapes and self.member_of:
            return f"{self.shapes}.{self.run}"
        return self.shapes

    @property
    def names(self) -> dict[str, str]:
        """The values of its wildcards."""
        return {"run": self.run, "brain": self.start.id}

    def file(self, pattern: str, **wildcards: str | float) -> str:
        """Return a file of this simulation for a pattern."""
        return paths.file_of(pattern, **self.names, **wildcards)

    @property
    def observed_with_start(self) -> dict[float, Brain]:
        """The first observed brain of each week, with the start brain at its own
        week."""
        observed = {week: brains[0] for week, brains in self.observed_brains.items()}
        return {self.weeks[0]: self.start} | observed

    @property
    def followed_series(self) -> str | None:
        """The growth series whose curves it follows, or None."""
        return self.series if self.curves else None

    @property
    def targets(self) -> str | list[str]:
        """The file with the shapes that the run grows towards; empty if there are
        none."""
        if self.chain is None:
            return []
        return paths.TARGETS.format(brain=self.start.id, origin=self.chain)

    @property
    def atlas_surface(self) -> str:
        """The file with the atlas' own brain in the last week of a prediction."""
        return self.file(paths.ATLAS_BRAIN, week=self.weeks[-1])

    @property
    def has_growth_maps(self) -> bool:
        """Whether maps of the growth that it found can be written."""
        return self.shapes is not None and "growth" in self.settings.fields

    @property
    def mapped(self) -> dict[str, Varying]:
        """Its parameters that have a map."""
        mapped = {}
        for name in VARYING:
            value = getattr(self.settings, name)
            if isinstance(value, Varying) and value.map is not None:
                mapped[name] = value
        return mapped

    @property
    def maps(self) -> str | list[str]:
        """The file with the maps of its parameters and its target shapes; empty if it
        has neither."""
        if self.shapes or self.mapped:
            return paths.MAPS.format(run=self.base, brain=self.start.id)
        return []

    @property
    def parameters(self) -> dict[str, Any]:
        """The settings for its `params.yaml`. A map has the name of its parameter.

        The number of ranks is left out, since results do not depend on it.
        """
        settings = self.settings.model_dump(
            mode="json", exclude={"ranks", "start", "ensemble"}
        )
        settings["growth"] = self.settings.growth.own_keys()
        for name in VARYING:
            value = getattr(self.settings, name)
            if isinstance(value, Varying):
                settings[name] = {"weeks": value.weeks} if value.weeks else {}
            if name in self.mapped:
                settings[name]["map"] = name
        return settings

    def at(self, week: float) -> Measurement:
        """Return the measurement of the simulated brain at a week."""
        metrics = f"runs/{self.run}/{self.start.id}/metrics"
        week_folder = paths.file_of(paths.WEEK, week=week)
        surfaces = f"{self.file(paths.RUN)}/surfaces/{week_folder}"
        # the regions of a run are the same at all its weeks
        regions = paths.region_files(f"results/{metrics}") if self.has_regions else {}
        return Measurement(
            where=f"{metrics}/{week_folder}",
            subject=self.start.id,
            run=self.run,
            week=week,
            sides=self.start.sides,
            surfaces=surfaces,
            thickness=f"{surfaces}/thickness.shape.gii",
            report=[],
            regions=regions,
        )

    @property
    def measurements(self) -> list[Measurement]:
        return [self.at(week) for week in self.weeks]

    @property
    def surfaces(self) -> dict[float, str]:
        """The surfaces of the simulated brains by week."""
        return {row.week: row.parts["whole"] for row in self.measurements}


@dataclass(frozen=True)
class Sweep:
    """A sweep (key `studies`): runs that differ in a few parameters, compared with
    observed brains of one week.

    `members` are its simulations with the varied values, in order. `observed` are the
    brains that simulations from a start brain are compared with, by the id of the start
    brain.
    """

    name: str
    week: float
    members: tuple[tuple[Simulation, Mapping[str, Any]], ...]
    observed: Mapping[str, tuple[Brain, ...]]

    @property
    def names(self) -> dict[str, str]:
        return {"study": self.name, "week": f"{self.week:g}"}

    @property
    def first_start(self) -> Brain:
        """The start brain of the first run."""
        simulation, _ = self.members[0]
        return simulation.start

    @property
    def first_observed(self) -> tuple[Brain, ...]:
        """The first brain that runs from this start are compared with, if any."""
        return self.observed[self.first_start.id][:1]


@dataclass(frozen=True)
class CalibrationRuns:
    """Rounds of runs that differ from `base`. The parameters of a round depend on the
    scores of earlier rounds.

    `rounds` has the round of each run, `observed` the target brains by the id of the
    start brain.
    """

    base: tuple[Simulation, ...]
    rounds: Mapping[str, int]
    observed: Mapping[str, tuple[Brain, ...]]

    def scores_before(self, number: int) -> list[str]:
        """Return the score files of all runs in earlier rounds."""
        earlier = [run for run, of_run in self.rounds.items() if of_run < number]
        return [f"{paths.CALIBRATION}/scores/{run}.csv" for run in earlier]

    def design(self, run: str) -> str:
        """Return the table with the parameters of all runs in the round of a run."""
        return f"{paths.CALIBRATION}/round-{self.rounds[run]}.csv"
