"""The growth series of a study: the brains that growth is taken from, and how they correspond."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from ..errors import InputError
from ..settings.brains import Brain as GivenBrain
from ..settings.root import Config
from ..settings.runs import growth_series
from .atlases import used_atlases
from .paths import MATCHED, REGISTERED
from .records import Brain


@dataclass(frozen=True)
class Series:
    """The brains of each growth series by its name, in the order of the configuration, and how they correspond.

    Of several series that a brain may have, one is `preferred`. `matched` are the ids of brains whose surfaces have the
    same vertices, by series; `unmatched` says why the vertices of other series of surfaces are not.
    """

    brains: Mapping[str, tuple[Brain, ...]]
    preferred: str | None
    matched: Mapping[str, frozenset[str]]
    unmatched: Mapping[str, str]

    def with_brain(self, brain: Brain) -> str:
        """Return the series that a brain is in, of several the preferred one; "" for none."""
        names = [name for name, brains in self.brains.items() if brain in brains]
        return min(names, key=lambda name: name != self.preferred, default="")

    def for_sizes(self, brain: Brain) -> str | None:
        """Return the series whose curves a start brain follows: the preferred one, that with it, or the only one.

        The scans of another subject are none of these but where they are preferred.
        """
        if self.preferred is not None:
            return self.preferred if self.preferred in self.brains else None
        own = [name for name, brains in self.brains.items() if brain in brains]
        others = [name for name in self.brains if not self._of_one_subject(name)]
        return next(iter(own or (others if len(others) == 1 else [])), None)

    def of_others(self, start: Brain) -> list[str]:
        """Return the series of other populations with a brain's hemispheres; of several, the preferred one alone.

        The scans of one other subject are a series only where they are preferred.
        """
        population = start.given.population
        names = [
            name
            for name, brains in self.brains.items()
            if start not in brains
            and (name == self.preferred or not self._of_one_subject(name))
            and all(brain.sides == start.sides for brain in brains)
            and all(population is None or brain.given.population != population for brain in brains)
        ]
        return [self.preferred] if self.preferred in names else names

    def _of_one_subject(self, name: str) -> bool:
        brains = self.brains[name]
        return brains[0].given.subject is not None and not several_subjects(brains)

    def are_matched(self, *brains: Brain) -> bool:
        """Return whether brains have surfaces with the same vertices."""
        return any({brain.id for brain in brains} <= ids for ids in self.matched.values())

    def correspondence(self, earlier: Brain, later: Brain) -> str:
        """Return the file that says where one brain's points are in another: by matched vertices, or registration."""
        file = MATCHED if self.are_matched(earlier, later) else REGISTERED
        return file.format(earlier=earlier.id, later=later.id)

    def posed(self, *pair: Brain) -> list[bool]:
        """Return for two brains whether they correspond in the pose of their surfaces, as masks of surfaces do.

        Others correspond in the world of their files.
        """
        return [not brain.given.has_labels and not self.are_matched(*pair) for brain in pair]


def several_subjects(brains: Iterable[Brain]) -> bool:
    """Return whether brains are not of one subject, or an atlas', which names none."""
    return len({brain.given.subject for brain in brains}) > 1


def series_of(config: Config, brains: Mapping[str, Brain]) -> Series:
    """Return the growth series of a configuration among some of its brains.

    Surfaces are read to tell whether their vertices are matched, but for files of an atlas that are missing still: its
    description is believed.
    """
    names = growth_series([brain.given for brain in brains.values()], config.growth.brains)
    believed = {
        str(f.path) for used in used_atlases(config) for f in used.missing if used.atlas.series[f.series].matched
    }
    matched, unmatched = {}, {}
    for name, ids in names.items():
        given = sorted((brains[brain].given for brain in ids), key=lambda brain: brain.week)
        if all(brain.has_vertices for brain in given):
            cause: str | None = "growth.matched_surfaces is false"
            if config.growth.matched_surfaces:
                cause = why_unmatched(given, believed)
            if cause is None:
                matched[name] = frozenset(ids)
            else:
                unmatched[name] = cause
    series = {name: tuple(brains[brain] for brain in ids) for name, ids in names.items()}
    return Series(series, config.growth.series, matched, unmatched)


def why_unmatched(brains: Sequence[GivenBrain], believed: Collection[str] = ()) -> str | None:
    """Return why the surfaces of brains are not matched by their vertices; None where they are.

    They are where all brains are given by surface files of one kind, with as many vertices and the same triangles for
    each hemisphere. Files that are `believed` to be so need not be there.
    """
    # files are looked at where growth by vertices is planned, which few configurations ask for
    from ..io.surfaces import connectivity

    first = brains[0]
    for brain in brains:
        if brain.source != first.source:
            return f"{brain.id} is given as {brain.source}, {first.id} as {first.source}"
    read = [brain for brain in brains if not believed or not all(path in believed for path in brain.files)]
    try:
        sides = [[connectivity(Path(path)) for path in brain.files] for brain in read]
    except InputError as error:
        return str(error)
    for brain, others in zip(read, sides, strict=True):
        for one, two in zip(sides[0], others, strict=True):
            if one[:2] != two[:2]:
                has = f"{brain.id} has {two[0]} vertices and {two[1]} triangles"
                return f"{has} where {read[0].id} has {one[0]} and {one[1]}"
            if one != two:
                return f"{brain.id} has other triangles than {read[0].id}"
    return None
