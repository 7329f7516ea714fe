"""Settings of runs, growth series, sweeps and calibration."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from typing import Annotated, Any

from pydantic import ConfigDict, Field

from .base import FirstIf, KeyProblem, Problems, Settings
from .brains import BrainConfig
from .ensemble import Variation, variations
from .folding import VARYING, FoldingSettings
from .stages import MeshSettings
from .terms import MAX_NAME_LENGTH, SCORES, Score
from .weeks import EndWeek

ALL = "all"
"""Value of `start` for all brains."""
FIRST = "first"
"""Value of `start` for the first of `brains`. The first of an atlas is its earliest
week."""

Start = Annotated[tuple[str, ...] | str, FirstIf(list | tuple)]
"""The id of a brain, a list of ids, `first` or `all`."""

RunName = Annotated[str, Field(pattern=r"^[^\W_][\w.-]*$", max_length=MAX_NAME_LENGTH)]
SweepName = Annotated[str, Field(pattern=r"^[^\W_][\w-]*$", max_length=MAX_NAME_LENGTH)]
"""Names that are used as folder names: letters, digits and these marks, beginning with
a letter or digit."""

FREE_GROWTH: dict[str, Any] = {
    "step_s": 86_400.0,
    "stress_memory_gw": 0.0,
    "shear_modulus_cortex_pa": 300.0,
    "shear_modulus_core_pa": 300.0,
    "support": "free",
    "contact": "global",
}
"""Growth everywhere, a free body, a cortex as stiff as the core: growth makes the
folds, not buckling."""

PRESETS: dict[str, dict[str, Any]] = {
    # the paper's model, independent of our defaults; its linear elements are
    # `mesh.order: 1`
    "fetalfoldsim": {
        "step_s": 43_200.0,
        "growth": {"model": "rates"},
        "thickness_mm": 1.5,
        "shear_modulus_cortex_pa": 1500.0,
        "shear_modulus_core_pa": 300.0,
        "material": "neo-hookean",
        "poisson_ratio": 0.45,
        "growth_rate_per_s": 2.0e-7,
        "core_growth_rate_per_s": 0.0,
        "stress_memory_gw": 0.0,
        "support": "ellipsoid",
        "contact": "planes",
    },
    # growth towards the shapes that were measured on the brain's own series
    "measured": {**FREE_GROWTH, "growth": {"model": "shapes"}},
    # a prediction: growth towards the shapes that an atlas' growth gives the brain
    "expected": {
        **FREE_GROWTH,
        "growth": {"model": "shapes", "of": "atlas"},
    },
}
"""Sets of parameters by name. Keys of the configuration override them."""


class Run(FoldingSettings):
    """The complete settings of a run: those of `folding`, overridden by its own."""

    model_config = ConfigDict(
        json_schema_extra={"type": ["object", "null"], "required": []}
    )

    start: Start | None = None
    """Id of the brain that is folded, a list of ids, `first` or `all`; `null`: the
    study's `start`."""

    # unlike `folding`, a run may have rates that its growth model does not use
    def problems(self) -> Problems:
        for problem in self.growth.unused_keys(self.growth.definition.keys):
            yield problem.inside("growth")
        if self.ensemble is not None and self.growth.definition.measured != "shapes":
            yield KeyProblem(
                f"is not used by the growth model {self.growth.model}, only by shapes",
                ("ensemble",),
            )


def complete_runs(raw: dict[str, Any]) -> dict[str, Any]:
    """Return a configuration, as plain dictionaries, with complete runs and `folding`.

    A run has the keys of `folding`, overridden by its preset, overridden by its own.
    Keys of `folding` override the preset of `folding`. Values that are not sections are
    left for validation. Without `runs` there is one, `reference`.
    """
    folding = raw.get("folding", {})
    runs = raw.get("runs") or {"reference": {}}
    if not isinstance(folding, dict) or not isinstance(runs, dict):
        return raw | {"folding": folding, "runs": runs}
    base = _merged(_preset(folding), folding)
    complete = {}
    for name, run in runs.items():
        own = run or {}
        inherited = base
        if isinstance(own, dict) and "preset" in own:
            inherited = _merged(folding, _preset(own))
        complete[name] = _merged(inherited, own)
    return raw | {"folding": base, "runs": complete}


def _preset(section: dict[str, Any]) -> dict[str, Any]:
    return PRESETS.get(str(section.get("preset")), {})


def _merged(
    base: Any,
    over: Any,
    key: str = "",
) -> Any:
    """Return a section with the keys of another on top; inner sections are merged, but
    not values that vary."""
    if key == "growth":
        base = _growth_section(base)
        over = _growth_section(over)
    if not isinstance(base, dict) or not isinstance(over, dict) or key in VARYING:
        return over
    if key == "growth":
        model = base.get("model")
        # another growth model has other keys
        if over.get("model", model) != model:
            return over
    merged = dict(base)
    for name, value in over.items():
        merged[name] = _merged(base.get(name), value, name)
    return merged


def _growth_section(growth: Any) -> Any:
    return {"model": growth} if isinstance(growth, str) else growth


def members_of(name: str, run: Run) -> dict[str, Variation]:
    """Return the variations of a run's ensemble by the name of the member; empty if it
    has none."""
    members = {}
    for variation in variations(run.ensemble or 0):
        members[f"{name}-member-{variation.number + 1}"] = variation
    return members


def chosen_starts(start: Start | None, ids: Sequence[str]) -> list[str]:
    """Return the ids that a value of `start` means, in the order of all `ids`."""
    if start is None:
        return []
    if start == ALL:
        return list(ids)
    if start == FIRST:
        return list(ids[:1])
    if isinstance(start, str):
        start = (start,)
    return [brain for brain in ids if brain in start]


# growth

Names = tuple[str, ...]
Series = Annotated[dict[str, Names] | Names, FirstIf(dict)]


class GrowthSettings(Settings):
    """The brains on which growth is measured."""

    brains: Series | None = None
    """Ids of the brains whose areas and volumes are used, at two weeks or more; or
    several such lists by name, `{surface: [...], volume: [...]}`. `null`: all brains.
    Each subject and each population is then a series, and surfaces (`surface`) and
    label volumes (`volume`) are separate series if both have two weeks. Only a named
    series may combine several subjects, such as all: `{cohort: [all]}`."""
    series: str | None = None
    """The series, if there are several, that gives measured curves or an atlas' growth.
    `null`: the start brain's."""
    matched_surfaces: bool = True
    """Whether surfaces of a series with the same triangles correspond vertex by vertex,
    so that no registration is needed."""
    path_edge_mm: float = Field(0.95, ge=0.5, le=5)
    """Distance between neighbouring nodes in the cortex of the mesh that an atlas'
    first brain is carried by through all its weeks, for growth of an atlas. [mm]"""

    @property
    def path_mesh(self) -> MeshSettings:
        """The mesh for the path of an atlas."""
        edge_mm = self.path_edge_mm
        return MeshSettings(
            order=1,
            mesher="tetgen",
            surface_edge_mm=edge_mm,
            core_edge_mm=round(3.16 * edge_mm, 2),
            max_surface_distance_mm=round(0.53 * edge_mm, 2),
        )


def growing_groups(
    brains: Sequence[BrainConfig],
    given: Sequence[str] | Mapping[str, Sequence[str]] | None,
) -> list[tuple[str, Sequence[BrainConfig]]]:
    """Return the name and the brains of each growth series that has two weeks or more.

    `given` is the setting `brains`; its ids must exist. Only a named series may combine
    several subjects or populations; `all` stands for all brains. Single hemispheres and
    whole brains are never in one series.
    """
    series: list[tuple[str, Sequence[BrainConfig]]] = []
    if isinstance(given, Mapping):
        for name, ids in given.items():
            members = [brain for brain in brains if brain.id in ids or ALL in ids]
            series.append((name, members))
    else:
        groups: dict[tuple[str, str, str], list[BrainConfig]] = {}
        for brain in brains:
            if given is None or brain.id in given:
                side = f"{brain.sides[0]} hemisphere" if brain.side else ""
                owner = (brain.subject or "", brain.population or "", side)
                groups.setdefault(owner, []).append(brain)
        for owner, same_owner in groups.items():
            by_kind = _series_by_kind(same_owner)
            has_owner = any(owner[:2])
            for kind, same_kind in by_kind.items():
                parts = [part for part in owner if part]
                if len(by_kind) > 1 or not has_owner:
                    parts.append(kind)
                name = ", ".join(parts) if len(groups) > 1 else kind
                series.append((name, same_kind))
    return [(name, members) for name, members in series if _n_weeks(members) > 1]


def _series_by_kind(brains: Sequence[BrainConfig]) -> dict[str, Sequence[BrainConfig]]:
    surfaces = [brain for brain in brains if brain.labels is None]
    volumes = [brain for brain in brains if brain.labels is not None]
    if not volumes:
        return {"surface": surfaces}
    if not surfaces:
        return {"volume": volumes}
    # a kind with a single week can only be compared across kinds
    if min(_n_weeks(surfaces), _n_weeks(volumes)) < 2:
        return {"all": brains}
    return {"surface": surfaces, "volume": volumes}


def _n_weeks(brains: Sequence[BrainConfig]) -> int:
    return len({brain.week for brain in brains})


# sweeps and calibration

Value = Annotated[str | float, FirstIf(str)]
"""A value of a parameter that a sweep varies."""
NOT_VARIED = (
    "preset",
    "start",
    "end_week",
    "ranks",
    "output_every_gw",
    "fields",
    "ensemble",
)
"""Keys that do not belong to the model of a run, or that the sweep sets."""
MAX_PARAMETERS = 3
MIN_FIRST_ROUND, MAX_RUNS = 3, 40
"""Limits of a calibration."""


class ComparisonSettings(Settings):
    """The observed brains of one week that runs are compared with."""

    base: str
    """Name of the run whose settings are changed."""
    compare_week: EndWeek
    """Week of the comparison, at which the runs end. [GW]"""
    compare_with: tuple[str, ...] | None = None
    """Ids of the observed brains of that week; `null`: all of the start brain's
    population, or of any population if it has none."""


class SweepSettings(ComparisonSettings):
    """A sweep: a run for each combination of the varied values, compared with observed
    brains of `compare_week`.

    Equal runs are solved once. A run that diverges is reported in the tables; the
    others continue.
    """

    vary: dict[str, tuple[Value, ...]]
    """Values of one or more keys of `folding`, such as `{thickness_mm: [0.8, 1.5]}`;
    inner keys with dots (`growth.model`)."""
    fixed: dict[str, Value] = Field({})
    """Keys of `folding` that are changed in all runs."""
    fixed_at: dict[float, dict[str, Value]] = Field({})
    """Keys that are changed for one value of the first varied key, such as `{1.5:
    {step_s: 43200}}`."""

    def changes(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Return all keys by which the run with these varied values differs from the
        base."""
        at_first = next(
            (self.fixed_at.get(first, {}) for first in values.values()),
            {},
        )
        return {
            **self.fixed,
            **at_first,
            **values,
            "end_week": self.compare_week,
        }


class CalibrationSettings(ComparisonSettings):
    """A search for the parameters whose brain is most similar to the observed one of a
    week.

    The first round is a scrambled Sobol sequence within the bounds. Later rounds are
    placed by optuna's tree-structured Parzen estimator, where the best runs are dense.
    Runs that diverge count as worse than all others. The optimum is the run with the
    least score.
    """

    parameters: dict[str, tuple[Annotated[float, Field(allow_inf_nan=False)], ...]]
    """One to three keys of `folding` with their lowest and highest values, such as
    `{thickness_mm: [1, 3]}`; inner keys with dots."""
    score: dict[Score, Annotated[float, Field(gt=0)]]
    """What is minimised: the weights of one or more measures (docs/metrics.md)."""
    rounds: tuple[Annotated[int, Field(ge=1, le=MAX_RUNS)], ...] = (12, 4, 4, 4)
    """Number of runs in each round: at least 3 in the first, at most 40 in all."""

    def problems(self) -> Problems:
        if not 1 <= len(self.parameters) <= MAX_PARAMETERS:
            yield KeyProblem(
                f"found {len(self.parameters)}; expected 1 to {MAX_PARAMETERS}",
                ("parameters",),
            )
        if (
            not self.rounds
            or self.rounds[0] < MIN_FIRST_ROUND
            or sum(self.rounds) > MAX_RUNS
        ):
            text = (
                f"found {list(self.rounds)}; expected at least {MIN_FIRST_ROUND} runs"
                " in the first round"
            )
            yield KeyProblem(
                f"{text} and at most {MAX_RUNS} in all",
                ("rounds",),
            )
        for key, bounds in self.parameters.items():
            if len(bounds) != 2 or not bounds[0] < bounds[1]:
                yield KeyProblem(
                    f"found {list(bounds)}; expected the lowest and the highest value",
                    ("parameters", key),
                )
        if not self.score:
            yield KeyProblem(
                f"found nothing; expected one or more of {', '.join(SCORES)}",
                ("score",),
            )

    @property
    def runs(self) -> dict[str, int]:
        # the round of each run, by name
        rounds: dict[str, int] = {}
        for number, size in enumerate(self.rounds):
            for _ in range(size):
                rounds[f"calibration-{len(rounds):02d}"] = number
        return rounds


def changed(run: Run, changes: Mapping[str, Any]) -> Run:
    """Return a run with some settings changed; inner keys have dots.

    ValidationError if a value is not valid; KeyError if a key does not exist.
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


def variants(name: str, sweep: SweepSettings) -> Iterator[tuple[str, dict[str, Value]]]:
    """Yield the name and the varied values of each run of a sweep, the last key varying
    fastest."""
    for values in product(*sweep.vary.values()):
        run = name
        varied = {}
        for key, value in zip(sweep.vary, values, strict=True):
            run += f"-{_short(value)}"
            varied[key] = value
        yield run, varied


def _short(value: str | float) -> str:
    """Return a value as text: a number in six digits, or in as many as make it
    unique."""
    if isinstance(value, str):
        return value
    short = f"{value:g}"
    return short if float(short) == value else repr(value)
