"""Resolve a configuration once: which brains, weeks and files stand behind each run and each comparison."""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

from ..config.brains import Brain as GivenBrain
from ..config.root import Config
from ..config.runs import ALL, FIRST, Compared, Member, Run, members_of
from ..errors import InputError
from ..parameters.folding import output_weeks
from ..parameters.growth import BEFORE_GW
from ..parameters.schemes import LabelScheme
from ..parameters.terms import SIDES
from ..units import week_tag
from .paths import CURVES
from .records import Brain, Calibration, Chain, Comparison, Origin, Simulation
from .series import Series, series_of
from .study import Study


def resolve(config: Config, refused: Collection[str] = ()) -> Study:
    """Return the study of a configuration, without the brains that are `refused`.

    No other brain is folded in the place of a refused one. Start brains that, without them, no brains lead to the end
    of a run that grows towards shapes are not folded either, as `Study.unreachable` says; InputError where no brain is
    refused and there are such.
    """
    brains = {given.id: _brain(given, config, refused) for given in config.brains if given.id not in refused}
    series = series_of(config, brains)
    folded = _folded(config, brains, ())
    chains = _chains(folded, series, brains.values())
    unreachable = _unreachable(folded, series, chains)
    if unreachable and not refused:
        raise next(iter(unreachable.values()))
    if unreachable:
        folded = _folded(config, brains, unreachable)
        chains = _chains(folded, series, brains.values())
    simulations = {
        (run, start.id): _simulation(config, folded, run, start, series, chains, brains.values())
        for run in folded.settings
        for start in folded.starts[run]
    }
    folded_ids = {start.id for run in config.runs for start in folded.starts[run]}
    starts = [brain for brain in brains.values() if brain.id in folded_ids]
    return Study(
        config=config,
        brains=brains,
        series=series,
        simulations=simulations,
        chains=chains,
        comparisons={
            name: Comparison(
                name,
                study.compare_week,
                tuple(
                    (simulations[member.run, start.id], member.values)
                    for member in folded.members[name]
                    for start in folded.starts[member.run]
                ),
                {id: _compared_with(study, brain, brains.values()) for id, brain in brains.items()},
            )
            for name, study in config.studies.items()
        },
        calibration=_calibration(config, folded, simulations, brains.values()),
        references=_references([one for one in simulations.values() if one.run in config.runs], brains.values()),
        norm_reference=_norm_reference(config, starts, brains.values()),
        unreachable=unreachable,
    )


def shapes_of(settings: Run) -> Origin | None:
    """Return whose growth gives the shapes that a run grows towards; None where it grows by rates or sizes."""
    return settings.growth.of if settings.growth.model == "shapes" else None


def follows_measured_sizes(settings: Run) -> bool:
    """Return whether a run's area or volume follows a curve through measured brains."""
    growth = settings.growth
    return growth.model == "sizes" and "measured" in (growth.area_cm2, growth.volume_ml)


def _brain(given: GivenBrain, config: Config, refused: Collection[str]) -> Brain:
    scheme = config.scheme(given) if given.has_labels else None
    thickness_from: Literal["labels", "white"] | None = "white" if given.white_files else None
    white_from = given.white_files
    if scheme and LabelScheme(**scheme).cortex:
        thickness_from = "labels"
        if config.metrics.white_surfaces == "all":
            white_from = white_from or {"labels": str(given.label_volume)}
    whole = len(given.sides) == len(SIDES)
    with_regions = [name for name in config.metrics.regions if name not in refused]
    regions_from: Literal["given", "carried", "named"] | None = None
    if whole and given.id in with_regions:
        regions_from = "given"
    elif whole and with_regions and given.source != "shape":
        regions_from = "carried"
    elif whole and not with_regions and not given.synthetic:
        regions_from = "named"
    return Brain(
        given=given,
        scheme=scheme,
        thickness_from=thickness_from,
        white_from=white_from,
        regions_from=regions_from,
        has_regions=bool(regions_from) and (bool(with_regions) or config.metrics.named_sulci),
        checksums={path: config.known_files[path] for path in given.files if path in config.known_files},
    )


# what is folded


@dataclass(frozen=True)
class _Folded:
    """All runs: those of `runs`, then of studies, then of the calibration.

    Attributes
    ----------
    settings, starts, weeks
        By run what it is, which brains it folds, and its output weeks by the brain's id.
    members
        The members of each study.
    ends
        Run, start and last week of all that gives a brain its growth: the calibration's runs have that of their base.
    """

    settings: Mapping[str, Run]
    starts: Mapping[str, list[Brain]]
    weeks: Mapping[tuple[str, str], list[float]]
    members: Mapping[str, list[Member]]
    ends: list[tuple[str, Brain, float]]

    def last_week(self, start: Brain) -> float:
        return max(end for _, brain, end in self.ends if brain == start)


def _folded(config: Config, brains: Mapping[str, Brain], left_out: Collection[str]) -> _Folded:
    ids = [brain.id for brain in config.brains]
    starts = {
        name: [brains[id] for id in _starts(config, run, ids) if id in brains and id not in left_out]
        for name, run in config.runs.items()
    }
    predicted = {start.id for name, run in config.runs.items() if shapes_of(run) == "atlas" for start in starts[name]}
    weeks = {
        (name, start.id): _weeks(run, start, compared_weeks(start, brains.values()) if start.id in predicted else ())
        for name, run in config.runs.items()
        for start in starts[name]
    }
    members = members_of(
        config.studies,
        config.runs,
        lambda name, week: all(week in weeks[name, start.id] for start in starts[name]),
    )
    settings = dict(config.runs)
    for name, study in config.studies.items():
        for member in members[name]:
            if member.run not in config.runs:
                settings[member.run], starts[member.run] = member.settings, starts[study.base]
                compared = {
                    config.studies[n].compare_week for n, of in members.items() if member.run in [m.run for m in of]
                }
                weeks |= {
                    (member.run, start.id): _weeks(member.settings, start, compared) for start in starts[member.run]
                }
    ends = [(run, start, settings[run].end_week) for run in settings for start in starts[run]]
    if (calibrate := config.calibrate) is not None:
        base = config.runs[calibrate.base].model_copy(update={"end_week": calibrate.compare_week})
        ends += [(calibrate.base, start, calibrate.compare_week) for start in starts[calibrate.base]]
        for run in calibrate.runs:
            settings[run], starts[run] = base, starts[calibrate.base]
            weeks |= {(run, start.id): [start.week, calibrate.compare_week] for start in starts[run]}
    return _Folded(settings, starts, weeks, members, ends)


def _starts(config: Config, run: Run, ids: list[str]) -> list[str]:
    start = config.start if run.start is None else run.start
    if start == FIRST:
        return ids[:1]
    named = ids if start == ALL else [start] if isinstance(start, str) else start or ()
    return [id for id in ids if id in named]


def _weeks(settings: Run, start: Brain, further: Iterable[float]) -> list[float]:
    weeks = output_weeks(start.week, settings.end_week, settings.output_every_gw)
    tags = {week_tag(week) for week in weeks}
    return sorted([*weeks, *(week for week in further if week < weeks[-1] and week_tag(week) not in tags)])


def comparable(start: Brain, brains: Iterable[Brain]) -> list[Brain]:
    """Return the brains that a start brain may be compared with: with the same hemispheres, and of its population
    where it has one."""
    own = start.given.population
    return [brain for brain in brains if own in (None, brain.given.population) and brain.sides == start.sides]


def compared_weeks(start: Brain, brains: Iterable[Brain]) -> list[float]:
    """Return the weeks after a start brain of the real brains that it may be compared with, one a file name."""
    later = [b.week for b in comparable(start, brains) if b.week > start.week and not b.given.synthetic]
    return list({week_tag(week): week for week in sorted(later)}.values())


# which brains stand behind a run's growth


def _chains(folded: _Folded, series: Series, brains: Iterable[Brain]) -> dict[tuple[str, Origin], Chain]:
    starts = {start.id: start for _, start, _ in folded.ends}
    chains: dict[tuple[str, Origin], Chain] = {}
    through: dict[Origin, Callable[[Brain, float, Series], list[Brain]]] = {"self": _own_chain, "atlas": _atlas_chain}
    for start in starts.values():
        end = folded.last_week(start)
        compared = compared_weeks(start, brains)
        for origin, chain in through.items():
            members = chain(start, end, series)
            tags = {week_tag(brain.week) for brain in members[1:]}
            further = [week for week in compared if origin == "atlas" and week <= end and week_tag(week) not in tags]
            chains[start.id, origin] = Chain(
                brains=tuple(members),
                correspondences=tuple(series.correspondence(*pair) for pair in pairwise(members)),
                posed=tuple(series.posed(*pair) for pair in pairwise(members)),
                further_weeks=tuple(further),
            )
    return chains


def _own_chain(start: Brain, end: float, series: Series) -> list[Brain]:
    """Return a start brain and the later ones of its growth series, up to the first past an end week, one a week.

    All have label volumes, or surfaces with the same vertices.
    """
    members = series.brains.get(series.with_brain(start), ())
    # the first brain past the end tells of growth up to it
    last = min((brain.week for brain in members if brain.week >= end), default=end)
    chosen = {week_tag(start.week): start}
    for brain in members:
        volumes = start.given.has_labels and brain.given.has_labels
        if start.week < brain.week <= last and (volumes or series.are_matched(start, brain)):
            chosen.setdefault(week_tag(brain.week), brain)
    return sorted(chosen.values(), key=lambda brain: brain.week)


def _atlas_chain(start: Brain, end: float, series: Series) -> list[Brain]:
    """Return a start brain and those of the one series of another population: from its last week that is not after the
    start, or else its first, to the first past an end week that leaves two, as far as there are brains."""
    names = series.of_others(start)
    members = series.brains[names[0]] if len(names) == 1 else ()
    known = sorted({week_tag(brain.week): brain for brain in members}.values(), key=lambda brain: brain.week)
    if not known:
        return [start]
    first = max((brain.week for brain in known if brain.week <= start.week), default=known[0].week)
    last = min((brain.week for brain in known if brain.week >= end and brain.week > first), default=end)
    return [start, *(brain for brain in known if first <= brain.week <= last)]


def _unreachable(folded: _Folded, series: Series, chains: Mapping[tuple[str, Origin], Chain]) -> dict[str, InputError]:
    """Return by start brain why no brains lead a run that grows towards shapes to its end."""
    errors: dict[str, InputError] = {}
    for run, start, end in folded.ends:
        if (origin := shapes_of(folded.settings[run])) is None:
            continue
        chain = chains[start.id, origin].later
        found = ", ".join(f"{brain.id} ({brain.week:g} GW)" for brain in (start, *chain))
        if origin == "self":
            reaches, names = bool(chain), [name for name in [series.with_brain(start)] if name]
            found += f"; {cause}" if (cause := series.unmatched.get(series.with_brain(start))) else ""
            expected = "the start's own growth series with label volumes or matched surfaces"
            remedy = "Add later brains to its series (growth.brains), or grow by sizes or rates."
        else:
            reaches, names = len(chain) > 1 and start.week >= chain[0].week - BEFORE_GW, series.of_others(start)
            expected = "one series of another population with the same hemispheres"
            remedy = "Add an atlas of these weeks, or name one of several series in growth.estimated_from."
        if reaches and chain[-1].week >= end:
            continue
        if not names:
            found = f"none; the growth series are {', '.join(series.brains)}"
        elif len(names) > 1:
            found = f"several series: {', '.join(names)}"
        error = InputError(
            f"run {run} from {start.id} is to grow towards brains that are not there",
            found=found,
            expected=f"brains of {expected}, from {start.week:g} to {end:g} GW",
            remedy=remedy,
        )
        errors.setdefault(start.id, error)
    return errors


# simulations, and what they are compared with


def _simulation(
    config: Config,
    folded: _Folded,
    run: str,
    start: Brain,
    series: Series,
    chains: Mapping[tuple[str, Origin], Chain],
    brains: Iterable[Brain],
) -> Simulation:
    settings, weeks = folded.settings[run], folded.weeks[run, start.id]
    shapes, sizes = shapes_of(settings), follows_measured_sizes(settings)
    calibrated = config.calibrate is not None and run in config.calibrate.runs
    measured_thickness = settings.growth.thickness_mm == "measured"
    curves: str | list[str] = CURVES["curves"] if (sizes and not shapes) or measured_thickness else []
    compared: dict[str, tuple[Brain, ...]] = {}
    ordered = sorted(comparable(start, brains), key=lambda other: other.subject != start.subject)
    for tag in map(week_tag, weeks[1:] if run in config.runs else ()):
        if of_week := tuple(brain for brain in ordered if week_tag(brain.week) == tag):
            compared[tag] = of_week
    real = {
        tag: next(brain for brain in of_week if not brain.given.synthetic)
        for tag, of_week in compared.items()
        if not start.given.synthetic and not all(brain.given.synthetic for brain in of_week)
    }
    others_only = shapes == "atlas" and _sees_no_later_brain(start, chains[start.id, "atlas"], brains)
    explained = not others_only and (shapes or sizes)
    return Simulation(
        run=run,
        start=start,
        settings=settings,
        weeks=tuple(weeks),
        shapes=shapes,
        curves=curves,
        series=series.for_sizes(start),
        base=config.calibrate.base if config.calibrate and calibrated else run,
        compared=compared,
        real=real,
        kind="explained" if explained else "predicted",
        from_others_only=others_only,
        has_regions=start.has_regions and run in config.runs,
    )


def _sees_no_later_brain(start: Brain, chain: Chain, brains: Iterable[Brain]) -> bool:
    """Return whether neither a later brain that a start may be compared with nor a later scan of its subject is in a
    chain."""
    brains = list(brains)
    own = [brain for brain in brains if start.given.subject is not None and brain.subject == start.subject]
    return not any(brain.week > start.week for brain in (*comparable(start, brains), *own) if brain in chain.later)


def _references(
    simulations: Iterable[Simulation], brains: Iterable[Brain]
) -> dict[tuple[str, str], tuple[Brain, Brain]]:
    """Return by start and week the real brain, and the latest real one before that the start may be compared with."""
    references = {}
    for simulation in simulations:
        real = [brain for brain in comparable(simulation.start, brains) if not brain.given.synthetic]
        for week, brain in simulation.real.items():
            before = [other for other in real if other.week < float(week)]
            references[simulation.start.id, week] = brain, max(before, key=lambda other: other.week)
    return references


def _compared_with(compared: Compared, start: Brain, brains: Iterable[Brain]) -> tuple[Brain, ...]:
    """Return the brains that the runs of a study or a calibration from a brain are compared with."""
    if compared.compare_with is not None:
        return tuple(brain for brain in brains if brain.id in compared.compare_with)
    of_week = [brain for brain in brains if brain.week == compared.compare_week]
    own = [brain for brain in of_week if brain.given.population == start.given.population]
    return tuple(own or of_week)


def _calibration(
    config: Config,
    folded: _Folded,
    simulations: Mapping[tuple[str, str], Simulation],
    brains: Iterable[Brain],
) -> Calibration | None:
    if (settings := config.calibrate) is None:
        return None
    base = tuple(simulations[settings.base, start.id] for start in folded.starts[settings.base])
    real = {one.start.id: _compared_with(settings, one.start, brains) for one in base}
    return Calibration(settings.compare_week, base, settings.runs, real)


def _norm_reference(config: Config, starts: Sequence[Brain], brains: Iterable[Brain]) -> list[str]:
    """Return the ids of the measured brains that others are compared with: the given ones, or else all real ones.

    They have the hemispheres of the first start brain: half a brain is no measure of whole ones. If none are given
    and the real ones are of several populations, those of the start's are used.
    """
    if not starts:
        return []
    start, given = starts[0], config.metrics.norm_reference
    alike = [brain for brain in brains if brain.sides == start.sides]
    if given is not None:
        return [brain.id for brain in alike if brain.id in given]
    real = [brain for brain in alike if not brain.given.synthetic]
    if len({brain.given.population for brain in real}) > 1:
        real = [brain for brain in real if brain.given.population == start.given.population]
    return [brain.id for brain in real]
