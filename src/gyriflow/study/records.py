"""The records of a study: what is made of each brain, run and comparison, and from which files."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

from ..config.brains import Brain as GivenBrain
from ..config.runs import Run
from ..io.yaml_files import SCHEMES
from ..parameters.folding import VARYING
from ..parameters.terms import MEASURED, Side
from ..parameters.varying import Varying, bounds_of, files_of
from ..units import week_tag
from .paths import (
    CALIBRATION,
    COMPARED_MEMBER,
    FOLDING,
    MAPS,
    MASK,
    PARAMETERS,
    PIAL,
    POSE,
    READY,
    RUN,
    TARGETS,
    THICKNESS,
    region_files,
    surfaces_in,
    white_of,
)

Origin = Literal["self", "atlas"]
"""Whose growth a run has: that of the start's own series, or of another population."""
Kind = Literal["explained", "predicted"]
"""Whether growth taken from brains of a week explains the brain of this week, or it is predicted."""
Files = Mapping[str, str]


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
    regions: Files

    @property
    def folder(self) -> str:
        """The folder of its metrics."""
        return f"results/{self.where}"

    @property
    def labels(self) -> dict[str, Any]:
        """The first columns of its tables."""
        return {"subject": self.subject, "run": self.run, "week": self.week}

    @property
    def parts(self) -> dict[str, str]:
        """The files of its surfaces: of the whole, and of its hemispheres."""
        return surfaces_in(self.surfaces, self.sides)

    @property
    def hemispheres(self) -> list[str]:
        return [self.parts[side] for side in self.sides]


@dataclass(frozen=True, eq=False)
class Brain:
    """A brain, with what is known of it before it is looked at.

    Attributes
    ----------
    given
        What the configuration says of it.
    scheme
        The fields of its labels' scheme; None without labels.
    thickness_from
        What its cortical thickness is measured from: `labels` or `white` surfaces; None where it is unknown.
    white_from
        The files that its white surfaces are made from, by what they are of; none where they are not measured.
    regions_from
        How it gets regions of the cortex: they are `given`, `carried` from another brain, or `named` sulci.
    has_regions
        Whether its metrics are measured by region, too.
    checksums
        The atlas and the SHA-256 of those of its files that are an atlas's, by their paths.
    """

    given: GivenBrain
    scheme: Mapping[str, Any] | None
    thickness_from: Literal["labels", "white"] | None
    white_from: Files
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

    @property
    def label_volume(self) -> str:
        """Its label volume; only of a brain that has one."""
        assert self.given.label_volume is not None
        return self.given.label_volume

    @property
    def registered_volume(self) -> str:
        """The volume by which it is registered: its labels, or a mask made of its surface."""
        return self.label_volume if self.given.has_labels else MASK.format(brain=self.id)

    @property
    def registered(self) -> dict[str, Any]:
        """How this volume is read, and the image beside it."""
        scheme = self.scheme or SCHEMES["binary"].model_dump()
        return {"image": self.given.image, "affine_from": self.given.affine_from, "scheme": scheme}

    @property
    def to_pose(self) -> bool:
        """Whether the pose of its hemispheres has to be found, for the whole study at once."""
        return self.given.source == "hemispheres" and self.given.coordinates == "auto"

    @property
    def pose(self) -> str | list[str]:
        return POSE.format(brain=self.id) if self.to_pose else []

    @property
    def report(self) -> str:
        """The report of its surface, with its pose."""
        return PIAL["report"].format(brain=self.id)

    @property
    def pial(self) -> str:
        return PIAL["whole"].format(brain=self.id)

    @property
    def regions(self) -> Files:
        return region_files(f"results/brains/{self.id}/metrics") if self.regions_from else {}

    @property
    def white(self) -> Files:
        """Its white surfaces, maps on them and their metrics; none where they are not measured."""
        files = white_of(*self.sides) if self.white_from else {}
        return {name: file.format(brain=self.id) for name, file in files.items()}

    @cached_property
    def measured(self) -> Measured:
        return Measured(
            where=f"brains/{self.id}/metrics",
            subject=self.id,
            run=MEASURED,
            week=self.week,
            sides=self.sides,
            surfaces=f"results/brains/{self.id}/surface",
            thickness=THICKNESS["measured"].format(brain=self.id) if self.thickness_from else [],
            report=self.report,
            regions=self.regions if self.has_regions else {},
        )


@dataclass(frozen=True)
class Chain:
    """A start brain, and the brains of a growth series through which its mesh is carried, one a week.

    Attributes
    ----------
    brains
        The start first.
    correspondences
        The files that say where the points of each brain are in the next.
    posed
        For each brain and the next, whether these are points in the poses of their surfaces, or in their files' worlds.
    further_weeks
        Other weeks in which the shapes between them are wanted.
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
        """The brains that follow the start."""
        return self.brains[1:]

    @property
    def later_weeks(self) -> list[float]:
        return self.weeks[1:]

    @property
    def surfaces(self) -> list[str]:
        """The pial surfaces of the brains that follow the start."""
        return [brain.pial for brain in self.later]

    @property
    def reports(self) -> list[str]:
        """The reports of these surfaces, with their poses."""
        return [brain.report for brain in self.later]


@dataclass(frozen=True, eq=False)
class Simulation:
    """A run from one brain.

    Attributes
    ----------
    weeks
        The output weeks; the start's own is the first.
    shapes
        Whose growth gives the shapes that the run grows towards; None where it has rates or sizes.
    curves
        The table of measured curves of size, where the run follows one.
    series
        The growth series whose curves tell of sizes such as the start's.
    base
        The run whose maps it has: the calibration's base for its runs, else its own name.
    compared
        The measured brains of its later weeks, by week in file names; later scans of the start's own subject first.
    real
        The real brain of each week that tells what the run is worth.
    kind
        Whether the growth explains them, or predicts them.
    from_others_only
        Whether it is a prediction by another population's growth that has seen no later brain like the start.
    """

    run: str
    start: Brain
    settings: Run
    weeks: tuple[float, ...]
    shapes: Origin | None
    curves: str | list[str]
    series: str | None
    base: str
    compared: Mapping[str, tuple[Brain, ...]]
    real: Mapping[str, Brain]
    kind: Kind
    from_others_only: bool
    has_regions: bool

    @property
    def followed_series(self) -> str | None:
        """The growth series whose curves it follows; None where it follows none."""
        return self.series if self.curves else None

    @property
    def names(self) -> dict[str, str]:
        """Its wildcards."""
        return {"run": self.run, "brain": self.start.id}

    def file(self, pattern: str, **wildcards: str) -> str:
        """Return a file of this simulation by its pattern."""
        return pattern.format(**self.names, **wildcards)

    @property
    def week_tags(self) -> list[str]:
        """The output weeks as they stand in file names."""
        return [week_tag(week) for week in self.weeks]

    @property
    def beside(self) -> dict[str, Brain]:
        """The measured brain that it is shown beside, by week, the start at its own week."""
        return {self.week_tags[0]: self.start, **{week: brains[0] for week, brains in self.compared.items()}}

    @property
    def real_weeks(self) -> list[float]:
        """The weeks that have a real brain."""
        return [float(week) for week in self.real]

    @property
    def follows_registration(self) -> bool:
        """Whether it grows along the registrations of the brains that it is compared with."""
        return self.shapes is not None and not self.from_others_only

    @property
    def targets(self) -> str | list[str]:
        """The file with the shapes that the run grows towards."""
        return TARGETS.format(brain=self.start.id, origin=self.shapes) if self.shapes else []

    @property
    def map_sources(self) -> dict[str, dict[str, list[str]]]:
        """The user's files of each parameter that has a map, under "map" and "surface"."""
        return {
            name: {"map": files_of(value.map), "surface": files_of(value.surface)}
            for name in VARYING
            if isinstance(value := getattr(self.settings, name), Varying) and value.map is not None
        }

    @property
    def map_files(self) -> list[str]:
        return [file for files in self.map_sources.values() for file in (*files["map"], *files["surface"])]

    @property
    def map_bounds(self) -> dict[str, dict[str, float]]:
        return {name: bounds_of(type(self.settings).model_fields[name]) for name in self.map_sources}

    @property
    def maps(self) -> str | list[str]:
        """The file with the maps of its parameters and the shapes that it grows towards; none where it has neither."""
        needed = self.shapes or self.map_sources
        return MAPS.format(run=self.base, brain=self.start.id) if needed else []

    @property
    def parameters(self) -> dict[str, Any]:
        """The settings for its `params.yaml`, where a map goes by the name of its parameter.

        The number of ranks is left out, since no result depends on it.
        """
        settings = self.settings.model_dump(mode="json", exclude={"ranks", "start"})
        for name in VARYING:
            value = getattr(self.settings, name)
            if isinstance(value, Varying):
                curve = {"weeks": value.weeks} if value.weeks else {}
                settings[name] = curve | ({"map": name} if value.map is not None else {})
        return settings

    def at(self, week: float) -> Measured:
        """Return the simulated brain of a week."""
        metrics = f"runs/{self.run}/{self.start.id}/metrics"
        surfaces = f"{self.file(RUN)}/surfaces/week-{week_tag(week)}"
        return Measured(
            where=f"{metrics}/week-{week_tag(week)}",
            subject=self.start.id,
            run=self.run,
            week=float(week_tag(week)),
            sides=self.start.sides,
            surfaces=surfaces,
            thickness=f"{surfaces}/thickness.shape.gii",
            report=[],
            # those of a run hold at all its weeks
            regions=region_files(f"results/{metrics}") if self.has_regions else {},
        )

    @property
    def measured(self) -> list[Measured]:
        """The simulated brains of all its weeks."""
        return [self.at(week) for week in self.weeks]

    @property
    def validation_files(self) -> dict[str, list[str]]:
        """The surfaces that tell what the run is worth: a list over the weeks that have a real brain of each kind."""
        simulated = f"{RUN}/surfaces/week-{{week}}/pial.surf.gii"
        return {
            name: [self.file(pattern, week=week) for week in self.real]
            for name, pattern in {**READY, "simulated": simulated}.items()
        } | {"whole": [real.pial for real in self.real.values()]}

    def deviation_files(self, week: str) -> dict[str, str | list[str]]:
        """Return the files that tell how the real brain of a week deviates from the simulated one.

        Those of `thickness` are in the order of the surfaces; there are none where one is not known.
        """
        expected = self.at(float(week))
        rows = {"start": self.start.measured, "first": self.at(self.start.week), "expected": expected}
        rows["real"] = self.real[week].measured
        known = all(row.thickness for row in rows.values())
        return {
            **{name: row.parts["whole"] for name, row in rows.items()},
            "thickness": [str(row.thickness) for row in rows.values()] if known else [],
            "sides": expected.hemispheres,
            "regions": list(expected.regions.values()),
        }


@dataclass(frozen=True)
class Comparison:
    """A study of the configuration: runs that differ from one in a few parameters, compared with real brains of a week.

    Attributes
    ----------
    members
        Each run with each brain that it folds, and the varied values, in the order of the study.
    real
        The real brains that runs are compared with, by the id of their start.
    """

    name: str
    week: float
    members: tuple[tuple[Simulation, Mapping[str, Any]], ...]
    real: Mapping[str, tuple[Brain, ...]]

    @property
    def inputs(self) -> dict[str, list[str]]:
        """The files that the tables of the study are made from, member by member."""
        patterns = {"comparisons": COMPARED_MEMBER, "params": PARAMETERS}
        patterns |= {"summaries": FOLDING["summary"], "zones": FOLDING["zones"]}
        return {
            name: [member.file(pattern, study=self.name) for member, _ in self.members]
            for name, pattern in patterns.items()
        }

    @property
    def rows(self) -> list[dict[str, Any]]:
        """The run, the brain and the varied values of each member."""
        return [
            {"run": member.run, "subject": member.start.id, "values": dict(values)} for member, values in self.members
        ]

    def tables(self, run: str, brain: str) -> dict[str, list[str]]:
        """Return the tables of a run at the week of comparison and of the real brains."""
        at = f"results/runs/{run}/{brain}/metrics/week-{week_tag(self.week)}"
        folders = [at, *(real.measured.folder for real in self.real[brain])]
        return {
            "metrics": [f"{folder}/metrics.csv" for folder in folders],
            "spectra": [f"{folder}/spectra.csv" for folder in folders],
            "similarity": [f"{at}/similarity.{real.id}.csv" for real in self.real[brain]],
        }


@dataclass(frozen=True)
class Calibration:
    """Rounds of runs, each round's parameters chosen from the scores of the earlier ones.

    Attributes
    ----------
    base
        The simulations of the run that all differ from.
    rounds
        The round of each run.
    real
        The real brains to be met, by the id of the start.
    """

    week: float
    base: tuple[Simulation, ...]
    rounds: Mapping[str, int]
    real: Mapping[str, tuple[Brain, ...]]

    def runs_of(self, number: int) -> list[str]:
        """Return the runs of a round."""
        return [run for run, own in self.rounds.items() if own == number]

    def scores_before(self, number: int) -> list[str]:
        """Return the scores of all runs of the rounds before one."""
        return [f"{CALIBRATION}/scores/{run}.csv" for run, own in self.rounds.items() if own < number]

    def design(self, run: str) -> str:
        """Return the table with the parameters of a run and the others of its round."""
        return f"{CALIBRATION}/round-{self.rounds[run]}.csv"
