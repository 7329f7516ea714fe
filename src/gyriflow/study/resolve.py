"""Resolve a configuration into a study: the brains, weeks and files of each run and sweep."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Literal

from ..errors import InputError
from ..io.volumes import LabelSource
from ..io.yaml_files import SCHEMES
from ..settings.brains import BrainConfig
from ..settings.ensemble import SMOOTHING_RANGE, Variation
from ..settings.folding import output_weeks
from ..settings.growth import BEFORE_GW, SIZES
from ..settings.root import Config
from ..settings.runs import ComparisonSettings, Run, changed, members_of, starts_of, variants
from ..settings.schemes import LabelScheme
from ..settings.terms import SIDES
from .atlases import known_checksums, used_atlases
from .paths import CURVES
from .records import Brain, CalibrationRuns, Chain, Origin, Simulation, Sweep, chain_name
from .series import UNVARIED, Series, series_of, several_subjects
from .study import Study

MAX_BEYOND_ATLAS_GW = 0.5
"""How far the growth of an atlas is extrapolated for members of an ensemble that are older than stated."""
Chains = Mapping[tuple[str, str], Chain]


def resolve(config: Config, refused: Collection[str] = ()) -> Study:
    """Return the study of a configuration, without the brains that are `refused`.

    No other brain replaces a refused start brain. A start brain whose growth needs refused brains is not folded either
    (see `Study.unreachable`). InputError if a run lacks brains to grow towards and none is refused.
    """
    # their descriptions and folders are read once
    atlases = used_atlases(config)
    checksums = known_checksums(atlases)
    brains = {brain.id: _brain(brain, config, refused, checksums) for brain in config.brains if brain.id not in refused}
    accepted, series = list(brains.values()), series_of(config, brains, atlases)
    plan, members = _plan(config, brains, series)
    chains = _chains(plan, series, accepted)
    unreachable = _unreachable(plan, series, chains)
    if unreachable and not refused:
        raise next(iter(unreachable.values()))
    if unreachable:
        plan, members = _plan(config, brains, series, unreachable)
        chains = _chains(plan, series, accepted)
    simulations = {
        (planned.run, planned.start.id): _simulation(config, planned, series, chains, accepted) for planned in plan
    }
    calibration = None
    if (settings := config.calibrate) is not None:
        base = tuple(simulation for simulation in simulations.values() if simulation.run == settings.base)
        observed = {simulation.start.id: _compared_with(settings, simulation.start, accepted) for simulation in base}
        calibration = CalibrationRuns(base, settings.runs, observed) if base else None
    return Study(
        config=config,
        used_atlases=atlases,
        checksums=checksums,
        brains=brains,
        series=series,
        simulations=simulations,
        chains=chains,
        sweeps=_sweeps(config, members, simulations.values(), accepted),
        calibration=calibration,
        unreachable=unreachable,
    )


def label_scheme(config: Config, brain: BrainConfig) -> LabelScheme:
    """Return the scheme of a brain's labels; KeyError if it has none."""
    settings = config.schemes.get(str(brain.scheme))
    if settings is None:
        return SCHEMES[str(brain.scheme)]
    return LabelScheme(name=str(brain.scheme), **settings.model_dump())


def _brain(
    settings: BrainConfig, config: Config, refused: Collection[str], checksums: Mapping[str, tuple[str, str]]
) -> Brain:
    labels = None
    if (volume := settings.label_volume) is not None:
        labels = LabelSource(volume, settings.affine_from, label_scheme(config, settings))
    has_thickness = bool(settings.white_files) or (labels is not None and bool(labels.scheme.cortex))
    is_whole = len(settings.sides) == len(SIDES)
    regions = config.metrics.regions
    with_regions = [name for name in regions if name not in refused] if isinstance(regions, dict) else []
    regions_from: Literal["given", "carried", "named"] | None = None
    if is_whole and settings.id in with_regions:
        regions_from = "given"
    elif is_whole and with_regions and settings.source != "shape":
        regions_from = "carried"
    elif is_whole and not with_regions and not settings.synthetic:
        regions_from = "named"
    return Brain(
        config=settings,
        labels=labels,
        has_thickness=has_thickness,
        has_white=bool(settings.white_files) or (has_thickness and config.metrics.white_surfaces == "all"),
        regions_from=regions_from,
        has_regions=bool(regions_from) and (bool(with_regions) or regions == "named_sulci"),
        checksums={path: checksums[path] for path in settings.files if path in checksums},
    )


def _later_observed_weeks(start: Brain, brains: Iterable[Brain]) -> list[float]:
    observed = [brain for brain in start.comparable(brains) if not brain.config.synthetic]
    return sorted({brain.week for brain in observed if brain.week > start.week})


# planned simulations


@dataclass(frozen=True)
class _Planned:
    """A run from one start brain, before the brains that its growth is measured on are known."""

    run: str
    start: Brain
    settings: Run
    weeks: list[float]
    variation: Variation | None = None
    member_of: str | None = None

    @property
    def shapes(self) -> Origin | None:
        return _shapes(self.settings)

    @property
    def chain(self) -> tuple[str, str] | None:
        """The key of its chain; None if it does not grow towards shapes."""
        return (self.start.id, chain_name(self.shapes, self.run, self.member_of)) if self.shapes else None


@dataclass(frozen=True)
class Member:
    """A run of a sweep: its name, the varied values by key, and its complete settings.

    If `runs` or an earlier sweep has an equal run, the member has its name, and the run is simulated once.
    """

    run: str
    values: Mapping[str, Any]
    settings: Run


def _plan(
    config: Config, brains: Mapping[str, Brain], series: Series, left_out: Collection[str] = ()
) -> tuple[list[_Planned], dict[str, list[Member]]]:
    ids = [brain.id for brain in config.brains]
    starts = {
        name: [brains[id] for id in starts_of(config.start, run, ids) if id in brains and id not in left_out]
        for name, run in config.runs.items()
    }
    predicted = [start for name, run in config.runs.items() if _shapes(run) == "atlas" for start in starts[name]]
    further = {start: _later_observed_weeks(start, brains.values()) for start in predicted}
    plan = []
    for name, run in config.runs.items():
        for start in starts[name]:
            settings = _up_to_last_scan(run, start, series)
            planned = _Planned(name, start, settings, _weeks(settings, start, further.get(start, [])))
            plan.append(planned)
            without = settings.model_copy(update={"ensemble": None})
            plan += [
                replace(planned, run=member, settings=without, variation=variation, member_of=name)
                for member, variation in members_of(name, run).items()
            ]
    members = _members(config, plan) if config.studies else {}
    varied: dict[str, tuple[Run, list[Brain], set[float]]] = {}
    for name, study in config.studies.items():
        for member in members[name]:
            if member.run not in config.runs:
                _, _, weeks = varied.setdefault(member.run, (member.settings, starts[study.base], set()))
                weeks.add(study.compare_week)
    plan += [
        _Planned(run, start, settings, _weeks(settings, start, weeks))
        for run, (settings, run_starts, weeks) in varied.items()
        for start in run_starts
    ]
    if (calibrate := config.calibrate) is not None:
        week = calibrate.compare_week
        settings = config.runs[calibrate.base].model_copy(update={"end_week": week})
        plan += [
            _Planned(run, start, settings, [start.week, week])
            for run in calibrate.runs
            for start in starts[calibrate.base]
        ]
    return plan, members


def _members(config: Config, plan: Sequence[_Planned]) -> dict[str, list[Member]]:
    """Return the members of each sweep. Equal members share one simulated run, which ends at the latest of their weeks.

    If a run of `runs` is equal too, and its simulations have all their weeks, they share that one.
    """
    combinations = [
        (name, member, values, changed(config.runs[study.base], study.changes(values)))
        for name, study in config.studies.items()
        for member, values in variants(name, study)
    ]
    weeks: dict[str, set[float]] = {}
    for *_, settings in combinations:
        weeks.setdefault(_equality_key(settings), set()).add(settings.end_week)
    names = {
        _equality_key(run): name
        for name, run in reversed(list(config.runs.items()))
        if all(weeks.get(_equality_key(run), set()) <= set(planned.weeks) for planned in plan if planned.run == name)
    }
    members: dict[str, list[Member]] = {name: [] for name in config.studies}
    for name, member, values, settings in combinations:
        key = _equality_key(settings)
        run = names.setdefault(key, member)
        complete = config.runs.get(run) or changed(settings, {"end_week": max(weeks[key])})
        members[name].append(Member(run, values, complete))
    return members


def _equality_key(run: Run) -> str:
    """Return a text that is the same for runs whose shapes are the same at each week."""
    return run.model_dump_json(exclude={"end_week", "preset", "ranks", "fields", "ensemble"})


def _weeks(settings: Run, start: Brain, further: Iterable[float]) -> list[float]:
    weeks = output_weeks(start.week, settings.end_week, settings.output_every_gw)
    return sorted({*weeks, *(week for week in further if week < weeks[-1])})


def _up_to_last_scan(run: Run, start: Brain, series: Series) -> Run:
    """Return a run that ends with the last scan if it follows the scans of one subject."""
    scans = series.brains.get(series.with_brain(start), ())
    last = max((brain.week for brain in scans), default=start.week)
    if _shapes(run) != "self" or start.config.subject is None or several_subjects(scans) or last <= start.week:
        return run
    return run.model_copy(update={"end_week": min(run.end_week, last)})


def _shapes(settings: Run) -> Origin | None:
    return settings.growth.of if settings.growth.definition.measured == "shapes" else None


# brains of a run's growth


def _chains(plan: Sequence[_Planned], series: Series, brains: Sequence[Brain]) -> dict[tuple[str, str], Chain]:
    ends: dict[Brain, float] = {}
    for planned in plan:
        ends[planned.start] = max(planned.settings.end_week, ends.get(planned.start, 0.0))
    chains: dict[tuple[str, str], Chain] = {}
    for start, end in ends.items():
        chains[start.id, "self"] = _chain("self", _own_chain(start, end, series), series)
        atlases = series.from_other_populations(start)
        names = atlases if len(atlases) == 1 else []
        chain = _chain("atlas", _atlas_chain(start, start.week, end, names, series), series)
        observed = _later_observed_weeks(start, brains)
        further = tuple(week for week in observed if week <= end and week not in chain.later_weeks)
        chains[start.id, "atlas"] = replace(chain, further_weeks=further)
    for planned in plan:
        if planned.variation is not None and planned.chain is not None:
            chains[planned.chain] = _varied_chain(planned, planned.variation, series, brains)
    return chains


def _varied_chain(planned: _Planned, variation: Variation, series: Series, brains: Sequence[Brain]) -> Chain:
    """Return the chain of a member of an ensemble. InputError if it is that of its run."""
    start, end = planned.start, planned.settings.end_week
    varied = variation.registration_smoothing, variation.seed
    if planned.shapes == "self":
        chain = _chain("self", _own_chain(start, end, series), series, varied, varied)
        if chain.later and chain == _chain("self", chain.brains, series):
            raise InputError(
                f"the members of the ensemble of run {planned.member_of} would be equal: the surfaces of "
                f"{start.id} and its later brains are matched by their vertices, so there are no registrations to vary",
                remedy="Remove ensemble, or set growth.matched_surfaces to false.",
            )
        # ages of one series have the same error
        return replace(chain, variation=replace(variation, age_shift_gw=0.0))
    atlases = series.from_other_populations(start, all_atlases=True)
    names = [name for name in atlases if _covers(series.brains[name], start.week, end)]
    if not names:
        # the run itself is refused
        return _chain("atlas", [start], series)
    round_of_atlases, number = divmod(variation.number, len(names))
    atlas_weeks = [brain.week for brain in series.brains[names[number]]]
    # the age of the whole run is shifted, as far as the atlas goes, or a little further
    low, high = min(atlas_weeks) - BEFORE_GW - start.week, max(atlas_weeks) + MAX_BEYOND_ATLAS_GW - end
    shift = round(min(max(variation.age_shift_gw, low), high), 2)
    chain_brains = _atlas_chain(start, start.week + shift, end + shift, names[number : number + 1], series)
    # one of two, so that members share the registrations between the atlas' brains
    between_atlas = (SMOOTHING_RANGE[1], 0) if round_of_atlases % 2 else UNVARIED
    further = sorted({*(week for week in _later_observed_weeks(start, brains) if week <= end), end})
    return replace(
        _chain("atlas", chain_brains, series, varied, between_atlas),
        further_weeks=tuple(further),
        variation=replace(variation, age_shift_gw=shift),
    )


def _chain(
    origin: Origin,
    brains: Sequence[Brain],
    series: Series,
    first_variation: tuple[float, int] = UNVARIED,
    later_variation: tuple[float, int] = UNVARIED,
) -> Chain:
    """Return a chain, with smoothing and seed of its first registration and of the later ones."""
    pairs = list(pairwise(brains))
    variations = [first_variation, *[later_variation] * (len(pairs) - 1)][: len(pairs)]
    return Chain(
        origin=origin,
        brains=tuple(brains),
        correspondences=tuple(
            series.correspondence(*pair, variation) for pair, variation in zip(pairs, variations, strict=True)
        ),
        posed=tuple(series.posed(*pair) for pair in pairs),
    )


def _covers(brains: Iterable[Brain], week: float, end: float) -> bool:
    """Return whether growth from a week to an end is known from brains of an atlas."""
    weeks = {brain.week for brain in brains}
    return len(weeks) > 1 and min(weeks) <= week + BEFORE_GW and max(weeks) >= end


def _own_chain(start: Brain, end: float, series: Series) -> list[Brain]:
    """Return a start brain and later brains of its growth series, one a week, up to the first at or past an end week.

    All have label volumes, or surfaces with the same vertices.
    """
    # scans of the same subject come first in a population's series
    members = sorted(series.brains.get(series.with_brain(start), ()), key=lambda brain: brain.subject != start.subject)
    # growth up to the end week needs the first brain at or past it
    last = min((brain.week for brain in members if brain.week >= end), default=end)
    by_week = {start.week: start}
    for brain in members:
        have_labels = start.config.has_labels and brain.config.has_labels
        if start.week < brain.week <= last and (have_labels or series.are_matched(start, brain)):
            by_week.setdefault(brain.week, brain)
    return sorted(by_week.values(), key=lambda brain: brain.week)


def _atlas_chain(start: Brain, week: float, end: float, names: Iterable[str], series: Series) -> list[Brain]:
    """Return a start brain of a week and the brains of a series of another population, one for each week.

    They begin with the last week up to that of the start (else with the first week), and end with the first week at or
    past an end week. There are at least two weeks, if available.
    """
    members = [brain for name in names for brain in series.brains[name]]
    weekly = sorted({brain.week: brain for brain in members}.values(), key=lambda brain: brain.week)
    if not weekly:
        return [start]
    first = max((brain.week for brain in weekly if brain.week <= week), default=weekly[0].week)
    last = min((brain.week for brain in weekly if brain.week >= end and brain.week > first), default=end)
    return [start, *(brain for brain in weekly if first <= brain.week <= last)]


def _unreachable(plan: Iterable[_Planned], series: Series, chains: Chains) -> dict[str, InputError]:
    """Return errors, by start brain, of runs that lack brains to grow towards."""
    errors: dict[str, InputError] = {}
    for planned in plan:
        start, end, origin = planned.start, planned.settings.end_week, _shapes(planned.settings)
        if origin is None or planned.member_of:
            continue
        chain = chains[start.id, origin]
        available = ", ".join(f"{brain.id} ({brain.week:g} GW)" for brain in chain.brains)
        if origin == "self":
            names = [name] if (name := series.with_brain(start)) else []
            is_complete = len(chain.brains) > 1
            available += "".join(f"; {series.unmatched[name]}" for name in names if name in series.unmatched)
            expected = "the start's own growth series with label volumes or matched surfaces"
            remedy = "Add later brains to its series (growth.brains), or grow by sizes or rates."
        else:
            names = series.from_other_populations(start)
            is_complete = len(chain.brains) > 2 and start.week >= chain.later[0].week - BEFORE_GW
            expected = "one series of another population with the same hemispheres"
            remedy = "Add an atlas of these weeks, or name one of several series in growth.series."
        if is_complete and chain.weeks[-1] >= end:
            continue
        if not names:
            available = f"none; the growth series are {', '.join(series.brains)}"
        elif len(names) > 1:
            available = f"several series: {', '.join(names)}"
        text = f"run {planned.run} needs later brains to grow {start.id} towards, and there are none"
        expected = f"brains of {expected}, from {start.week:g} to {end:g} GW"
        errors.setdefault(start.id, InputError(text, found=available, expected=expected, remedy=remedy))
    return errors


# simulations and the brains that they are compared with


def _simulation(
    config: Config, planned: _Planned, series: Series, chains: Chains, brains: Sequence[Brain]
) -> Simulation:
    run, start, growth = planned.run, planned.start, planned.settings.growth
    shapes = _shapes(planned.settings)
    sizes = growth.definition.measured == "sizes" and "measured" in [getattr(growth, size) for size in SIZES]
    # the run is also compared with brains of other subjects if it grows towards them
    targets = [brain for brain in chains[start.id, "self"].later if brain.sides == start.sides]
    candidates = list(dict.fromkeys([*start.comparable(brains), *targets]))
    candidates.sort(key=lambda brain: brain.subject != start.subject)
    by_week = {week: tuple(brain for brain in candidates if brain.week == week) for week in planned.weeks[1:]}
    observed_brains = {week: same_week for week, same_week in by_week.items() if same_week}
    observed = {
        week: not_synthetic[0]
        for week, same_week in observed_brains.items()
        if (not_synthetic := [brain for brain in same_week if not brain.config.synthetic])
    }
    scans = [brain for brain in brains if start.config.subject is not None and brain.subject == start.subject]
    growth_brains = chains[start.id, "atlas"].later
    is_atlas_prediction = shapes == "atlas" and not any(
        brain.week > start.week for brain in (*candidates, *scans) if brain in growth_brains
    )
    return Simulation(
        run=run,
        start=start,
        settings=planned.settings,
        weeks=tuple(planned.weeks),
        shapes=shapes,
        series=series.for_sizes(start),
        curves=CURVES["curves"] if sizes or growth.thickness_mm == "measured" else [],
        base=config.calibrate.base if config.calibrate and run in config.calibrate.runs else run,
        ensemble=tuple(members_of(run, planned.settings)) if run in config.runs else (),
        member_of=planned.member_of,
        observed_brains=observed_brains,
        observed={} if start.config.synthetic else observed,
        kind="explained" if not is_atlas_prediction and (shapes or sizes) else "predicted",
        is_atlas_prediction=is_atlas_prediction,
        has_regions=start.has_regions and run in config.runs,
    )


def _compared_with(settings: ComparisonSettings, start: Brain, brains: Iterable[Brain]) -> tuple[Brain, ...]:
    if settings.compare_with is not None:
        return tuple(brain for brain in brains if brain.id in settings.compare_with)
    same_week = [brain for brain in brains if brain.week == settings.compare_week]
    same_population = [brain for brain in same_week if brain.config.population == start.config.population]
    return tuple(same_population or same_week)


def _sweeps(
    config: Config, members: Mapping[str, list[Member]], simulations: Iterable[Simulation], brains: Sequence[Brain]
) -> dict[str, Sweep]:
    sweeps = {}
    for name, settings in config.studies.items():
        rows = tuple(
            (simulation, member.values)
            for member in members[name]
            for simulation in simulations
            if simulation.run == member.run
        )
        observed = {simulation.start.id: _compared_with(settings, simulation.start, brains) for simulation, _ in rows}
        if rows:
            sweeps[name] = Sweep(name, settings.compare_week, rows, observed)
    return sweeps
