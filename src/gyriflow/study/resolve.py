"""Resolve a configuration once: which brains, weeks and files stand behind each run and each comparison."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal

from ..errors import InputError
from ..io.volumes import LabelSource
from ..io.yaml_files import SCHEMES
from ..settings.brains import Brain as GivenBrain
from ..settings.folding import output_weeks
from ..settings.growth import BEFORE_GW, SIZES
from ..settings.root import Config
from ..settings.runs import Compared, Run, changed, starts_of, variants
from ..settings.schemes import LabelScheme
from ..settings.terms import SIDES
from .atlases import known_checksums
from .paths import CURVES
from .records import Brain, CalibrationRuns, Chain, Comparison, Origin, Simulation
from .series import Series, series_of, several_subjects
from .study import Study

Chains = Mapping[tuple[str, Origin], Chain]


def resolve(config: Config, refused: Collection[str] = ()) -> Study:
    """Return the study of a configuration, without the brains that are `refused`.

    No other brain is folded in the place of a refused one. Start brains that, without them, no brains lead to the end
    of a run that grows towards shapes are not folded either, as `Study.unreachable` says; InputError where no brain is
    refused and there are such.
    """
    checksums = known_checksums(config)
    brains = {given.id: _brain(given, config, refused, checksums) for given in config.brains if given.id not in refused}
    accepted, series = list(brains.values()), series_of(config, brains)
    foldings, members = _foldings(config, brains, series)
    chains = _chains(foldings, series, accepted)
    unreachable = _unreachable(foldings, series, chains)
    if unreachable and not refused:
        raise next(iter(unreachable.values()))
    if unreachable:
        foldings, members = _foldings(config, brains, series, unreachable)
        chains = _chains(foldings, series, accepted)
    simulations = {(one.run, one.start.id): _simulation(config, one, series, chains, accepted) for one in foldings}
    calibration = None
    if (asked := config.calibrate) is not None:
        base = tuple(one for one in simulations.values() if one.run == asked.base)
        real = {one.start.id: _compared_with(asked, one.start, accepted) for one in base}
        calibration = CalibrationRuns(base, asked.runs, real) if base else None
    return Study(
        config=config,
        brains=brains,
        series=series,
        simulations=simulations,
        chains=chains,
        comparisons=_comparisons(config, members, simulations.values(), accepted),
        calibration=calibration,
        unreachable=unreachable,
    )


def label_scheme(config: Config, brain: GivenBrain) -> LabelScheme:
    """Return the scheme of a brain's labels; KeyError where it has none."""
    settings = config.schemes.get(str(brain.scheme))
    if settings is None:
        return SCHEMES[str(brain.scheme)]
    return LabelScheme(name=str(brain.scheme), **settings.model_dump())


def _brain(
    given: GivenBrain, config: Config, refused: Collection[str], checksums: Mapping[str, tuple[str, str]]
) -> Brain:
    labels = None
    if (volume := given.label_volume) is not None:
        labels = LabelSource(volume, given.affine_from, label_scheme(config, given))
    has_thickness = bool(given.white_files) or (labels is not None and bool(labels.scheme.cortex))
    whole = len(given.sides) == len(SIDES)
    regions = config.metrics.regions
    with_regions = [name for name in regions if name not in refused] if isinstance(regions, dict) else []
    regions_from: Literal["given", "carried", "named"] | None = None
    if whole and given.id in with_regions:
        regions_from = "given"
    elif whole and with_regions and given.source != "shape":
        regions_from = "carried"
    elif whole and not with_regions and not given.synthetic:
        regions_from = "named"
    return Brain(
        given=given,
        labels=labels,
        has_thickness=has_thickness,
        has_white=bool(given.white_files) or (has_thickness and config.metrics.white_surfaces == "all"),
        regions_from=regions_from,
        has_regions=bool(regions_from) and (bool(with_regions) or regions == "named_sulci"),
        checksums={path: checksums[path] for path in given.files if path in checksums},
    )


def _compared_weeks(start: Brain, brains: Iterable[Brain]) -> list[float]:
    alike = [brain for brain in start.comparable(brains) if not brain.given.synthetic]
    return sorted({brain.week for brain in alike if brain.week > start.week})


# what is folded


@dataclass(frozen=True)
class _Folding:
    """A run from one brain, before it is known what stands behind it."""

    run: str
    start: Brain
    settings: Run
    weeks: list[float]


@dataclass(frozen=True)
class Member:
    """A run of a study: its name, the varied values by their keys, and its complete settings.

    The name is that of an equal run of `runs` or of an earlier study, where there is one.
    """

    run: str
    values: Mapping[str, Any]
    settings: Run


def _foldings(
    config: Config, brains: Mapping[str, Brain], series: Series, left_out: Collection[str] = ()
) -> tuple[list[_Folding], dict[str, list[Member]]]:
    ids = [brain.id for brain in config.brains]
    starts = {
        name: [brains[id] for id in starts_of(config.start, run, ids) if id in brains and id not in left_out]
        for name, run in config.runs.items()
    }
    predicted = [start for name, run in config.runs.items() if _shapes(run) == "atlas" for start in starts[name]]
    further = {start: _compared_weeks(start, brains.values()) for start in predicted}
    foldings = []
    for name, run in config.runs.items():
        for start in starts[name]:
            settings = _up_to_last_scan(run, start, series)
            foldings.append(_Folding(name, start, settings, _weeks(settings, start, further.get(start, []))))
    members = _members(config, foldings)
    varied: dict[str, tuple[Run, list[Brain], set[float]]] = {}
    for name, study in config.studies.items():
        for member in members[name]:
            if member.run not in config.runs:
                _, _, weeks = varied.setdefault(member.run, (member.settings, starts[study.base], set()))
                weeks.add(study.compare_week)
    foldings += [
        _Folding(run, start, settings, _weeks(settings, start, weeks))
        for run, (settings, its_starts, weeks) in varied.items()
        for start in its_starts
    ]
    if (calibrate := config.calibrate) is not None:
        week = calibrate.compare_week
        settings = config.runs[calibrate.base].model_copy(update={"end_week": week})
        foldings += [
            _Folding(run, start, settings, [start.week, week])
            for run in calibrate.runs
            for start in starts[calibrate.base]
        ]
    return foldings, members


def _members(config: Config, foldings: Sequence[_Folding]) -> dict[str, list[Member]]:
    """Return the members of each study; equal ones share a run, which ends at the latest of their weeks.

    They share one of the `foldings` of `runs` where these have all of their weeks.
    """
    wanted = [
        (name, member, values, changed(config.runs[study.base], study.changes(values)))
        for name, study in config.studies.items()
        for member, values in variants(name, study)
    ]
    weeks: dict[str, set[float]] = {}
    for *_, settings in wanted:
        weeks.setdefault(_model(settings), set()).add(settings.end_week)
    solved = {
        _model(run): name
        for name, run in reversed(list(config.runs.items()))
        if all(weeks.get(_model(run), set()) <= set(one.weeks) for one in foldings if one.run == name)
    }
    members: dict[str, list[Member]] = {name: [] for name in config.studies}
    for name, member, values, settings in wanted:
        run = solved.setdefault(_model(settings), member)
        complete = config.runs.get(run) or changed(settings, {"end_week": max(weeks[_model(settings)])})
        members[name].append(Member(run, values, complete))
    return members


def _model(run: Run) -> str:
    # what may differ between runs of the same shapes is left out
    return run.model_dump_json(exclude={"end_week", "preset", "ranks", "fields"})


def _weeks(settings: Run, start: Brain, further: Iterable[float]) -> list[float]:
    weeks = output_weeks(start.week, settings.end_week, settings.output_every_gw)
    return sorted({*weeks, *(week for week in further if week < weeks[-1])})


def _up_to_last_scan(run: Run, start: Brain, series: Series) -> Run:
    """Return a run that, where it follows the scans of one subject, ends with the last: each has its own."""
    scans = series.brains.get(series.with_brain(start), ())
    last = max((brain.week for brain in scans), default=start.week)
    if _shapes(run) != "self" or start.given.subject is None or several_subjects(scans) or last <= start.week:
        return run
    return run.model_copy(update={"end_week": min(run.end_week, last)})


def _shapes(settings: Run) -> Origin | None:
    return settings.growth.of if settings.growth.definition.measured == "shapes" else None


# which brains stand behind a run's growth


def _chains(foldings: Sequence[_Folding], series: Series, brains: Iterable[Brain]) -> dict[tuple[str, Origin], Chain]:
    ends: dict[Brain, float] = {}
    for one in foldings:
        ends[one.start] = max(one.settings.end_week, ends.get(one.start, 0.0))
    chains: dict[tuple[str, Origin], Chain] = {}
    for start, end in ends.items():
        through: dict[Origin, list[Brain]] = {
            "self": _own_chain(start, end, series),
            "atlas": _atlas_chain(start, end, series),
        }
        for origin, members in through.items():
            known = {brain.week for brain in members[1:]}
            compared = _compared_weeks(start, brains) if origin == "atlas" else []
            chains[start.id, origin] = Chain(
                brains=tuple(members),
                correspondences=tuple(series.correspondence(*pair) for pair in pairwise(members)),
                posed=tuple(series.posed(*pair) for pair in pairwise(members)),
                further_weeks=tuple(week for week in compared if week <= end and week not in known),
            )
    return chains


def _own_chain(start: Brain, end: float, series: Series) -> list[Brain]:
    """Return a start brain and the later ones of its growth series, up to the first past an end week, one a week.

    All have label volumes, or surfaces with the same vertices.
    """
    # in a population's, its own scan of a week comes first
    members = sorted(series.brains.get(series.with_brain(start), ()), key=lambda brain: brain.subject != start.subject)
    # the first brain past the end tells of growth up to it
    last = min((brain.week for brain in members if brain.week >= end), default=end)
    chosen = {start.week: start}
    for brain in members:
        volumes = start.given.has_labels and brain.given.has_labels
        if start.week < brain.week <= last and (volumes or series.are_matched(start, brain)):
            chosen.setdefault(brain.week, brain)
    return sorted(chosen.values(), key=lambda brain: brain.week)


def _atlas_chain(start: Brain, end: float, series: Series) -> list[Brain]:
    """Return a start brain and those of the one series of another population, one a week.

    They begin with its last week that is not after the start, or else its first, and go on to the first past an end
    week that leaves two, as far as there are brains.
    """
    names = series.of_others(start)
    members = series.brains[names[0]] if len(names) == 1 else ()
    weekly = sorted({brain.week: brain for brain in members}.values(), key=lambda brain: brain.week)
    if not weekly:
        return [start]
    first = max((brain.week for brain in weekly if brain.week <= start.week), default=weekly[0].week)
    last = min((brain.week for brain in weekly if brain.week >= end and brain.week > first), default=end)
    return [start, *(brain for brain in weekly if first <= brain.week <= last)]


def _unreachable(foldings: Iterable[_Folding], series: Series, chains: Chains) -> dict[str, InputError]:
    """Return by start brain why no brains lead a run that grows towards shapes to its end."""
    errors: dict[str, InputError] = {}
    for one in foldings:
        start, end, origin = one.start, one.settings.end_week, _shapes(one.settings)
        if origin is None:
            continue
        chain = chains[start.id, origin]
        available = ", ".join(f"{brain.id} ({brain.week:g} GW)" for brain in chain.brains)
        if origin == "self":
            names = [name] if (name := series.with_brain(start)) else []
            near = len(chain.brains) > 1
            available += "".join(f"; {series.unmatched[name]}" for name in names if name in series.unmatched)
            expected = "the start's own growth series with label volumes or matched surfaces"
            remedy = "Add later brains to its series (growth.brains), or grow by sizes or rates."
        else:
            names = series.of_others(start)
            near = len(chain.brains) > 2 and start.week >= chain.later[0].week - BEFORE_GW
            expected = "one series of another population with the same hemispheres"
            remedy = "Add an atlas of these weeks, or name one of several series in growth.series."
        if near and chain.weeks[-1] >= end:
            continue
        if not names:
            available = f"none; the growth series are {', '.join(series.brains)}"
        elif len(names) > 1:
            available = f"several series: {', '.join(names)}"
        text = f"run {one.run} from {start.id} is to grow towards brains that are not there"
        expected = f"brains of {expected}, from {start.week:g} to {end:g} GW"
        errors.setdefault(start.id, InputError(text, found=available, expected=expected, remedy=remedy))
    return errors


# simulations, and what they are compared with


def _simulation(
    config: Config, folding: _Folding, series: Series, chains: Chains, brains: Sequence[Brain]
) -> Simulation:
    run, start, growth = folding.run, folding.start, folding.settings.growth
    shapes = _shapes(folding.settings)
    sizes = growth.definition.measured == "sizes" and "measured" in [getattr(growth, size) for size in SIZES]
    # those of other subjects are the real ones where a run is led to them
    led_to = [brain for brain in chains[start.id, "self"].later if brain.sides == start.sides]
    alike = list(dict.fromkeys([*start.comparable(brains), *led_to]))
    alike.sort(key=lambda brain: brain.subject != start.subject)
    compared = {
        week: of_week
        for week in folding.weeks[1:]
        if (of_week := tuple(brain for brain in alike if brain.week == week))
    }
    real = {
        week: real_of_week[0]
        for week, of_week in compared.items()
        if (real_of_week := [brain for brain in of_week if not brain.given.synthetic]) and not start.given.synthetic
    }
    scans = [brain for brain in brains if start.given.subject is not None and brain.subject == start.subject]
    behind = chains[start.id, "atlas"].later
    others_only = shapes == "atlas" and not any(
        brain.week > start.week for brain in (*alike, *scans) if brain in behind
    )
    return Simulation(
        run=run,
        start=start,
        settings=folding.settings,
        weeks=tuple(folding.weeks),
        shapes=shapes,
        series=series.for_sizes(start),
        curves=CURVES["curves"] if sizes or growth.thickness_mm == "measured" else [],
        base=config.calibrate.base if config.calibrate and run in config.calibrate.runs else run,
        compared=compared,
        real=real,
        kind="explained" if not others_only and (shapes or sizes) else "predicted",
        from_others_only=others_only,
        has_regions=start.has_regions and run in config.runs,
    )


def _compared_with(compared: Compared, start: Brain, brains: Iterable[Brain]) -> tuple[Brain, ...]:
    if compared.compare_with is not None:
        return tuple(brain for brain in brains if brain.id in compared.compare_with)
    of_week = [brain for brain in brains if brain.week == compared.compare_week]
    alike = [brain for brain in of_week if brain.given.population == start.given.population]
    return tuple(alike or of_week)


def _comparisons(
    config: Config, members: Mapping[str, list[Member]], simulations: Iterable[Simulation], brains: Sequence[Brain]
) -> dict[str, Comparison]:
    comparisons = {}
    for name, study in config.studies.items():
        foldings = tuple(
            (one, member.values) for member in members[name] for one in simulations if one.run == member.run
        )
        real = {one.start.id: _compared_with(study, one.start, brains) for one, _ in foldings}
        if foldings:
            comparisons[name] = Comparison(name, study.compare_week, foldings, real)
    return comparisons
