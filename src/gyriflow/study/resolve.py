"""Resolve a configuration into a study: the brains, weeks and files of each run and
sweep."""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

from ..errors import InputError
from ..settings.folding import mapped_parameters, output_weeks
from ..settings.growth import BEFORE_GW, Origin
from ..settings.root import Config
from ..settings.runs import (
    ComparisonSettings,
    Run,
    changed,
    chosen_starts,
    members_of,
    variants,
)
from . import paths
from .atlases import UsedAtlas, used_atlases
from .brains import comparable, plan_brains
from .records import (
    Brain,
    CalibrationRun,
    Chain,
    Comparison,
    Download,
    GrowthSeries,
    LeftOut,
    Link,
    MeasuredBrain,
    Simulation,
    SweepRun,
    measured_files,
)
from .series import (
    PATH,
    Series,
    chains_of,
    later_observed_weeks,
    member_chain,
    series_of,
    several_subjects,
)
from .study import Study, study_of

Chains = dict[tuple[str, str], Chain]
GROWN_TOWARDS: dict[Origin, tuple[str, str]] = {
    "self": (
        "the start's own growth series with label volumes or matched surfaces",
        "Add later brains to its series (growth.brains), or grow by sizes or rates.",
    ),
    "atlas": (
        "one series of another population with the same hemispheres",
        "Add an atlas of these weeks, or name one of several series in growth.series.",
    ),
}
"""Brains that a run grows towards, and the remedy where they are missing."""


@dataclass(frozen=True)
class _Variant:
    """A run of a sweep, with its varied values by key."""

    sweep: str
    run: str
    values: Mapping[str, Any]
    settings: Run


@dataclass(frozen=True)
class _Pair:
    """A run with one of its start brains."""

    run: str
    start: Brain
    settings: Run


@dataclass(frozen=True)
class _Brains:
    """The brains of a study, and those that growth is measured on. The chains of
    members of ensembles are added to `chains`."""

    config: Config
    brains: Mapping[str, Brain]
    series: Series
    chains: Chains


def resolve(config: Config, refused: Mapping[str, str] | None = None) -> Study:
    """Return the study of a configuration, without the brains that are `refused`, by
    id, each with its cause.

    No other brain replaces a refused start brain. A start brain whose growth needs
    refused brains is not folded either. InputError if a run lacks brains to grow
    towards and none is refused.
    """
    refused = refused or {}
    # their descriptions and folders are read once
    atlases = used_atlases(config)
    brains = plan_brains(config, refused, atlases)
    series = series_of(config, brains, atlases)
    swept = _variants(config)
    pairs = list(_pairs(config, brains, series, swept))
    chains = _chains(pairs, series, list(brains.values()))
    unreachable: dict[str, InputError] = {}
    for pair in pairs:
        error = _missing_brains(pair, series, chains)
        if error is not None:
            unreachable.setdefault(pair.start.id, error)
    if unreachable and not refused:
        raise next(iter(unreachable.values()))
    pairs = [pair for pair in pairs if pair.start.id not in unreachable]
    known = _Brains(config, brains, series, chains)
    simulations = _simulations_of_runs(known, pairs)
    names, ends = _shared_runs(config, swept, simulations)
    simulations += _simulations_of_variants(known, pairs, ends)
    simulated: list[MeasuredBrain] = []
    compared: list[Comparison] = []
    for simulation in simulations:
        simulated += _simulated(simulation, brains[simulation.brain])
        compared += _compared(known, simulation)
    followed = _followed_chains(simulations, chains, series)
    links = _links(config, brains, series, followed.values())
    rows: dict[str, Iterable[Any]] = {
        "brains": brains.values(),
        "series": _series_rows(config, brains, series, followed, simulations),
        "simulations": simulations,
        "simulated": simulated,
        "compared": compared,
        "links": links,
        "chains": followed.values(),
        "sweeps": _sweeps(config, swept, names, simulations, brains),
        "calibration": _calibration(config, simulations, brains),
        "left_out": _left_out(config, refused, unreachable),
        "downloads": _downloads(atlases),
    }
    return study_of(config, rows)


def _downloads(atlases: Iterable[UsedAtlas]) -> list[Download]:
    """Return the files of atlases that are missing."""
    rows = []
    for used in atlases:
        for file in used.missing:
            row = Download(
                file=str(file.path),
                url=file.url,
                sha256=file.sha256,
            )
            rows.append(row)
    return rows


def _left_out(
    config: Config,
    refused: Mapping[str, str],
    unreachable: Mapping[str, InputError],
) -> list[LeftOut]:
    causes: dict[Literal["refused", "not folded"], Mapping[str, Any]] = {
        "refused": refused,
        "not folded": unreachable,
    }
    rows = []
    for brain in config.brains:
        for why, causes_by_brain in causes.items():
            if brain.id in causes_by_brain:
                cause = str(causes_by_brain[brain.id])
                row = LeftOut(
                    brain=brain.id,
                    why=why,
                    week=brain.week,
                    cause=cause,
                )
                rows.append(row)
    for scan, facts in config.left_out.items():
        rows.append(
            LeftOut(
                brain=scan,
                why="cannot be used",
                **facts,
            )
        )
    return rows


# links, chains and growth series


def _followed_chains(
    simulations: Iterable[Simulation],
    chains: Chains,
    series: Series,
) -> Chains:
    """Return the chains that simulations follow, and the paths of atlases in them."""
    followed = {}
    for simulation in simulations:
        if simulation.chain is not None:
            key = (simulation.brain, simulation.chain)
            followed[key] = chains[key]
    for chain in list(followed.values()):
        if chain.path is not None:
            followed[chain.path, PATH] = series.paths[chain.path]
    return followed


def _links(
    config: Config,
    brains: Mapping[str, Brain],
    series: Series,
    chains: Iterable[Chain],
) -> list[Link]:
    """Return the maps between brains: of chains, to carry regions, and to move maps to
    the template."""
    files: list[str] = []
    for chain in chains:
        files += chain.links
    template = brains.get(config.metrics.template or "")
    for brain in brains.values():
        source = brains.get(brain.regions_of or "")
        for other in (source, template):
            if other is not None and other is not brain:
                files.append(series.link(other, brain))
    return [series.links[file] for file in files]


def _series_rows(
    config: Config,
    brains: Mapping[str, Brain],
    series: Series,
    chains: Chains,
    simulations: Iterable[Simulation],
) -> list[GrowthSeries]:
    """Return the growth series. Differences between weeks are growth in a
    series of a subject, of an atlas, or used by a run."""
    starts = set()
    used = set()
    for simulation in simulations:
        starts.add(simulation.brain)
        if simulation.curves:
            used.add(simulation.series)
        if simulation.chain and simulation.member_of is None:
            for brain in chains[simulation.brain, simulation.chain].later:
                used.add(series.with_brain(brains[brain]))
    rows = []
    for name, members in series.brains.items():
        by_week = sorted(members, key=lambda brain: brain.week)
        ids = tuple(brain.id for brain in by_week)
        # brains without a subject may be different fetuses
        is_one = (
            members[0].subject is not None
            or all(brain.atlas for brain in members)
            or not starts.isdisjoint(ids)
        )
        is_growth = is_one and not several_subjects(members)
        row = GrowthSeries(
            name=name,
            brains=ids,
            has_rates=is_growth or name in used,
            unmatched=series.unmatched.get(name),
        )
        rows.append(row)
    return rows


# simulations


def _variants(config: Config) -> list[_Variant]:
    """Return the runs of all sweeps. They have no ensembles."""
    found = []
    for name, sweep in config.sweeps.items():
        base = config.runs[sweep.base]
        for run, values in variants(name, sweep):
            changes = {**sweep.changes(values), "ensemble": None}
            found.append(
                _Variant(
                    name,
                    run,
                    values,
                    changed(base, changes),
                )
            )
    return found


def _pairs(
    config: Config,
    brains: Mapping[str, Brain],
    series: Series,
    variants: Iterable[_Variant],
) -> Iterator[_Pair]:
    """Yield each run with each start brain that is not refused: those of `runs`, of
    sweeps and of the calibration."""
    ids = [brain.id for brain in config.brains]
    starts = {}
    for name, run in config.runs.items():
        names = chosen_starts(config.start if run.start is None else run.start, ids)
        starts[name] = [brains[brain] for brain in names if brain in brains]
    for name, run in config.runs.items():
        for start in starts[name]:
            yield _Pair(name, start, _up_to_last_scan(run, start, series))
    for variant in variants:
        for start in starts[config.sweeps[variant.sweep].base]:
            yield _Pair(variant.run, start, variant.settings)
    calibrate = config.calibrate
    if calibrate is not None:
        changes = {"end_week": calibrate.compare_week, "ensemble": None}
        settings = config.runs[calibrate.base].model_copy(update=changes)
        for name in calibrate.runs:
            for start in starts[calibrate.base]:
                yield _Pair(name, start, settings)


def _chains(
    pairs: Iterable[_Pair],
    series: Series,
    brains: Sequence[Brain],
) -> Chains:
    starts: dict[str, Brain] = {}
    ends: dict[str, float] = {}
    for pair in pairs:
        name = pair.start.id
        starts[name] = pair.start
        ends[name] = max(
            pair.settings.end_week,
            ends.get(name, 0.0),
        )
    chains: Chains = {}
    for name, start in starts.items():
        chains |= chains_of(start, ends[name], series, brains)
    return chains


def _simulations_of_runs(
    known: _Brains,
    pairs: Iterable[_Pair],
) -> list[Simulation]:
    """Return the simulations of `runs`, each followed by the members of its
    ensemble."""
    brains = list(known.brains.values())
    own = [pair for pair in pairs if pair.run in known.config.runs]
    predicted = set()
    for pair in own:
        if pair.settings.growth.shapes == "atlas":
            predicted.add(pair.start.id)
    simulations = []
    for pair in own:
        start = pair.start
        further: list[float] = []
        if start.id in predicted:
            further = later_observed_weeks(start, brains)
        weeks = _weeks(pair.settings, start, further)
        simulations.append(_simulation(known, pair, weeks))
        alone = pair.settings.model_copy(update={"ensemble": None})
        for name, variation in members_of(pair.run, pair.settings).items():
            chain = member_chain(
                name, pair.run, start, pair.settings, variation, known.series, brains
            )
            known.chains[start.id, chain.name] = chain
            member = _Pair(name, start, alone)
            simulations.append(_simulation(known, member, weeks, pair.run))
    return simulations


def _simulations_of_variants(
    known: _Brains,
    pairs: Iterable[_Pair],
    ends: Mapping[str, set[float]],
) -> list[Simulation]:
    """Return the simulations of sweeps, each with the weeks at which it is compared,
    and of the calibration."""
    simulations = []
    calibrate = known.config.calibrate
    for pair in pairs:
        settings = pair.settings
        if pair.run in known.config.runs:
            continue
        if pair.run in ends:
            compared = ends[pair.run]
            settings = settings.model_copy(update={"end_week": max(compared)})
            pair = _Pair(pair.run, pair.start, settings)
            weeks = _weeks(settings, pair.start, compared)
            simulations.append(_simulation(known, pair, weeks))
        elif calibrate is not None and pair.run in calibrate.runs:
            weeks = [pair.start.week, settings.end_week]
            simulations.append(_simulation(known, pair, weeks))
    return simulations


def _candidates(known: _Brains, start: Brain) -> list[Brain]:
    """Return the brains that simulations from a start brain may be compared with, those
    of its own subject first.

    Besides comparable ones, these are brains of its growth series, also of other
    subjects.
    """
    candidates = comparable(start, known.brains.values())
    for name in known.chains[start.id, "self"].later:
        brain = known.brains[name]
        if brain.sides == start.sides and brain not in candidates:
            candidates.append(brain)
    return sorted(
        candidates,
        key=lambda brain: brain.subject_name != start.subject_name,
    )


def _simulation(
    known: _Brains,
    pair: _Pair,
    weeks: Sequence[float],
    member_of: str | None = None,
) -> Simulation:
    run = pair.run
    start = pair.start
    settings = pair.settings
    growth = settings.growth
    later = {brain.id for brain in _candidates(known, start)}
    for brain in known.brains.values():
        if start.subject is not None and brain.subject == start.subject:
            later.add(brain.id)
    grown = known.chains[start.id, "atlas"].later
    knows_later = any(
        name in later and known.brains[name].week > start.week for name in grown
    )
    is_atlas_prediction = growth.shapes == "atlas" and not knows_later
    follows_observed = bool(growth.shapes) or growth.follows_sizes
    is_explained = follows_observed and not is_atlas_prediction
    calibrate = known.config.calibrate
    base = run
    if calibrate is not None and run in calibrate.runs:
        base = calibrate.base
    chain: str | None = growth.shapes
    if chain and member_of:
        chain = f"{chain}.{run}"
    maps = None
    if growth.shapes or mapped_parameters(settings):
        maps = paths.MAPS.format(run=base, brain=start.id)
    return Simulation(
        run=run,
        brain=start.id,
        weeks=tuple(weeks),
        kind="explained" if is_explained else "predicted",
        is_atlas_prediction=is_atlas_prediction,
        growth_of=_growth_source(known, start, settings),
        series=known.series.for_sizes(start),
        curves=paths.CURVES["curves"] if growth.follows_sizes else None,
        chain=chain,
        targets=paths.TARGETS.format(brain=start.id, origin=chain) if chain else None,
        base=base,
        maps=maps,
        members=tuple(members_of(run, settings)),
        member_of=member_of,
        has_regions=bool(start.regions) and run in known.config.runs,
        may_diverge=run not in known.config.runs,
        settings=settings,
    )


def _growth_source(known: _Brains, start: Brain, settings: Run) -> str:
    """Describe whose measured growth a run follows, or return ""."""
    brains: Sequence[Brain] = ()
    name = ""
    origin = settings.growth.shapes
    if origin:
        chain = known.chains[start.id, origin]
        ids = chain.later if origin == "atlas" else chain.brains
        brains = [known.brains[brain] for brain in ids]
        name = known.series.with_brain(brains[0])
    elif settings.growth.follows_sizes:
        name = known.series.for_sizes(start) or ""
        brains = known.series.brains.get(name, ())
    if several_subjects(brains):
        return f"population {name}"
    if start in brains:
        return "own"
    return f"series {name}" if brains else ""


def _compared(known: _Brains, simulation: Simulation) -> list[Comparison]:
    """Return the comparisons of a simulation, each with the first candidate of a later
    week."""
    start = known.brains[simulation.brain]
    candidates = _candidates(known, start)
    same = comparable(start, known.brains.values())
    rows = []
    for week in simulation.weeks[1:]:
        shown = [brain for brain in candidates if brain.week == week]
        if not shown:
            continue
        row = Comparison(
            run=simulation.run,
            brain=start.id,
            week=week,
            shown=shown[0].id,
            observed=None,
            adjacent=None,
        )
        observed = [brain for brain in shown if brain.shape is None]
        if observed and start.shape is None:
            earlier = []
            for brain in same:
                if brain.week < week and brain.shape is None:
                    earlier.append(brain)
            adjacent = max(earlier, key=lambda brain: brain.week)
            row = replace(
                row,
                observed=observed[0].id,
                adjacent=adjacent.id,
            )
        rows.append(row)
    return rows


def _simulated(simulation: Simulation, start: Brain) -> list[MeasuredBrain]:
    """Return the simulated brains of a simulation."""
    rows = []
    run_folder = simulation.file(paths.RUN)
    # the regions of a run are the same at all its weeks
    regions = f"{run_folder}/metrics" if simulation.has_regions else None
    for week in simulation.weeks:
        week_folder = paths.file_of(paths.WEEK, week=week)
        surfaces = f"{run_folder}/surfaces/{week_folder}"
        tables = f"{run_folder}/metrics/{week_folder}"
        row = MeasuredBrain(
            id=start.id,
            run=simulation.run,
            week=week,
            thickness=f"{surfaces}/thickness.shape.gii",
            **measured_files(start.sides, surfaces, tables, regions),
        )
        rows.append(row)
    return rows


def _shared_runs(
    config: Config,
    variants: Sequence[_Variant],
    simulations: Iterable[Simulation],
) -> tuple[dict[str, str], dict[str, set[float]]]:
    """Return the run that each run of a sweep is simulated by, and the weeks of
    comparison of these runs, by name.

    Equal runs are simulated once, to the latest of their weeks. If a run of `runs` is
    equal too, and its simulations have all their weeks, they share that one.
    """
    weeks_of: dict[str, set[float]] = {}
    for variant in variants:
        weeks = weeks_of.setdefault(_equality_key(variant.settings), set())
        weeks.add(variant.settings.end_week)
    lacking = set()
    for simulation in simulations:
        weeks = weeks_of.get(_equality_key(simulation.settings), set())
        if not weeks <= set(simulation.weeks):
            lacking.add(simulation.run)
    shared: dict[str, str] = {}
    for name, run in config.runs.items():
        if name not in lacking:
            shared.setdefault(_equality_key(run), name)
    names = {}
    for variant in variants:
        key = _equality_key(variant.settings)
        names[variant.run] = shared.setdefault(key, variant.run)
    return names, {shared[key]: weeks for key, weeks in weeks_of.items()}


def _equality_key(run: Run) -> str:
    """Return a text that is the same for runs whose shapes are the same at each
    week."""
    return run.model_dump_json(
        exclude={"end_week", "preset", "ranks", "fields", "ensemble"}
    )


def _weeks(
    settings: Run,
    start: Brain,
    further: Iterable[float],
) -> list[float]:
    weeks = set(
        output_weeks(start.week, settings.end_week, settings.output_every_gw),
    )
    for week in further:
        if week < settings.end_week:
            weeks.add(week)
    return sorted(weeks)


def _up_to_last_scan(
    run: Run,
    start: Brain,
    series: Series,
) -> Run:
    """Return a run that ends with the last scan if it follows the scans of one
    subject."""
    scans = series.brains.get(series.with_brain(start), ())
    follows_scans = run.growth.shapes == "self" and start.subject is not None
    if not follows_scans or several_subjects(scans):
        return run
    last = max((brain.week for brain in scans), default=start.week)
    if last <= start.week:
        return run
    return run.model_copy(update={"end_week": min(run.end_week, last)})


def _missing_brains(
    pair: _Pair,
    series: Series,
    chains: Chains,
) -> InputError | None:
    """Return the error of a run that lacks brains to grow a start brain towards, or
    None."""
    start = pair.start
    end = pair.settings.end_week
    origin = pair.settings.growth.shapes
    if origin is None:
        return None
    chain = chains[start.id, origin]
    if origin == "self":
        usable_series = [series.with_brain(start)] if series.with_brain(start) else []
        # the start and a later brain
        is_complete = len(chain.brains) > 1
    else:
        usable_series = series.from_other_populations(start)
        # the start and two brains of the atlas, the first not long after the start
        has_growth = len(chain.brains) > 2
        is_complete = has_growth and start.week >= chain.weeks[1] - BEFORE_GW
    if is_complete and chain.weeks[-1] >= end:
        return None
    if not usable_series:
        found = f"none; the growth series are {', '.join(series.brains)}"
    elif len(usable_series) > 1:
        found = f"several series: {', '.join(usable_series)}"
    else:
        with_weeks = zip(chain.brains, chain.weeks, strict=True)
        found = ", ".join(f"{brain} ({week:g} GW)" for brain, week in with_weeks)
        unmatched = series.unmatched.get(usable_series[0])
        if origin == "self" and unmatched:
            found += f"; {unmatched}"
    source, remedy = GROWN_TOWARDS[origin]
    return InputError(
        f"run {pair.run} needs later brains to grow {start.id} towards, up to"
        f" {end:g} GW",
        found=found,
        expected=f"brains of {source}, from {start.week:g} to {end:g} GW",
        remedy=remedy,
    )


def _compared_with(
    settings: ComparisonSettings,
    start: Brain,
    brains: Mapping[str, Brain],
) -> tuple[str, ...]:
    """Return the brains that runs from a start brain are compared with in a sweep or a
    calibration."""
    if settings.compare_with is not None:
        return tuple(name for name in brains if name in settings.compare_with)
    same_week = []
    for brain in brains.values():
        if brain.week == settings.compare_week:
            same_week.append(brain)
    own = [brain for brain in same_week if brain.population == start.population]
    return tuple(brain.id for brain in own or same_week)


def _sweeps(
    config: Config,
    variants: Iterable[_Variant],
    simulated_by: Mapping[str, str],
    simulations: Collection[Simulation],
    brains: Mapping[str, Brain],
) -> list[SweepRun]:
    """Return the runs of all sweeps with their varied values, a row for each start
    brain.

    `simulated_by` has for each run of a sweep the run that is simulated for it, as
    equal ones are simulated once.
    """
    rows = []
    for variant in variants:
        settings = config.sweeps[variant.sweep]
        run = simulated_by[variant.run]
        for simulation in simulations:
            if simulation.run == run:
                row = SweepRun(
                    sweep=variant.sweep,
                    member=variant.run,
                    week=settings.compare_week,
                    run=run,
                    brain=simulation.brain,
                    values=variant.values,
                    observed=_compared_with(settings, brains[simulation.brain], brains),
                )
                rows.append(row)
    return rows


def _calibration(
    config: Config,
    simulations: Iterable[Simulation],
    brains: Mapping[str, Brain],
) -> list[CalibrationRun]:
    """Return the runs of the calibration, by round."""
    settings = config.calibrate
    if settings is None:
        return []
    rows = []
    for run, number in settings.runs.items():
        for simulation in simulations:
            if simulation.run == settings.base:
                start = brains[simulation.brain]
                row = CalibrationRun(
                    run=run,
                    round=number,
                    design=paths.DESIGN.format(round=number),
                    score=paths.SCORE.format(run=run),
                    brain=simulation.brain,
                    observed=_compared_with(settings, start, brains),
                )
                rows.append(row)
    return rows
