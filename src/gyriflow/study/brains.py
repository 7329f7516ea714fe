"""Plan the brains of a study: the files and properties that rules read, one row for
each brain."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from ..io.volumes import LabelSource
from ..io.yaml_files import SCHEMES
from ..settings.brains import BrainConfig
from ..settings.root import Config
from ..settings.schemes import FILLED, LabelScheme
from ..settings.terms import MAX_COLOURS, OBSERVED, SIDES
from . import paths
from .atlases import UsedAtlas, atlas_by_brain, known_checksums
from .records import Brain, measured_files

GIVEN = (
    "id",
    "week",
    "subject",
    "population",
    "source",
    "labels",
    "scheme",
    "affine_from",
    "image",
    "white_files",
    "coordinates",
    "shape",
    "covariates",
)
"""Columns of a brain that are as in the configuration."""


def plan_brains(
    config: Config,
    refused: Collection[str],
    atlases: Sequence[UsedAtlas],
) -> dict[str, Brain]:
    """Return the brains of a configuration that are not refused, by id."""
    checksums = known_checksums(atlases)
    atlas_of = atlas_by_brain(atlases)
    brains: dict[str, Brain] = {}
    for settings in config.brains:
        if settings.id not in refused:
            used = atlas_of.get(settings.id)
            atlas = used.atlas.name if used else None
            brains[settings.id] = _brain(config, settings, checksums, atlas)
    for name, group in _groups(brains.values()).items():
        brains[name] = replace(brains[name], group=group)
    _add_regions(config, brains)
    _add_thickness_sources(brains)
    return brains


def _brain(
    config: Config,
    settings: BrainConfig,
    checksums: Mapping[str, tuple[str, str]],
    atlas: str | None,
) -> Brain:
    names = {"brain": settings.id}
    has_cortex = False
    if settings.labels is not None:
        has_cortex = bool(label_scheme(config, settings.scheme).cortex)
    has_thickness = bool(settings.white_files) or has_cortex
    measures_all_white = config.metrics.white_surfaces == "all"
    white = []
    white_maps = []
    if settings.white_files or (has_cortex and measures_all_white):
        patterns = paths.white_of(*settings.sides)
        for side in settings.sides:
            white.append(patterns[f"{side}_surface"].format(**names))
            white_maps.append(patterns[f"{side}_maps"].format(**names))
    results: dict[str, Any] = measured_files(
        settings.sides,
        paths.SURFACE.format(**names),
        paths.METRICS_FOLDER.format(**names),
        None,
    )
    thickness = paths.THICKNESS["measured"].format(**names) if has_thickness else None
    known = {path: checksums[path] for path in settings.files if path in checksums}
    return Brain(
        **{name: getattr(settings, name) for name in GIVEN},
        **results,
        run=OBSERVED,
        files=tuple(settings.files),
        report=paths.PIAL["report"].format(**names),
        thickness=thickness,
        white=tuple(white),
        white_maps=tuple(white_maps),
        thickness_of=None,
        regions_of=None,
        group=None,
        atlas=atlas,
        checksums=known,
    )


def _groups(brains: Iterable[Brain]) -> dict[str, str]:
    """Return the group of each brain: its value of the covariate that colours show.

    That is the first covariate with 2 to `MAX_COLOURS` values and fewer values than
    subjects.
    """
    brains = list(brains)
    names: dict[str, None] = {}
    for brain in brains:
        names |= dict.fromkeys(brain.covariates)
    for name in names:
        with_value = [brain for brain in brains if name in brain.covariates]
        groups = {brain.id: f"{name}: {brain.covariates[name]}" for brain in with_value}
        n_groups = len(set(groups.values()))
        n_subjects = len({brain.subject_name for brain in with_value})
        if 1 < n_groups <= MAX_COLOURS and n_groups < n_subjects:
            return groups
    return {}


def _add_regions(config: Config, brains: dict[str, Brain]) -> None:
    """Add the regions of each whole brain: its own, or those of the brain closest in
    week that has some."""
    given = [brains[name] for name in brains if name in config.metrics.regions]
    for name, brain in brains.items():
        source = brain
        if brain not in given:
            if not given or brain.sides != SIDES or brain.shape is not None:
                continue
            source = closest(given, brain.week)
        regions = paths.region_files(brain.folder).values()
        brains[name] = replace(
            brain,
            regions_of=source.id,
            regions=tuple(regions),
        )


def _add_thickness_sources(brains: dict[str, Brain]) -> None:
    """Add, for each brain without labels, the brain whose measured thickness is taken
    for its own.

    It is the brain with labels, or else with white surfaces, that is closest in week.
    """
    measured = [brain for brain in brains.values() if brain.thickness is not None]
    labelled = [brain for brain in measured if brain.labels is not None]
    for name, brain in brains.items():
        if brain.labels is None:
            others = [other for other in labelled or measured if other.id != name]
            if others:
                source = closest(others, brain.week)
                brains[name] = replace(brain, thickness_of=source.id)


def closest(brains: Iterable[Brain], week: float) -> Brain:
    """Return the first of the brains that are closest to a week."""
    return min(
        brains,
        key=lambda brain: abs(brain.week - week),
    )


def comparable(brain: Brain, brains: Iterable[Brain]) -> list[Brain]:
    """Return the brains with the same hemispheres, population and subject.

    A brain without a population or subject, as of an atlas, may be compared with any.
    """
    found = []
    for other in brains:
        is_of_population = brain.population in (None, other.population)
        is_of_subject = brain.subject is None or other.subject in (None, brain.subject)
        if other.sides == brain.sides and is_of_population and is_of_subject:
            found.append(other)
    return found


# meaning of labels


def label_scheme(config: Config, name: str | None) -> LabelScheme:
    """Return a label scheme by name; KeyError if there is none."""
    key = str(name)
    if key not in config.schemes:
        return SCHEMES[key]
    settings = config.schemes[key].model_dump()
    return LabelScheme(name=key, **settings)


def label_source(config: Config, brain: Brain) -> LabelSource | None:
    """Return the label volume of a brain with its meaning; None if it has none."""
    if brain.labels is None:
        return None
    scheme = label_scheme(config, brain.scheme)
    return LabelSource(brain.labels, brain.affine_from, scheme)


def registered_source(config: Config, brain: Brain) -> LabelSource:
    """Return the volume for the registration of a brain: its labels, or those that its
    surfaces are filled with."""
    labels = label_source(config, brain)
    if labels is not None:
        return labels
    filled = paths.FILLED_LABELS.format(**brain.names)
    return LabelSource(filled, "auto", FILLED)
