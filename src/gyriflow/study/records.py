"""The records of a study: what is known of each brain, run and comparison before data are read, and their files."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

from ..io.volumes import LabelSource
from ..io.yaml_files import SCHEMES
from ..settings.brains import Brain as GivenBrain
from ..settings.folding import VARYING
from ..settings.runs import Run
from ..settings.terms import MEASURED, Side
from ..settings.varying import Varying
from . import paths

Origin = Literal["self", "atlas"]
"""Whose growth a run has: that of the start's own series, or of another population."""


@dataclass(frozen=True)
class Measured:
    """A brain that is measured, real or simulated.

    `where` is the folder of its metrics under `results`. `subject` is its id, of a simulated brain that of the start,
    `run` is "real" for real brains. `surfaces` is the folder of its surfaces. Of what is not known there are no files:
    the thickness of its cortex, the report with the volumes of its tissues, its regions by side.
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
    def labels(self) -> dict[str, Any]:
        """The first columns of its tables."""
        return {"subject": self.subject, "run": self.run, "week": self.week}

    @property
    def parts(self) -> dict[str, str]:
        """The files of its surfaces: of the whole, and of its hemispheres."""
        return paths.surfaces_in(self.surfaces, self.sides)

    @property
    def hemispheres(self) -> list[str]:
        return [self.parts[side] for side in self.sides]

    @property
    def maps(self) -> list[str]:
        """The files with the maps on its hemispheres."""
        return [f"{self.folder}/{side}.shape.gii" for side in self.sides]


@dataclass(frozen=True, eq=False)
class Brain:
    """A brain of the study, as `given` by the configuration.

    `labels` is None where it is given by surfaces. Where it `has_thickness` or `has_white`, the thickness of its cortex
    and its white surfaces are measured, from its labels or from given white surfaces. Regions of the cortex are
    `given`, `carried` from another brain, or `named` sulci; its metrics are measured by them where it `has_regions`.
    `checksums` are the atlas and the SHA-256 of those of its files that are an atlas's, by path.
    """

    given: GivenBrain
    labels: LabelSource | None
    has_thickness: bool
    has_white: bool
    regions_from: Literal["given", "carried", "named"] | None
    has_regions: bool
    checksums: Mapping[str, tuple[str, str]]

    @property
    def id(self) -> str:
        return self.given.id

    @property
    def week(self) -> float:
        return self.given.week

    @property
    def sides(self) -> tuple[Side, ...]:
        return self.given.sides

    @property
    def subject(self) -> str:
        """The subject that it is a scan of: itself where none is named."""
        return self.given.subject or self.id

    @property
    def population(self) -> str:
        """What it is called in tables: its population, or synthetic or unknown."""
        return self.given.population or ("synthetic" if self.given.synthetic else "unknown")

    def comparable(self, brains: Iterable["Brain"]) -> list["Brain"]:
        """Return the brains that it may be compared with: of its hemispheres, its population and subject if it has any.

        A brain without a subject, as of an atlas, may be compared with any.
        """
        population, subject = self.given.population, self.given.subject
        alike = [one for one in brains if population in (None, one.given.population) and one.sides == self.sides]
        return [one for one in alike if None in (subject, one.given.subject) or one.given.subject == subject]

    @property
    def registered(self) -> LabelSource:
        """The volume by which it is registered: its labels, or a mask made of its surface."""
        return self.labels or LabelSource(paths.MASK.format(brain=self.id), "auto", SCHEMES["binary"])

    @property
    def pial(self) -> str:
        return paths.PIAL["whole"].format(brain=self.id)

    @property
    def report(self) -> str:
        """The report of its surface, with its pose."""
        return paths.PIAL["report"].format(brain=self.id)

    @property
    def regions(self) -> Mapping[str, str]:
        return paths.region_files(f"results/brains/{self.id}/metrics") if self.regions_from else {}

    @cached_property
    def measured(self) -> Measured:
        return Measured(
            where=f"brains/{self.id}/metrics",
            subject=self.id,
            run=MEASURED,
            week=self.week,
            sides=self.sides,
            surfaces=f"results/brains/{self.id}/surface",
            thickness=paths.THICKNESS["measured"].format(brain=self.id) if self.has_thickness else [],
            report=self.report,
            regions=self.regions if self.has_regions else {},
        )


@dataclass(frozen=True)
class Chain:
    """A start brain, and the brains of a growth series through which its mesh is carried, one a week.

    The files `correspondences` say where the points of each brain are in the next, `posed` for the two whether these
    are in the poses of their surfaces or in the worlds of their files. Shapes are wanted in `further_weeks`, too.
    """

    brains: tuple[Brain, ...]
    correspondences: tuple[str, ...]
    posed: tuple[list[bool], ...]
    further_weeks: tuple[float, ...]

    @property
    def weeks(self) -> list[float]:
        return [brain.week for brain in self.brains]

    @property
    def later(self) -> tuple[Brain, ...]:
        return self.brains[1:]

    @property
    def later_weeks(self) -> list[float]:
        return self.weeks[1:]

    @property
    def surfaces(self) -> list[str]:
        return [brain.pial for brain in self.later]

    @property
    def reports(self) -> list[str]:
        return [brain.report for brain in self.later]


@dataclass(frozen=True, eq=False)
class Simulation:
    """A run from one brain.

    The start's own week is the first of the output `weeks`. `shapes` says whose growth gives the shapes that it grows
    towards; None where it has rates or sizes. `series` is the growth series with curves of sizes for the start, and
    `curves` their table where the run follows one. It has the maps of the run `base`: the calibration's for its runs.

    `compared` are the measured brains of its later weeks, by week, later scans of the start's own subject first; `real`
    the one of each week that tells what the run is worth. These are `explained` by growth that knows them, or else
    `predicted`: `from_others_only` by another population's, which has seen no later brain like the start.
    """

    run: str
    start: Brain
    settings: Run
    weeks: tuple[float, ...]
    shapes: Origin | None
    series: str | None
    curves: str | list[str]
    base: str
    compared: Mapping[float, tuple[Brain, ...]]
    real: Mapping[float, Brain]
    kind: Literal["explained", "predicted"]
    from_others_only: bool
    has_regions: bool

    @property
    def names(self) -> dict[str, str]:
        """Its wildcards."""
        return {"run": self.run, "brain": self.start.id}

    def file(self, pattern: str, **wildcards: str | float) -> str:
        """Return a file of this simulation by its pattern."""
        return paths.file_of(pattern, **self.names, **wildcards)

    @property
    def measured_by_week(self) -> dict[float, Brain]:
        """The measured brain that it is shown beside, by week, the start at its own week."""
        return {self.weeks[0]: self.start, **{week: brains[0] for week, brains in self.compared.items()}}

    @property
    def follows_registration(self) -> bool:
        """Whether it grows along the registrations of the brains that it is compared with."""
        return self.shapes is not None and not self.from_others_only

    @property
    def followed_series(self) -> str | None:
        """The growth series whose curves it follows; None where it follows none."""
        return self.series if self.curves else None

    @property
    def targets(self) -> str | list[str]:
        """The file with the shapes that the run grows towards."""
        return paths.TARGETS.format(brain=self.start.id, origin=self.shapes) if self.shapes else []

    @property
    def mapped(self) -> dict[str, Varying]:
        """Its parameters that the user gives a map of."""
        values = {name: getattr(self.settings, name) for name in VARYING}
        return {name: value for name, value in values.items() if isinstance(value, Varying) and value.map is not None}

    @property
    def maps(self) -> str | list[str]:
        """The file with the maps of its parameters and the shapes that it grows towards; none where it has neither."""
        return paths.MAPS.format(run=self.base, brain=self.start.id) if self.shapes or self.mapped else []

    @property
    def parameters(self) -> dict[str, Any]:
        """The settings for its `params.yaml`, where a map goes by the name of its parameter.

        The number of ranks is left out, since no result depends on it.
        """
        settings = self.settings.model_dump(mode="json", exclude={"ranks", "start"})
        settings["growth"] = self.settings.growth.own_keys()
        for name in VARYING:
            if isinstance(value := getattr(self.settings, name), Varying):
                curve = {"weeks": value.weeks} if value.weeks else {}
                settings[name] = curve | ({"map": name} if value.map is not None else {})
        return settings

    def at(self, week: float) -> Measured:
        """Return the simulated brain of a week."""
        metrics, of_week = f"runs/{self.run}/{self.start.id}/metrics", paths.file_of(paths.WEEK, week=week)
        surfaces = f"{self.file(paths.RUN)}/surfaces/{of_week}"
        return Measured(
            where=f"{metrics}/{of_week}",
            subject=self.start.id,
            run=self.run,
            week=week,
            sides=self.start.sides,
            surfaces=surfaces,
            thickness=f"{surfaces}/thickness.shape.gii",
            report=[],
            # those of a run hold at all its weeks
            regions=paths.region_files(f"results/{metrics}") if self.has_regions else {},
        )

    @property
    def measured(self) -> list[Measured]:
        return [self.at(week) for week in self.weeks]


@dataclass(frozen=True)
class Comparison:
    """What the configuration calls a study: runs that differ in a few parameters, beside real brains of one week.

    `members` are each run with each brain that it folds, and the varied values, in the order of the study; `real` are
    the brains that runs from a start are compared with, by its id.
    """

    name: str
    week: float
    members: tuple[tuple[Simulation, Mapping[str, Any]], ...]
    real: Mapping[str, tuple[Brain, ...]]


@dataclass(frozen=True)
class CalibrationRuns:
    """Rounds of runs that differ from those of `base`, each round's parameters chosen from the scores of earlier ones.

    `rounds` has the round of each run, `real` the brains to be met by the id of the start.
    """

    base: tuple[Simulation, ...]
    rounds: Mapping[str, int]
    real: Mapping[str, tuple[Brain, ...]]

    def scores_before(self, number: int) -> list[str]:
        """Return the scores of all runs of the rounds before one."""
        return [f"{paths.CALIBRATION}/scores/{run}.csv" for run, of_run in self.rounds.items() if of_run < number]

    def design(self, run: str) -> str:
        """Return the table with the parameters of a run and the others of its round."""
        return f"{paths.CALIBRATION}/round-{self.rounds[run]}.csv"
