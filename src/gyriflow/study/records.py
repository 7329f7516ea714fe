"""Records of a study: brains, simulations and sweeps as the configuration defines them,
with their files.

Brains are rows of the plan's table `brains.csv`; `docs/outputs.md` describes the
columns.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from ..settings.brains import ShapeSettings
from ..settings.folding import VARYING
from ..settings.growth import Origin
from ..settings.runs import Run, members_of
from ..settings.terms import (
    OBSERVED_BRAIN,
    AffineSource,
    Coordinates,
    Side,
)
from ..settings.varying import Varying
from . import paths


@dataclass(frozen=True, kw_only=True)
class MeasuredBrain:
    """A brain that is measured, observed or simulated.

    `id` is the brain's, of a simulated one that of the start; `run` is "real" for
    observed brains. `pial` is the surface of the whole brain, `hemispheres` those of
    its `sides`; `maps` and `regions` lie at their vertices. `folder` has its tables.
    """

    id: str
    run: str
    week: float
    sides: tuple[Side, ...]
    pial: str
    hemispheres: tuple[str, ...]
    thickness: str | None
    folder: str
    maps: tuple[str, ...]
    regions: tuple[str, ...]

    @property
    def columns(self) -> dict[str, Any]:
        """The first columns of its tables, with values."""
        return {"subject": self.id, "run": self.run, "week": self.week}

    @property
    def parts(self) -> dict[str, str]:
        """Its surfaces: whole, left, right."""
        sides = zip(self.sides, self.hemispheres, strict=True)
        return {"whole": self.pial, **dict(sides)}

    @property
    def place(self) -> str:
        """The wildcard `where` of its folder."""
        return self.folder.removeprefix("results/")


@dataclass(frozen=True, kw_only=True, eq=False)
class Brain(MeasuredBrain):
    """An observed brain, or a shape in place of one: a row of `brains.csv`.

    `files` are given, `white_files` by part of the brain; `white` and
    `white_maps` are results. `regions_of` is the brain whose regions
    it has, `thickness_of` that whose thickness fills its surface to labels.
    `checksums` has atlas and SHA-256 of its files that belong to an atlas, by path.
    """

    subject: str | None
    population: str | None
    source: str
    files: tuple[str, ...]
    labels: str | None
    scheme: str | None
    affine_from: AffineSource
    image: str | None
    white_files: Mapping[str, str]
    coordinates: Coordinates
    shape: ShapeSettings | None
    report: str
    white: tuple[str, ...]
    white_maps: tuple[str, ...]
    thickness_of: str | None
    regions_of: str | None
    group: str | None
    atlas: str | None
    checksums: Mapping[str, tuple[str, str]]
    covariates: Mapping[str, str]

    @property
    def names(self) -> dict[str, str]:
        """The values of its wildcards."""
        return {"brain": self.id}

    @property
    def subject_name(self) -> str:
        """Its subject in tables; its own id if none is named."""
        return self.subject or self.id

    @property
    def population_name(self) -> str:
        """Its population in tables; "synthetic" or "unknown" if none is named."""
        default = "unknown" if self.shape is None else "synthetic"
        return self.population or default


def measured_files(
    sides: tuple[Side, ...], surfaces: str, folder: str, regions: str | None
) -> dict[str, Any]:
    """Return the files of a brain that is measured: in the folder of its surfaces, that
    of its tables and maps, and that of its regions if it has any."""
    pial, *hemispheres = paths.surfaces_in(surfaces, sides).values()
    return {
        "sides": sides,
        "pial": pial,
        "hemispheres": tuple(hemispheres),
        "folder": folder,
        "maps": tuple(f"{folder}/{side}.shape.gii" for side in sides),
        "regions": tuple(paths.region_files(regions).values()) if regions else (),
    }


def observed_name(brains: Iterable[Brain]) -> str:
    """Return the name of observed brains in figures and tables: their populations if
    known.

    Several populations are listed with their weeks. Brains of unknown population are
    called "observed brain"; shapes are called by their kind if they share one.
    """
    weeks: dict[str, list[float]] = {}
    shapes = set()
    for brain in brains:
        if brain.shape is not None:
            shapes.add(brain.shape.kind)
        else:
            name = brain.population or OBSERVED_BRAIN
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
        growth = self.settings.growth
        if growth.follows_sizes or growth.thickness_mm == "measured":
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

    def at(self, week: float) -> MeasuredBrain:
        """Return the simulated brain at a week."""
        week_folder = paths.file_of(paths.WEEK, week=week)
        run_folder = self.file(paths.RUN)
        surfaces = f"{run_folder}/surfaces/{week_folder}"
        # the regions of a run are the same at all its weeks
        return MeasuredBrain(
            id=self.start.id,
            run=self.run,
            week=week,
            thickness=f"{surfaces}/thickness.shape.gii",
            **measured_files(
                self.start.sides,
                surfaces,
                f"{run_folder}/metrics/{week_folder}",
                f"{run_folder}/metrics" if self.has_regions else None,
            ),
        )

    @property
    def simulated(self) -> list[MeasuredBrain]:
        return [self.at(week) for week in self.weeks]

    @property
    def surfaces(self) -> dict[float, str]:
        """The surfaces of the simulated brains by week."""
        return {row.week: row.pial for row in self.simulated}


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
