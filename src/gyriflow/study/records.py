"""Rows of the tables of a plan: brains, simulations, what they are compared with, and
maps between brains, with their files.

`docs/outputs.md` describes the tables.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from ..settings.brains import ShapeSettings
from ..settings.ensemble import Variation
from ..settings.growth import Origin
from ..settings.runs import Run
from ..settings.terms import OBSERVED_BRAIN, AffineSource, Coordinates, Side
from . import paths


@dataclass(frozen=True, kw_only=True)
class MeasuredBrain:
    """A brain that is measured, observed or simulated; rows of `simulated.csv` are
    simulated brains at a week.

    `id` is the brain's, of a simulated one that of the start; `run` is "observed" for
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
        return {
            "subject": self.id,
            "run": self.run,
            "week": self.week,
        }

    @property
    def parts(self) -> dict[str, str]:
        """Its surfaces: whole, left, right."""
        sides = zip(self.sides, self.hemispheres, strict=True)
        return {"whole": self.pial, **dict(sides)}

    @property
    def place(self) -> str:
        """The wildcard `where` of its folder."""
        return self.folder.removeprefix("results/")


@dataclass(frozen=True, kw_only=True)
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
    sides: tuple[Side, ...],
    surfaces: str,
    folder: str,
    regions: str | None,
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
    called "observed brain".
    """
    weeks: dict[str, list[float]] = {}
    shapes = []
    for brain in brains:
        if brain.shape is not None:
            shapes = ["simple shape"]
        else:
            name = brain.population or OBSERVED_BRAIN
            weeks.setdefault(name, []).append(brain.week)
    names = list(weeks)
    if len(names) > 1:
        names = []
        for name, own_weeks in weeks.items():
            ends = sorted({min(own_weeks), max(own_weeks)})
            names.append(f"{name} ({'-'.join(f'{week:g}' for week in ends)} GW)")
    return " or ".join(names + shapes) or OBSERVED_BRAIN


# simulations


@dataclass(frozen=True, kw_only=True)
class Simulation:
    """A run from one start brain: a row of `simulations.csv`.

    The first of the output `weeks` is that of the start brain. `kind` is `explained` if
    growth of the observed brains was an input, else `predicted`; `is_atlas_prediction`:
    growth came from another population only, without later brains of the start's.
    `growth_of` describes whose measured growth it follows. `series` is the growth
    series with curves of sizes for the start, `curves` their table if it follows them.
    `chain` is the name of the brains that its growth is measured on (see `Chain`),
    `targets` the file with the shapes that it grows towards. `base` is the run whose
    `maps` it uses: its own or the calibration's. `members` are the runs of its
    ensemble, `member_of` is the run whose ensemble has it. Runs of sweeps, of the
    calibration and of ensembles `may_diverge` without stopping the study.
    """

    run: str
    brain: str
    weeks: tuple[float, ...]
    kind: Literal["explained", "predicted"]
    is_atlas_prediction: bool
    growth_of: str
    series: str | None
    curves: str | None
    chain: str | None
    targets: str | None
    base: str
    maps: str | None
    members: tuple[str, ...]
    member_of: str | None
    has_regions: bool
    may_diverge: bool
    settings: Run

    @property
    def key(self) -> tuple[str, str]:
        return self.run, self.brain

    @property
    def names(self) -> dict[str, str]:
        """The values of its wildcards."""
        return {"run": self.run, "brain": self.brain}

    def file(self, pattern: str, **wildcards: str | float) -> str:
        """Return a file of this simulation for a pattern."""
        return paths.file_of(pattern, **self.names, **wildcards)

    @property
    def has_growth_maps(self) -> bool:
        """True if maps of the growth that it found can be written."""
        return bool(self.settings.growth.shapes) and "growth" in self.settings.fields


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """A later week of a simulation with an observed brain: a row of `compared.csv`.

    `shown` is the first brain of the week, scans of the start's own subject before
    others. `observed` is the one that the simulation is compared with, no shape;
    `adjacent` is the latest comparable brain of an earlier week.
    """

    run: str
    brain: str
    week: float
    shown: str
    observed: str | None
    adjacent: str | None


@dataclass(frozen=True, kw_only=True)
class SweepRun:
    """A run of a sweep from one start brain, with its varied values: a
    row of `sweeps.csv`.

    `member` is its name, `run` the run that simulates it, as equal runs are simulated
    once. `observed` are the brains that it is compared with at the `week` of the sweep.
    """

    sweep: str
    member: str
    week: float
    run: str
    brain: str
    values: Mapping[str, Any]
    observed: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class CalibrationRun:
    """A run of the calibration from one start brain: a row of `calibration.csv`.

    Its parameters are in the `design` of its `round`, and depend on the scores of
    earlier rounds. `observed` are the brains that it is compared with.
    """

    run: str
    round: int
    design: str
    score: str
    brain: str
    observed: tuple[str, ...]


# growth


@dataclass(frozen=True, kw_only=True)
class Link:
    """A map between two brains: a row of `links.csv`.

    It is by vertices (`is_matched`), or by registration with a factor of its
    `smoothing` and labels perturbed with a `seed` (0: unchanged). `posed` is for each
    of both whether the map refers to the pose of its surface, as for masks made from
    surfaces; otherwise it refers to the world coordinates of its files.
    """

    file: str
    earlier: str
    later: str
    is_matched: bool
    smoothing: float
    seed: int
    posed: tuple[bool, bool]


@dataclass(frozen=True, kw_only=True)
class Chain:
    """The brains through which the mesh of the first is carried, one for each week: a
    row of `chains.csv`.

    `links` are the files that map each brain to the next. `name` is the origin of
    growth, with the member of an ensemble if it has a `variation`.

    Growth of an atlas is that along its `path`, the chain `path` of all its weeks from
    its own first brain, which is named here; only the first link leads there, from the
    start to the atlas' brain of its week. Shapes are also computed for `further_weeks`.
    """

    brain: str
    name: str
    origin: Origin
    brains: tuple[str, ...]
    weeks: tuple[float, ...]
    links: tuple[str, ...]
    further_weeks: tuple[float, ...] = ()
    variation: Variation | None = None
    path: str | None = None

    @property
    def later(self) -> tuple[str, ...]:
        return self.brains[1:]


@dataclass(frozen=True, kw_only=True)
class GrowthSeries:
    """The brains of a growth series in the order of weeks: a row of `series.csv`.

    `has_rates`: its differences between weeks are growth. `unmatched` is the reason why
    surfaces of the series are not matched by their vertices.
    """

    name: str
    brains: tuple[str, ...]
    has_rates: bool
    unmatched: str | None


# brains that are left out


@dataclass(frozen=True, kw_only=True)
class LeftOut:
    """A brain that is left out, with its cause: a row of `left_out.csv`.

    `why`: it was `refused`, a row of a table that `cannot be used`, or a start brain
    that is `not folded`.
    """

    brain: str
    why: Literal["refused", "cannot be used", "not folded"]
    week: float | None
    cause: str


# files of atlases


@dataclass(frozen=True, kw_only=True)
class Download:
    """A file of an atlas that is missing, with the address and checksum from its
    description: a row of `downloads.csv`."""

    file: str
    url: str | None
    sha256: str | None
