"""Growth series of a study: the brains that growth is measured on, and their correspondences."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from ..errors import InputError
from ..settings.brains import BrainConfig
from ..settings.root import Config
from ..settings.runs import growth_series
from .atlases import UsedAtlas
from .paths import MATCHED, REGISTERED, VARIED_REGISTRATION
from .records import Brain

UNVARIED = (1.0, 0)
"""Factor of the smoothing and seed of the perturbed labels of registrations, but for those of ensembles."""


@dataclass(frozen=True)
class Series:
    """The brains of each growth series, by name in the order of the configuration.

    `preferred` is the series to choose if several are possible. `matched` has the ids of brains with vertex-matched
    surfaces, by series; `unmatched` has the reasons why other series of surfaces are not matched.
    """

    brains: Mapping[str, tuple[Brain, ...]]
    preferred: str | None
    matched: Mapping[str, frozenset[str]]
    unmatched: Mapping[str, str]

    def with_brain(self, brain: Brain) -> str:
        """Return the series that contains a brain (the preferred one of several), or ""."""
        names = [name for name, brains in self.brains.items() if brain in brains]
        return min(names, key=lambda name: name != self.preferred, default="")

    def for_sizes(self, brain: Brain) -> str | None:
        """Return the series whose curves a start brain follows: the preferred one, its own, or the only other one.

        A series of scans of another subject is used only if it is preferred.
        """
        if self.preferred is not None:
            return self.preferred if self.preferred in self.brains else None
        own = [name for name, brains in self.brains.items() if brain in brains]
        populations = [name for name in self.brains if not self._is_single_subject(name)]
        return next(iter(own or (populations if len(populations) == 1 else [])), None)

    def from_other_populations(self, start: Brain, *, all_atlases: bool = False) -> list[str]:
        """Return the series of other populations with a brain's hemispheres; only the preferred one, if among them.

        A series of scans of another subject is returned only if it is preferred. With `all_atlases`, all others are
        returned as well, the preferred one first.
        """
        population = start.config.population
        names = [
            name
            for name, brains in self.brains.items()
            if start not in brains
            and (name == self.preferred or not self._is_single_subject(name))
            and all(brain.sides == start.sides for brain in brains)
            and all(population is None or brain.config.population != population for brain in brains)
        ]
        names.sort(key=lambda name: name != self.preferred)
        return names[:1] if self.preferred in names and not all_atlases else names

    def _is_single_subject(self, name: str) -> bool:
        brains = self.brains[name]
        return brains[0].config.subject is not None and not several_subjects(brains)

    def are_matched(self, *brains: Brain) -> bool:
        """Return whether brains have surfaces with the same vertices."""
        return any({brain.id for brain in brains} <= ids for ids in self.matched.values())

    def correspondence(self, earlier: Brain, later: Brain, variation: tuple[float, int] = UNVARIED) -> str:
        """Return the file with the correspondence of two brains, by matched vertices or by registration.

        `variation` is the factor of a registration's smoothing, and the seed of its perturbed labels.
        """
        if self.are_matched(earlier, later):
            file = MATCHED
        else:
            file = REGISTERED if variation == UNVARIED else VARIED_REGISTRATION
        smoothing, seed = variation
        return file.format(earlier=earlier.id, later=later.id, smoothing=smoothing, seed=seed)

    def posed(self, *pair: Brain) -> list[bool]:
        """Return for each of two brains whether their correspondence refers to the pose of its surface.

        This is the case for masks made from surfaces. Otherwise it refers to the world coordinates of its files.
        """
        return [not brain.config.has_labels and not self.are_matched(*pair) for brain in pair]


def several_subjects(brains: Iterable[Brain]) -> bool:
    """Return whether brains have different subjects. Brains without a subject, as of an atlas, count as one."""
    return len({brain.config.subject for brain in brains}) > 1


def series_of(config: Config, brains: Mapping[str, Brain], atlases: Iterable[UsedAtlas]) -> Series:
    """Return the growth series of a configuration, limited to the given brains.

    Surfaces are read to find out whether their vertices are matched. For atlas files that have yet to be downloaded,
    the description of the atlas decides.
    """
    names = growth_series([brain.config for brain in brains.values()], config.growth.brains)
    assumed = {str(file.path) for used in atlases for file in used.missing if used.atlas.series[file.series].matched}
    matched, unmatched = {}, {}
    for name, ids in names.items():
        members = sorted((brains[brain].config for brain in ids), key=lambda brain: brain.week)
        if all(brain.has_vertices for brain in members):
            cause: str | None = "growth.matched_surfaces is false"
            if config.growth.matched_surfaces:
                cause = unmatched_reason(members, assumed)
            if cause is None:
                matched[name] = frozenset(ids)
            else:
                unmatched[name] = cause
    series = {name: tuple(brains[brain] for brain in ids) for name, ids in names.items()}
    return Series(series, config.growth.series, matched, unmatched)


def unmatched_reason(brains: Sequence[BrainConfig], assumed: Collection[str] = ()) -> str | None:
    """Return why the surfaces of brains are not vertex-matched, or None if they are.

    They are matched if all brains have surface files of the same kind, with as many vertices and the same triangles for
    each hemisphere. Files in `assumed` count as matched and may not exist yet.
    """
    # imported here, since few configurations need it
    from ..io.surfaces import connectivity

    first = brains[0]
    for brain in brains:
        if brain.source != first.source:
            return f"{brain.id} is given as {brain.source}, {first.id} as {first.source}"
    read = [brain for brain in brains if not assumed or not all(path in assumed for path in brain.files)]
    try:
        sides = [[connectivity(Path(path)) for path in brain.files] for brain in read]
    except InputError as error:
        return str(error)
    for brain, brain_sides in zip(read, sides, strict=True):
        for expected, found in zip(sides[0], brain_sides, strict=True):
            if expected[:2] != found[:2]:
                text = f"{brain.id} has {found[0]} vertices and {found[1]} triangles"
                return f"{text}, but {read[0].id} has {expected[0]} and {expected[1]}"
            if expected != found:
                return f"{brain.id} has other triangles than {read[0].id}"
    return None
