"""Runs, and what differs between them: growth's series of brains, studies, calibration."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from typing import Annotated, Any

from pydantic import ConfigDict, Discriminator, Field, Tag

from .base import KeyProblem, Settings
from .brains import Brain
from .folding import FoldingSettings
from .growth import SIZES
from .terms import LONGEST_NAME, SCORES, Score
from .varying import EndWeek

ALL = "all"
"""The word for all brains in `start`."""
FIRST = "first"
"""The word for the first brain of `brains` in `start`: of an atlas its earliest, if no other stands before it."""

Start = Annotated[
    Annotated[str, Tag("(id)")] | Annotated[tuple[str, ...], Tag("(list)")],
    Discriminator(lambda value: "(list)" if isinstance(value, list | tuple) else "(id)"),
]
"""The id of a brain, a list of ids, `first` or `all`."""

RunName = Annotated[str, Field(pattern=r"^[^\W_][\w.-]*$", max_length=LONGEST_NAME)]
StudyName = Annotated[str, Field(pattern=r"^[^\W_][\w-]*$", max_length=LONGEST_NAME)]
"""Names of folders: letters, digits and these marks, first a letter or digit."""

FREE_GROWTH: dict[str, Any] = {
    "step_s": 86_400.0,
    "stress_memory_gw": 0.0,
    "shear_modulus_cortex_pa": 300.0,
    "shear_modulus_core_pa": 300.0,
    "support": "free",
    "contact": {"kind": "global"},
    "no_growth": {"kind": "none"},
}
"""Everything grows and nothing is held; with a cortex as stiff as the core, growth makes the folds, not buckling."""

PRESETS: dict[str, dict[str, Any]] = {
    # the paper's model, whatever the defaults become; its linear elements are `order: 1` of the mesh
    "fetalfoldsim": {
        "step_s": 43_200.0,
        "growth": {"model": "rates"},
        "thickness_mm": 1.5,
        "shear_modulus_cortex_pa": 1500.0,
        "shear_modulus_core_pa": 300.0,
        "material": "neo-hookean",
        "poisson_ratio": 0.45,
        "growth_rate_per_s": 2.0e-7,
        "radial_growth_rate_per_s": 0.0,
        "core_growth_rate_per_s": 0.0,
        "stress_memory_gw": 0.0,
        "support": "ellipsoid",
        "contact": {"kind": "planes", "gap_mm": 2.5},
        "no_growth": {"kind": "ellipsoid", "shift": [0.05, -0.15], "semi_axes": [0.35, 0.40, 0.50]},
    },
    # growth that takes the brain to its measured shapes
    "measured": {**FREE_GROWTH, "growth": {"model": "shapes"}},
    # the brain as it is to be expected: as `measured`, towards where the growth of another population would take it
    "expected": {**FREE_GROWTH, "growth": {"model": "shapes", "of": "atlas"}},
}
"""Sets of parameters by name, from which a configuration starts; its own keys come on top."""


class Run(FoldingSettings):
    """The complete settings of a run: those of `folding` with the run's own on top."""

    model_config = ConfigDict(json_schema_extra={"type": ["object", "null"], "required": []})

    start: Start | None = None
    """Id of the brain that is folded, a list of ids, `first` or `all`; `null`: the study's `start`."""

    # unlike `folding`, it may have rates that its growth model does not use; parameters hold the sizes of the shapes
    def problems(self) -> Iterator[KeyProblem]:
        for key in SIZES:
            if self.growth.model == "shapes" and getattr(self.growth, key) != "measured":
                yield KeyProblem("has no meaning with the model shapes; expected sizes", ("growth", key))


def starts_of(study_start: Start | None, run: Run, ids: Sequence[str]) -> list[str]:
    """Return those of the ids of all brains that a run folds."""
    start = study_start if run.start is None else run.start
    if start == FIRST:
        return list(ids[:1])
    named = ids if start == ALL else [start] if isinstance(start, str) else start or ()
    return [brain for brain in ids if brain in named]


# growth

Names = tuple[str, ...]
Series = Annotated[
    Annotated[Names, Tag("(list)")] | Annotated[dict[str, Names], Tag("(table)")],
    Discriminator(lambda value: "(table)" if isinstance(value, dict) else "(list)"),
]


class GrowthSettings(Settings):
    """Which brains growth is measured on."""

    brains: Series | None = None
    """Ids of the brains whose areas and volumes are used, of at least two weeks; or several such lists by name,
    as `{surface: [...], volume: [...]}`. `null`: all brains. Each subject and each population is then a series of
    its own, as are surfaces (`surface`) and label volumes (`volume`) if both have two weeks. Only a series by name
    may chain several subjects, such as all: `{cohort: [all]}`."""
    series: str | None = None
    """Series that gives measured curves or an atlas' growth, of several; `null`: the start brain's."""
    matched_surfaces: bool = True
    """Whether equal vertices and triangles of a series' surfaces mean equal places, so that brains
    correspond without registration."""


def growth_series(
    brains: Sequence[Brain], given: Sequence[str] | Mapping[str, Sequence[str]] | None
) -> dict[str, list[str]]:
    """Return the ids of the brains of each series of growth rates, without series of fewer than two weeks.

    `given` is the setting `brains`, whose ids must be known. Only a series that it names may have several subjects or
    mix populations; `all` stands for all brains. A hemisphere that is alone shares none with whole brains or with the
    other one.
    """
    series: dict[str, Sequence[Brain]] = {}
    if isinstance(given, Mapping):
        series = {name: [brain for brain in brains if brain.id in ids or ALL in ids] for name, ids in given.items()}
    else:
        groups: dict[tuple[str | None, str | None, str], list[Brain]] = {}
        for brain in brains:
            if given is None or brain.id in given:
                side = f"{brain.sides[0]} hemisphere" if len(brain.sides) == 1 else ""
                groups.setdefault((brain.subject, brain.population, side), []).append(brain)
        for (subject, population, side), members in groups.items():
            by_kind = _series_by_kind(members)
            for kind, chosen in by_kind.items():
                parts = [subject or "", population or "", side]
                parts += [kind] if len(by_kind) > 1 or not (subject or population) else []
                series[", ".join(part for part in parts if part) if len(groups) > 1 else kind] = chosen
    return {name: [brain.id for brain in members] for name, members in series.items() if _ages(members) > 1}


def _series_by_kind(brains: Sequence[Brain]) -> dict[str, Sequence[Brain]]:
    volumes = [brain for brain in brains if brain.has_labels]
    surfaces = [brain for brain in brains if not brain.has_labels]
    by_kind: dict[str, Sequence[Brain]] = {"surface": surfaces, "volume": volumes}
    given = {kind: members for kind, members in by_kind.items() if members}
    # a kind with a single age can only be compared across kinds
    return given if len(given) == 1 or all(_ages(members) > 1 for members in given.values()) else {"all": brains}


def _ages(brains: Sequence[Brain]) -> int:
    return len({brain.week for brain in brains})


# studies and calibration

Value = Annotated[
    Annotated[float, Tag("(number)")] | Annotated[str, Tag("(text)")],
    Discriminator(lambda value: "(text)" if isinstance(value, str) else "(number)"),
]
"""A value of a parameter that a study varies."""
NOT_VARIED = ("preset", "start", "end_week", "ranks", "output_every_gw", "fields")
"""Keys of a run that say nothing of its model, or that the study sets."""
CURVES = tuple(f"growth.{size}" for size in SIZES)
"""Further curves than those of parameters that may vary."""
MOST_PARAMETERS = 3
LEAST_FIRST_RUNS, MOST_RUNS = 3, 40
"""Of a calibration."""


class Compared(Settings):
    """What runs are compared with: real brains of a week."""

    base: str
    """Name of the run that all others differ from."""
    compare_week: EndWeek
    """Week of the comparison, at which the runs end. [GW]"""
    compare_with: tuple[str, ...] | None = None
    """Ids of the real brains of that week to compare with; `null`: all of the start's population, or of any if
    it has none."""


class Study(Compared):
    """A run for each combination of the varied values, compared with real brains of `compare_week`.

    Equal runs are solved once. A run that diverges is reported in the study's tables, and the others go on.
    """

    vary: dict[str, tuple[Value, ...]]
    """Values of one or more keys of `folding`, such as `{thickness_mm: [0.8, 1.5]}`; inner keys with dots
    (`contact.gap_mm`)."""
    fixed: dict[str, Value] = Field({})
    """Keys of `folding` that differ from the base's in all runs."""
    fixed_at: dict[float, dict[str, Value]] = Field({})
    """The same for the runs of single values of the first varied key, such as `{1.5: {step_s: 43200}}`."""

    def changes(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Return all keys by which the run of some varied values differs from the base."""
        at_first = next((self.fixed_at.get(first, {}) for first in values.values()), {})
        return {**self.fixed, **at_first, **values, "end_week": self.compare_week}


class Calibration(Compared):
    """A search for the parameters whose brain is nearest to the real one of a week.

    The runs of the first round are spread over the bounds (a scrambled Sobol sequence), those of later ones where a
    Gaussian process through the scores expects the most. Runs that diverge count as worse than all others.
    """

    parameters: dict[str, tuple[Annotated[float, Field(allow_inf_nan=False)], ...]]
    """One to three keys of `folding` with their lowest and highest values, such as `{thickness_mm: [1, 3]}`;
    inner keys with dots. `stiffness_ratio` is the cortex's shear modulus over the core's; `KEY.amplitude`
    scales the base run's curve of KEY."""
    score: dict[Score, Annotated[float, Field(gt=0)]]
    """What is minimised: the weights of one or more measures (docs/metrics.md)."""
    rounds: tuple[Annotated[int, Field(ge=1, le=MOST_RUNS)], ...] = (12, 4, 4, 4)
    """How many runs each round has, the first at least 3, all together at most 40."""
    seed: int = Field(0, ge=0)
    """Seed of the sequence and of the Gaussian process."""

    def problems(self) -> Iterator[KeyProblem]:
        if not 1 <= len(self.parameters) <= MOST_PARAMETERS:
            yield KeyProblem(f"found {len(self.parameters)}; expected 1 to {MOST_PARAMETERS}", ("parameters",))
        if not self.rounds or self.rounds[0] < LEAST_FIRST_RUNS or sum(self.rounds) > MOST_RUNS:
            text = f"found {list(self.rounds)}; expected {LEAST_FIRST_RUNS} runs or more in the first round"
            yield KeyProblem(f"{text} and at most {MOST_RUNS} in all", ("rounds",))
        for key, bounds in self.parameters.items():
            if len(bounds) != 2 or not bounds[0] < bounds[1]:
                yield KeyProblem(
                    f"found {list(bounds)}; expected the lowest and the highest value", ("parameters", key)
                )
        if not self.score:
            yield KeyProblem(f"found nothing; expected one or more of {', '.join(SCORES)}", ("score",))

    @property
    def runs(self) -> dict[str, int]:
        # the round of each run by its name
        rounds = [number for number, size in enumerate(self.rounds) for _ in range(size)]
        return {f"calibration-{index:02d}": number for index, number in enumerate(rounds)}


def changed(run: Run, changes: Mapping[str, Any]) -> Run:
    """Return a run with some settings changed, by keys with dots for inner ones.

    ValidationError where they are not valid; KeyError where there is no such key.
    """
    raw = run.model_dump(mode="json")
    for key, value in changes.items():
        *outer, last = key.split(".")
        place = raw
        for name in outer:
            place = place[name] if isinstance(place, dict) else {}
        if not isinstance(place, dict) or last not in place:
            raise KeyError(key)
        place[last] = value
    return type(run).model_validate(raw)


def variants(name: str, study: Study) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the name and the varied values of each run of a study of a name, the last key varying fastest."""
    for values in product(*study.vary.values()):
        texts = [f"{value:g}" if isinstance(value, float) else str(value) for value in values]
        yield "-".join([name, *texts]), dict(zip(study.vary, values, strict=True))
