"""Resolve a configuration into a study: the brains, weeks and files of each run and
sweep."""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from ..errors import InputError
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
from .atlases import used_atlases
from .brains import comparable, plan_brains
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


@dataclass(frozen=True)
class _Variant:
    """A run of a sweep, with its varied values by key."""

    sweep: str
    run: str
    values: Mapping[str, Any]
    settings: Run


@dataclass(frozen=True)
class _Folded:
    """A run with one of its start brains."""

    run: str
    start: Brain
    settings: Run


def resolve(config: Config, refused: Collection[str] = ()) -> Study:
    """Return the study of a configuration, without the brains that are `refused`.

    No other brain replaces a refused start brain. A start brain whose growth needs
    refused brains is not folded either (see `Study.unreachable`). InputError if a run
    lacks brains to grow towards and none is refused.
    """
    # their descriptions and folders are read once
    atlases = used_atlases(config)
    brains = plan_brains(config, refused, atlases)
    accepted = list(brains.values())
    series = series_of(config, brains, atlases)
    swept = _variants(config)
    folded = list(_folded(config, brains, series, swept))
    chains = _chains(folded, series, accepted)
    unreachable: dict[str, InputError] = {}
    for one in folded:
        error = _missing_brains(one, series, chains)
        if error is not None:
            unreachable.setdefault(one.start.id, error)
    if unreachable and not refused:
        raise next(iter(unreachable.values()))
    folded = [one for one in folded if one.start.id not in unreachable]
    chains = {key: chain for key, chain in chains.items() if key[0] not in unreachable}
    planned = _Simulations(config, series, chains, accepted)
    planned._add_runs(folded)
    names = planned._add_variants(folded, swept)
    simulations = planned.simulations.values()
    return Study(
        config=config,
        used_atlases=atlases,
        brains=brains,
        series=series,
        simulations=planned.simulations,
        chains=chains,
        sweeps=_sweeps(config, swept, names, simulations, accepted),
        calibration=_calibration(config, simulations, accepted),
        unreachable=unreachable,
    )


# simulations


def _variants(config: Config) -> list[_Variant]:
    """Return the runs of all sweeps. They have no ensembles."""
    found = []
    for name, sweep in config.studies.items():
        base = config.runs[sweep.base]
        for run, values in variants(name, sweep):
            changes = {**sweep.changes(values), "ensemble": None}
            found.append(_Variant(name, run, values, changed(base, changes)))
    return found


def _folded(
    config: Config,
    brains: Mapping[str, Brain],
    series: Series,
    variants: Iterable[_Variant],
) -> Iterator[_Folded]:
    """Yield each run with each start brain that is not refused: those of `runs`, of
    sweeps and of the calibration."""
    ids = [brain.id for brain in config.brains]
    starts = {}
    for name, run in config.runs.items():
        names = starts_of(config.start, run, ids)
        starts[name] = [brains[brain] for brain in names if brain in brains]
    for name, run in config.runs.items():
        for start in starts[name]:
            yield _Folded(name, start, _up_to_last_scan(run, start, series))
    for variant in variants:
        for start in starts[config.studies[variant.sweep].base]:
            yield _Folded(variant.run, start, variant.settings)
    calibrate = config.calibrate
    if calibrate is not None:
        changes = {"end_week": calibrate.compare_week, "ensemble": None}
        settings = config.runs[calibrate.base].model_copy(update=changes)
        for name in calibrate.runs:
            for start in starts[calibrate.base]:
                yield _Folded(name, start, settings)


def _chains(
    folded: Iterable[_Folded], series: Series, brains: Sequence[Brain]
) -> Chains:
    ends: dict[Brain, float] = {}
    for one in folded:
        ends[one.start] = max(one.settings.end_week, ends.get(one.start, 0.0))
    chains: Chains = {}
    for start, end in ends.items():
        chains |= chains_of(start, end, series, brains)
    return chains


@dataclass
class _Simulations:
    """The simulations of a study by run and start brain. The chains of members of
    ensembles are added to `chains`."""

    config: Config
    series: Series
    chains: Chains
    brains: Sequence[Brain]
    simulations: dict[tuple[str, str], Simulation] = field(default_factory=dict)

    def _add_runs(self, folded: Iterable[_Folded]) -> None:
        """Add the simulations of `runs`, and the members of their ensembles."""
        own = [one for one in folded if one.run in self.config.runs]
        predicted = {one.start for one in own if one.settings.growth.shapes == "atlas"}
        for one in own:
            start = one.start
            further: list[float] = []
            if start in predicted:
                further = later_observed_weeks(start, self.brains)
            weeks = _weeks(one.settings, start, further)
            self._add(one, weeks)
            alone = one.settings.model_copy(update={"ensemble": None})
            for name, variation in members_of(one.run, one.settings).items():
                member = self._add(_Folded(name, start, alone), weeks, one.run)
                if member.chain is not None:
                    self.chains[start.id, member.chain] = member_chain(
                        one.run,
                        start,
                        one.settings,
                        variation,
                        self.series,
                        self.brains,
                    )

    def _add_variants(
        self, folded: Iterable[_Folded], variants: Sequence[_Variant]
    ) -> dict[str, str]:
        """Add the simulations of sweeps and of the calibration; return the simulated
        run of each run of a sweep, by its name."""
        names, compared = _shared_runs(self.config, variants, self.simulations.values())
        calibrate = self.config.calibrate
        for one in folded:
            if one.run in compared and one.run not in self.config.runs:
                weeks = compared[one.run]
                settings = one.settings.model_copy(update={"end_week": max(weeks)})
                complete = _Folded(one.run, one.start, settings)
                self._add(complete, _weeks(settings, one.start, weeks))
            elif calibrate is not None and one.run in calibrate.runs:
                self._add(one, [one.start.week, one.settings.end_week])
        return names

    def _add(
        self, folded: _Folded, weeks: Sequence[float], member_of: str | None = None
    ) -> Simulation:
        """Add a simulation, unless there is one of that name, with the brains that it
        is compared with."""
        start = folded.start
        growth = folded.settings.growth
        # the run is also compared with brains of other subjects if it grows towards
        # them
        candidates = comparable(start, self.brains)
        for brain in self.chains[start.id, "self"].later:
            if brain.sides == start.sides and brain not in candidates:
                candidates.append(brain)
        candidates.sort(key=lambda brain: brain.subject_name != start.subject_name)
        observed_brains = {}
        observed = {}
        for week in weeks[1:]:
            same_week = [brain for brain in candidates if brain.week == week]
            if same_week:
                observed_brains[week] = tuple(same_week)
            real = [brain for brain in same_week if brain.shape is None]
            if real and start.shape is None:
                observed[week] = real[0]
        later = set()
        for brain in self.brains:
            is_scan = start.subject is not None and brain.subject == start.subject
            if brain.week > start.week and (is_scan or brain in candidates):
                later.add(brain)
        atlas_brains = self.chains[start.id, "atlas"].later
        is_atlas_prediction = growth.shapes == "atlas" and later.isdisjoint(
            atlas_brains
        )
        follows_observed = bool(growth.shapes) or growth.follows_sizes
        is_explained = follows_observed and not is_atlas_prediction
        base = folded.run
        if self.config.calibrate and folded.run in self.config.calibrate.runs:
            base = self.config.calibrate.base
        simulation = Simulation(
            run=folded.run,
            start=start,
            settings=folded.settings,
            weeks=tuple(weeks),
            series=self.series.for_sizes(start),
            base=base,
            member_of=member_of,
            observed_brains=observed_brains,
            observed=observed,
            kind="explained" if is_explained else "predicted",
            is_atlas_prediction=is_atlas_prediction,
            has_regions=bool(start.regions) and folded.run in self.config.runs,
        )
        return self.simulations.setdefault((folded.run, start.id), simulation)


def _shared_runs(
    config: Config, variants: Sequence[_Variant], simulations: Iterable[Simulation]
) -> tuple[dict[str, str], dict[str, set[float]]]:
    """Return the run that each run of a sweep is simulated by, and the weeks of
    comparison of these runs, by name.

    Equal runs are simulated once, to the latest of their weeks. If a run of `runs` is
    equal too, and its simulations have all their weeks, they share that one.
    """
    compared: dict[str, set[float]] = {}
    for variant in variants:
        weeks = compared.setdefault(_equality_key(variant.settings), set())
        weeks.add(variant.settings.end_week)
    lacking = set()
    for simulation in simulations:
        weeks = compared.get(_equality_key(simulation.settings), set())
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
    return names, {shared[key]: weeks for key, weeks in compared.items()}


def _equality_key(run: Run) -> str:
    """Return a text that is the same for runs whose shapes are the same at each
    week."""
    return run.model_dump_json(
        exclude={"end_week", "preset", "ranks", "fields", "ensemble"}
    )


def _weeks(settings: Run, start: Brain, further: Iterable[float]) -> list[float]:
    weeks = set(
        output_weeks(start.week, settings.end_week, settings.output_every_gw),
    )
    for week in further:
        if week < settings.end_week:
            weeks.add(week)
    return sorted(weeks)


def _up_to_last_scan(run: Run, start: Brain, series: Series) -> Run:
    """Return a run that ends with the last scan if it follows the scans of one
    subject."""
    if run.growth.shapes != "self" or start.subject is None:
        return run
    scans = series.brains.get(series.with_brain(start), ())
    last = max((brain.week for brain in scans), default=start.week)
    if several_subjects(scans) or last <= start.week:
        return run
    return run.model_copy(update={"end_week": min(run.end_week, last)})


def _missing_brains(
    folded: _Folded, series: Series, chains: Chains
) -> InputError | None:
    """Return the error of a run that lacks brains to grow a start brain towards, or
    None."""
    start = folded.start
    end = folded.settings.end_week
    origin = folded.settings.growth.shapes
    if origin is None:
        return None
    chain = chains[start.id, origin]
    available = ", ".join(f"{brain.id} ({brain.week:g} GW)" for brain in chain.brains)
    if origin == "self":
        own = series.with_brain(start)
        names = [own] if own else []
        is_complete = len(chain.brains) > 1
        if own in series.unmatched:
            available += f"; {series.unmatched[own]}"
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
    return InputError(
        f"run {folded.run} needs later brains to grow {start.id} towards, and there are"
        " none",
        found=available,
        expected=f"brains of {expected}, from {start.week:g} to {end:g} GW",
        remedy=remedy,
    )


def _compared_with(
    settings: ComparisonSettings, start: Brain, brains: Iterable[Brain]
) -> tuple[Brain, ...]:
    if settings.compare_with is not None:
        return tuple(brain for brain in brains if brain.id in settings.compare_with)
    same_week = [brain for brain in brains if brain.week == settings.compare_week]
    own = [brain for brain in same_week if brain.population == start.population]
    return tuple(own or same_week)


def _sweeps(
    config: Config,
    variants: Iterable[_Variant],
    names: Mapping[str, str],
    simulations: Collection[Simulation],
    brains: Sequence[Brain],
) -> dict[str, Sweep]:
    members: dict[str, list[tuple[Simulation, Mapping[str, Any]]]] = {}
    for variant in variants:
        for simulation in simulations:
            if simulation.run == names[variant.run]:
                member = (simulation, variant.values)
                members.setdefault(variant.sweep, []).append(member)
    sweeps = {}
    for name, of_sweep in members.items():
        settings = config.studies[name]
        observed = {
            simulation.start.id: _compared_with(settings, simulation.start, brains)
            for simulation, _ in of_sweep
        }
        sweeps[name] = Sweep(name, settings.compare_week, tuple(of_sweep), observed)
    return sweeps


def _calibration(
    config: Config, simulations: Iterable[Simulation], brains: Sequence[Brain]
) -> CalibrationRuns | None:
    settings = config.calibrate
    if settings is None:
        return None
    base = [simulation for simulation in simulations if simulation.run == settings.base]
    if not base:
        return None
    observed = {}
    for simulation in base:
        start = simulation.start
        observed[start.id] = _compared_with(settings, start, brains)
    return CalibrationRuns(tuple(base), settings.runs, observed)
