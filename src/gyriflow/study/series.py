"""Growth series of a study, and the brains of them that growth for a start brain is
measured on."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path

from ..errors import InputError
from ..settings.brains import BrainConfig
from ..settings.ensemble import Variation
from ..settings.growth import BEFORE_GW, Origin
from ..settings.root import Config
from ..settings.runs import Run, growing_groups
from .atlases import UsedAtlas
from .brains import comparable
from .paths import MATCHED, REGISTERED, VARIED_REGISTRATION
from .records import Brain, Chain, Link

PATH = "path"
"""The name of the chain of all weeks of an atlas."""
UNVARIED = (1.0, 0)
"""Factor of the smoothing and seed of the perturbed labels of registrations, but for
those of ensembles."""


@dataclass(frozen=True)
class Series:
    """The brains of each growth series, by name in the order of the configuration.

    `preferred` is the series to choose if several are possible. `matched` has the ids
    of brains with vertex-matched surfaces, by series; `unmatched` has the reasons why
    other series of surfaces are not matched. `links` are the maps between two brains
    that chains have needed, by file, and `paths` those of atlases that chains lead
    along, by the first brain.
    """

    brains: Mapping[str, tuple[Brain, ...]]
    preferred: str | None
    matched: Mapping[str, frozenset[str]]
    unmatched: Mapping[str, str]
    links: dict[str, Link] = field(default_factory=dict)
    paths: dict[str, Chain] = field(default_factory=dict)

    def with_brain(self, brain: Brain) -> str:
        """Return the series that contains a brain (the preferred one of several), or
        ""."""
        names = [name for name, brains in self.brains.items() if brain in brains]
        if self.preferred in names:
            return self.preferred
        return next(iter(names), "")

    def for_sizes(self, brain: Brain) -> str | None:
        """Return the series whose curves a start brain follows: the preferred one, its
        own, or the only other one.

        A series of scans of another subject is used only if it is preferred.
        """
        if self.preferred is not None:
            return self.preferred if self.preferred in self.brains else None
        own = self.with_brain(brain)
        if own:
            return own
        others = [name for name in self.brains if not self._is_single_subject(name)]
        return others[0] if len(others) == 1 else None

    def from_other_populations(
        self, start: Brain, *, all_atlases: bool = False
    ) -> list[str]:
        """Return the series of other populations with a brain's hemispheres; only the
        preferred one, if among them.

        A series of scans of another subject is returned only if it is preferred. With
        `all_atlases`, all others are returned as well, the preferred one first.
        """
        names = []
        for name, brains in self.brains.items():
            if name != self.preferred and self._is_single_subject(name):
                continue
            populations = {brain.population for brain in brains} - {None}
            is_own = start in brains or start.population in populations
            if not is_own and all(brain.sides == start.sides for brain in brains):
                names.append(name)
        names.sort(key=lambda name: name != self.preferred)
        if self.preferred in names and not all_atlases:
            return names[:1]
        return names

    def _is_single_subject(self, name: str) -> bool:
        brains = self.brains[name]
        return brains[0].subject is not None and not several_subjects(brains)

    def _are_matched(self, *brains: Brain) -> bool:
        """Return whether brains have surfaces with the same vertices."""
        ids = {brain.id for brain in brains}
        return any(ids <= matched for matched in self.matched.values())

    def link(
        self,
        earlier: Brain,
        later: Brain,
        variation: tuple[float, int] = UNVARIED,
    ) -> str:
        """Return the file that maps two brains, by matched vertices or by registration,
        and add it to the links.

        `variation` is the factor of a registration's smoothing, and the seed of its
        perturbed labels.
        """
        is_matched = self._are_matched(earlier, later)
        pattern = VARIED_REGISTRATION
        if is_matched:
            pattern = MATCHED
        elif variation == UNVARIED:
            pattern = REGISTERED
        smoothing, seed = variation
        names = {"earlier": earlier.id, "later": later.id}
        file = pattern.format(**names, smoothing=smoothing, seed=seed)
        self.links[file] = Link(
            file=file,
            **names,
            is_matched=is_matched,
            smoothing=smoothing,
            seed=seed,
            posed=(
                earlier.labels is None and not is_matched,
                later.labels is None and not is_matched,
            ),
        )
        return file


def several_subjects(brains: Iterable[Brain]) -> bool:
    """Return whether brains have different subjects. Brains without a subject, as of an
    atlas, count as one."""
    return len({brain.subject for brain in brains}) > 1


def series_of(
    config: Config,
    brains: Mapping[str, Brain],
    atlases: Iterable[UsedAtlas],
) -> Series:
    """Return the growth series of a configuration, limited to the given brains.

    Surfaces are read to find out whether their vertices are matched. For atlas files
    that have yet to be downloaded, the description of the atlas decides.
    """
    assumed: set[str] = set()
    for used in atlases:
        for file in used.missing:
            if used.atlas.series[file.series].matched:
                assumed.add(str(file.path))
    series, matched, unmatched = {}, {}, {}
    configs = [brain for brain in config.brains if brain.id in brains]
    for name, members in growing_groups(configs, config.growth.brains):
        ids = [brain.id for brain in members]
        series[name] = tuple(brains[brain] for brain in ids)
        if any(brain.labels or brain.shape for brain in members):
            continue
        cause: str | None = "growth.matched_surfaces is false"
        if config.growth.matched_surfaces:
            by_week = sorted(members, key=lambda brain: brain.week)
            cause = unmatched_reason(by_week, assumed)
        if cause is None:
            matched[name] = frozenset(ids)
        else:
            unmatched[name] = cause
    return Series(series, config.growth.series, matched, unmatched)


def unmatched_reason(
    brains: Sequence[BrainConfig], assumed: Collection[str] = ()
) -> str | None:
    """Return why the surfaces of brains are not vertex-matched, or None if they are.

    They are matched if all brains have surface files of the same kind, with as many
    vertices and the same triangles for each hemisphere. Files in `assumed` count as
    matched and may not exist yet.
    """
    # imported here, since few configurations need it
    from ..io.surfaces import connectivity

    first = brains[0]
    for brain in brains:
        if brain.source != first.source:
            return (
                f"{brain.id} is given as {brain.source}, {first.id} as {first.source}"
            )
    read = [brain for brain in brains if not set(brain.files) <= set(assumed)]
    sides = {}
    try:
        for brain in read:
            sides[brain.id] = [connectivity(Path(path)) for path in brain.files]
    except InputError as error:
        return str(error)
    for brain in read:
        first = read[0]
        for expected, found in zip(
            sides[first.id],
            sides[brain.id],
            strict=True,
        ):
            if expected[:2] != found[:2]:
                text = f"{brain.id} has {found[0]} vertices and {found[1]} triangles"
                return f"{text}, but {first.id} has {expected[0]} and {expected[1]}"
            if expected != found:
                return f"{brain.id} has other triangles than {first.id}"
    return None


# brains of a start brain's growth


MAX_BEYOND_ATLAS_GW = 0.5
"""How far the growth of an atlas is extrapolated for members of an ensemble that are
older than stated."""


def later_observed_weeks(start: Brain, brains: Iterable[Brain]) -> list[float]:
    """Return the weeks of brains, not shapes, that simulations from a start brain are
    compared with."""
    weeks = set()
    for brain in comparable(start, brains):
        if brain.week > start.week and brain.shape is None:
            weeks.add(brain.week)
    return sorted(weeks)


def chains_of(
    start: Brain,
    end: float,
    series: Series,
    brains: Sequence[Brain],
) -> dict[tuple[str, str], Chain]:
    """Return the brains on which growth for a start brain is measured up to a week, by
    the id of the first and the name of the chain."""
    own = _chain("self", _own_chain(start, end, series), series)
    atlases = series.from_other_populations(start)
    if len(atlases) == 1:
        atlas = _along_path(
            start,
            start.week,
            end,
            atlases[0],
            series,
        )
    else:
        atlas = _chain("atlas", [start], series)
    further = []
    for week in later_observed_weeks(start, brains):
        if week <= end and week not in atlas.weeks[1:]:
            further.append(week)
    return {
        (start.id, "self"): own,
        (start.id, "atlas"): replace(atlas, further_weeks=tuple(further)),
    }


def member_chain(
    member: str,
    run: str,
    start: Brain,
    settings: Run,
    variation: Variation,
    series: Series,
    brains: Sequence[Brain],
) -> Chain:
    """Return the chain of a member of a run's ensemble. InputError if it would be that
    of the run."""
    end = settings.end_week
    varied = (variation.registration_smoothing, variation.seed)
    if settings.growth.shapes == "self":
        own = _own_chain(start, end, series)
        chain = _chain("self", own, series, varied)
        if chain.later and chain.links == _chain("self", own, series).links:
            raise InputError(
                f"the members of the ensemble of run {run} would be equal: the surfaces"
                f" of {start.id} and its later brains are matched by their vertices, so"
                " no registration can be varied",
                remedy="Remove ensemble, or set growth.matched_surfaces to false.",
            )
        # ages of one series have the same error
        return replace(
            chain,
            name=f"self.{member}",
            variation=replace(variation, age_shift_gw=0.0),
        )
    atlases = series.from_other_populations(start, all_atlases=True)
    names = []
    for name in atlases:
        weeks = [brain.week for brain in series.brains[name]]
        starts_before = min(weeks) <= start.week + BEFORE_GW
        if len(set(weeks)) > 1 and starts_before and max(weeks) >= end:
            names.append(name)
    name = names[variation.number % len(names)]
    atlas_weeks = [brain.week for brain in series.brains[name]]
    # the age of the whole run is shifted, as far as the atlas goes, or a little further
    low = min(atlas_weeks) - BEFORE_GW - start.week
    high = max(atlas_weeks) + MAX_BEYOND_ATLAS_GW - end
    shift = round(
        min(max(variation.age_shift_gw, low), high),
        2,
    )
    observed = later_observed_weeks(start, brains)
    further = {end, *(week for week in observed if week <= end)}
    return replace(
        _along_path(
            start,
            start.week + shift,
            end + shift,
            name,
            series,
            varied,
        ),
        name=f"atlas.{member}",
        further_weeks=tuple(sorted(further)),
        variation=replace(variation, age_shift_gw=shift),
    )


def _chain(
    origin: Origin,
    brains: Sequence[Brain],
    series: Series,
    variation: tuple[float, int] = UNVARIED,
) -> Chain:
    """Return a chain, with smoothing and seed of its registrations."""
    links = [series.link(*pair, variation) for pair in pairwise(brains)]
    return Chain(
        brain=brains[0].id,
        name=origin,
        origin=origin,
        brains=tuple(brain.id for brain in brains),
        weeks=tuple(brain.week for brain in brains),
        links=tuple(links),
    )


def _own_chain(
    start: Brain,
    end: float,
    series: Series,
) -> list[Brain]:
    """Return a start brain and later brains of its growth series, one a week, up to the
    first at or past an end week.

    All have label volumes, or surfaces with the same vertices.
    """
    # scans of the same subject come first in a population's series
    members = sorted(
        series.brains.get(series.with_brain(start), ()),
        key=lambda brain: brain.subject_name != start.subject_name,
    )
    # growth up to the end week needs the first brain at or past it
    last = min((brain.week for brain in members if brain.week >= end), default=end)
    by_week = {start.week: start}
    for brain in members:
        lack_labels = start.labels is None or brain.labels is None
        if lack_labels and not series._are_matched(start, brain):
            continue
        if start.week < brain.week <= last:
            by_week.setdefault(brain.week, brain)
    return [by_week[week] for week in sorted(by_week)]


def _along_path(
    start: Brain,
    week: float,
    end: float,
    name: str,
    series: Series,
    variation: tuple[float, int] = UNVARIED,
) -> Chain:
    """Return the chain of a start brain of a week by the growth of a series of another
    population.

    Its brains, one for each week, begin with the last week up to that of the start
    (else with the first week), and end with the first week at or past an end week.
    There are at least two weeks, if available.
    """
    by_week = {brain.week: brain for brain in series.brains[name]}
    weeks = sorted(by_week)
    first = max((known for known in weeks if known <= week), default=weeks[0])
    ends = [known for known in weeks if known >= end and known > first]
    last = min(ends, default=end)
    used = [by_week[known] for known in weeks if first <= known <= last]
    path = _chain(
        "self",
        [by_week[known] for known in weeks],
        series,
    )
    series.paths[path.brain] = replace(path, name=PATH)
    to_atlas = _chain(
        "atlas",
        [start, *used[:1]],
        series,
        variation,
    )
    return replace(
        to_atlas,
        brains=(start.id, *(brain.id for brain in used)),
        weeks=(start.week, *(brain.week for brain in used)),
        path=path.brain,
    )
