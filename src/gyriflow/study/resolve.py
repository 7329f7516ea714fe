"""Resolve a configuration into a study: the brains, weeks and files of each run and
sweep."""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import Any, Literal

from ..errors import InputError
from ..io.volumes import LabelSource
from ..io.yaml_files import SCHEMES
from ..settings.brains import BrainConfig
from ..settings.folding import output_weeks
from ..settings.growth import BEFORE_GW
from ..settings.root import Config
from ..settings.runs import (
    ComparisonSettings,
    Run,
    changed,
    members_of,
    starts_of,
    variants,
)
from ..settings.schemes import LabelScheme
from ..settings.terms import SIDES
from .atlases import known_checksums, used_atlases
from .records import Brain, CalibrationRuns, Simulation, Sweep
from .series import (
    Chain,
    Series,
    chains_of,
    later_observed_weeks,
    member_chain,
    series_of,
    several_subjects,
)
from .study import Study

Chains = dict[tuple[str, str], Chain]
Variant = tuple[str, str, Mapping[str, Any], Run]
"""A run of a sweep: the names of the sweep and of the run, its varied values by key,
and its settings."""


def resolve(config: Config, refused: Collection[str] = ()) -> Study:
    """Return the study of a configuration, without the brains that are `refused`.

    No other brain replaces a refused start brain. A start brain whose growth needs
    refused brains is not folded either (see `Study.unreachable`). InputError if a run
    lacks brains to grow towards and none is refused.
    """
    # their descriptions and folders are read once
    atlases = used_atlases(config)
    checksums = known_checksums(atlases)
    brains = {
        brain.id: _brain(brain, config, refused, checksums)
        for brain in config.brains
        if brain.id not in refused
    }
    accepted, series = list(brains.values()), series_of(config, brains, atlases)
    swept = [
        (
            name,
            member,
            values,
            changed(
                config.runs[sweep.base], {**sweep.changes(values), "ensemble": None}
            ),
        )
        for name, sweep in config.studies.items()
        for member, values in variants(name, sweep)
    ]
    folded = list(_folded(config, brains, series, swept))
    ends: dict[Brain, float] = {}
    for _, start, run in folded:
        ends[start] = max(run.end_week, ends.get(start, 0.0))
    chains: Chains = {}
    for start, end in ends.items():
        chains |= chains_of(start, end, series, accepted)
    unreachable: dict[str, InputError] = {}
    for name, start, run in folded:
        if run.growth.shapes and (
            error := _missing_brains(name, start, run, series, chains)
        ):
            unreachable.setdefault(start.id, error)
    if unreachable and not refused:
        raise next(iter(unreachable.values()))
    folded = [
        (name, start, run) for name, start, run in folded if start.id not in unreachable
    ]
    simulations, names = _simulations(config, folded, swept, series, chains, accepted)
    calibration = None
    if (settings := config.calibrate) is not None:
        base = tuple(
            simulation
            for simulation in simulations.values()
            if simulation.run == settings.base
        )
        observed = {
            simulation.start.id: _compared_with(settings, simulation.start, accepted)
            for simulation in base
        }
        calibration = CalibrationRuns(base, settings.runs, observed) if base else None
    return Study(
        config=config,
        used_atlases=atlases,
        checksums=checksums,
        brains=brains,
        series=series,
        simulations=simulations,
        chains={
            key: chain for key, chain in chains.items() if key[0] not in unreachable
        },
        sweeps=_sweeps(config, swept, names, simulations.values(), accepted),
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
    settings: BrainConfig,
    config: Config,
    refused: Collection[str],
    checksums: Mapping[str, tuple[str, str]],
) -> Brain:
    labels = None
    if (volume := settings.label_volume) is not None:
        labels = LabelSource(
            volume, settings.affine_from, label_scheme(config, settings)
        )
    has_thickness = bool(settings.white_files) or (
        labels is not None and bool(labels.scheme.cortex)
    )
    is_whole = len(settings.sides) == len(SIDES)
    with_regions = [name for name in config.metrics.regions if name not in refused]
    regions_from: Literal["given", "carried"] | None = None
    if is_whole and settings.id in with_regions:
        regions_from = "given"
    elif is_whole and with_regions and settings.source != "shape":
        regions_from = "carried"
    return Brain(
        config=settings,
        labels=labels,
        has_thickness=has_thickness,
        has_white=bool(settings.white_files)
        or (has_thickness and config.metrics.white_surfaces == "all"),
        regions_from=regions_from,
        checksums={
            path: checksums[path] for path in settings.files if path in checksums
        },
    )


# simulations


def _folded(
    config: Config,
    brains: Mapping[str, Brain],
    series: Series,
    swept: Iterable[Variant],
) -> Iterator[tuple[str, Brain, Run]]:
    """Yield each run with each start brain that is not refused: those of `runs`, of
    sweeps and of the calibration."""
    ids = [brain.id for brain in config.brains]
    starts = {
        name: [brains[id] for id in starts_of(config.start, run, ids) if id in brains]
        for name, run in config.runs.items()
    }
    for name, run in config.runs.items():
        yield from (
            (name, start, _up_to_last_scan(run, start, series))
            for start in starts[name]
        )
    for sweep, name, _, run in swept:
        yield from ((name, start, run) for start in starts[config.studies[sweep].base])
    if (calibrate := config.calibrate) is not None:
        run = config.runs[calibrate.base]
        run = run.model_copy(
            update={"end_week": calibrate.compare_week, "ensemble": None}
        )
        yield from (
            (name, start, run)
            for name in calibrate.runs
            for start in starts[calibrate.base]
        )


def _simulations(
    config: Config,
    folded: Sequence[tuple[str, Brain, Run]],
    swept: Sequence[Variant],
    series: Series,
    chains: Chains,
    brains: Sequence[Brain],
) -> tuple[dict[tuple[str, str], Simulation], dict[str, str]]:
    """Return the simulations by run and start brain, and the simulated run of each run
    of a sweep, by its name.

    The chains of members of ensembles are added to `chains`.
    """
    simulations: dict[tuple[str, str], Simulation] = {}

    def add(
        run: str,
        start: Brain,
        settings: Run,
        weeks: Sequence[float],
        member_of: str | None = None,
    ) -> Simulation:
        """Add a simulation, unless there is one of that name, with the brains that it
        is compared with."""
        # the run is also compared with brains of other subjects if it grows towards
        # them
        targets = [
            brain
            for brain in chains[start.id, "self"].later
            if brain.sides == start.sides
        ]
        candidates = list(dict.fromkeys([*start.comparable(brains), *targets]))
        candidates.sort(key=lambda brain: brain.subject != start.subject)
        by_week = {
            week: tuple(brain for brain in candidates if brain.week == week)
            for week in weeks[1:]
        }
        measured = {
            week: [brain for brain in same_week if not brain.config.synthetic]
            for week, same_week in by_week.items()
        }
        scans = [
            brain
            for brain in brains
            if start.config.subject is not None and brain.subject == start.subject
        ]
        later = {brain for brain in (*candidates, *scans) if brain.week > start.week}
        growth = settings.growth
        is_atlas_prediction = growth.shapes == "atlas" and later.isdisjoint(
            chains[start.id, "atlas"].later
        )
        simulation = Simulation(
            run=run,
            start=start,
            settings=settings,
            weeks=tuple(weeks),
            series=series.for_sizes(start),
            base=(
                config.calibrate.base
                if config.calibrate and run in config.calibrate.runs
                else run
            ),
            member_of=member_of,
            observed_brains={
                week: same_week for week, same_week in by_week.items() if same_week
            },
            observed={
                week: found[0]
                for week, found in measured.items()
                if found and not start.config.synthetic
            },
            kind=(
                "explained"
                if not is_atlas_prediction and (growth.shapes or growth.follows_sizes)
                else "predicted"
            ),
            is_atlas_prediction=is_atlas_prediction,
            has_regions=start.has_regions and run in config.runs,
        )
        return simulations.setdefault((run, start.id), simulation)

    predicted = {
        start
        for name, start, run in folded
        if name in config.runs and run.growth.shapes == "atlas"
    }
    for name, start, run in folded:
        if name in config.runs:
            weeks = _weeks(
                run,
                start,
                later_observed_weeks(start, brains) if start in predicted else (),
            )
            add(name, start, run, weeks)
            for member, variation in members_of(name, run).items():
                simulation = add(
                    member,
                    start,
                    run.model_copy(update={"ensemble": None}),
                    weeks,
                    name,
                )
                if simulation.chain:
                    chains[start.id, simulation.chain] = member_chain(
                        name, start, run, variation, series, brains
                    )
    names, compared = _shared_runs(config, swept, simulations.values())
    for name, start, run in folded:
        if name in compared and name not in config.runs:
            complete = run.model_copy(update={"end_week": max(compared[name])})
            add(name, start, complete, _weeks(complete, start, compared[name]))
        elif config.calibrate is not None and name in config.calibrate.runs:
            add(name, start, run, [start.week, run.end_week])
    return simulations, names


def _shared_runs(
    config: Config, swept: Sequence[Variant], simulations: Iterable[Simulation]
) -> tuple[dict[str, str], dict[str, set[float]]]:
    """Return the run that each run of a sweep is simulated by, and the weeks of
    comparison of these runs, by name.

    Equal runs are simulated once, to the latest of their weeks. If a run of `runs` is
    equal too, and its simulations have all their weeks, they share that one.
    """
    compared: dict[str, set[float]] = {}
    for _, _, _, run in swept:
        compared.setdefault(_equality_key(run), set()).add(run.end_week)
    lacking = {
        simulation.run
        for simulation in simulations
        if compared.get(_equality_key(simulation.settings), set())
        - set(simulation.weeks)
    }
    shared = {
        _equality_key(run): name
        for name, run in reversed(list(config.runs.items()))
        if name not in lacking
    }
    names = {
        name: shared.setdefault(_equality_key(run), name) for _, name, _, run in swept
    }
    return names, {shared[key]: weeks for key, weeks in compared.items()}


def _equality_key(run: Run) -> str:
    """Return a text that is the same for runs whose shapes are the same at each
    week."""
    return run.model_dump_json(
        exclude={"end_week", "preset", "ranks", "fields", "ensemble"}
    )


def _weeks(settings: Run, start: Brain, further: Iterable[float]) -> list[float]:
    weeks = output_weeks(start.week, settings.end_week, settings.output_every_gw)
    return sorted({*weeks, *(week for week in further if week < weeks[-1])})


def _up_to_last_scan(run: Run, start: Brain, series: Series) -> Run:
    """Return a run that ends with the last scan if it follows the scans of one
    subject."""
    scans = series.brains.get(series.with_brain(start), ())
    last = max((brain.week for brain in scans), default=start.week)
    if (
        run.growth.shapes != "self"
        or start.config.subject is None
        or several_subjects(scans)
        or last <= start.week
    ):
        return run
    return run.model_copy(update={"end_week": min(run.end_week, last)})


def _missing_brains(
    name: str, start: Brain, run: Run, series: Series, chains: Chains
) -> InputError | None:
    """Return the error of a run that lacks brains to grow a start brain towards, or
    None."""
    end, origin = run.end_week, str(run.growth.shapes)
    chain = chains[start.id, origin]
    available = ", ".join(f"{brain.id} ({brain.week:g} GW)" for brain in chain.brains)
    if origin == "self":
        names = [own] if (own := series.with_brain(start)) else []
        is_complete = len(chain.brains) > 1
        available += "".join(
            f"; {series.unmatched[own]}" for own in names if own in series.unmatched
        )
        expected = (
            "the start's own growth series with label volumes or matched surfaces"
        )
        remedy = (
            "Add later brains to its series (growth.brains), or grow by sizes or rates."
        )
    else:
        names = series.from_other_populations(start)
        is_complete = (
            len(chain.brains) > 2 and start.week >= chain.later[0].week - BEFORE_GW
        )
        expected = "one series of another population with the same hemispheres"
        remedy = (
            "Add an atlas of these weeks, or name one of several series in"
            " growth.series."
        )
    if is_complete and chain.weeks[-1] >= end:
        return None
    if not names:
        available = f"none; the growth series are {', '.join(series.brains)}"
    elif len(names) > 1:
        available = f"several series: {', '.join(names)}"
    text = (
        f"run {name} needs later brains to grow {start.id} towards, and there are none"
    )
    expected = f"brains of {expected}, from {start.week:g} to {end:g} GW"
    return InputError(text, found=available, expected=expected, remedy=remedy)


def _compared_with(
    settings: ComparisonSettings, start: Brain, brains: Iterable[Brain]
) -> tuple[Brain, ...]:
    if settings.compare_with is not None:
        return tuple(brain for brain in brains if brain.id in settings.compare_with)
    same_week = [brain for brain in brains if brain.week == settings.compare_week]
    same_population = [
        brain
        for brain in same_week
        if brain.config.population == start.config.population
    ]
    return tuple(same_population or same_week)


def _sweeps(
    config: Config,
    swept: Sequence[Variant],
    names: Mapping[str, str],
    simulations: Collection[Simulation],
    brains: Sequence[Brain],
) -> dict[str, Sweep]:
    sweeps = {}
    for name, settings in config.studies.items():
        runs = [
            (names[run], values) for sweep, run, values, _ in swept if sweep == name
        ]
        members = [
            (simulation, values)
            for run, values in runs
            for simulation in simulations
            if simulation.run == run
        ]
        observed = {
            member.start.id: _compared_with(settings, member.start, brains)
            for member, _ in members
        }
        if members:
            sweeps[name] = Sweep(name, settings.compare_week, tuple(members), observed)
    return sweeps
