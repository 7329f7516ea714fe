"""A study as it was resolved from its configuration: its records, and what is joined from all of them."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

from ..errors import InputError
from ..io.exports import ExportedBrain, labels_of
from ..settings.atlas import Atlas
from ..settings.root import Config
from ..settings.terms import MEASURED, SIDES, Side
from . import paths
from .atlases import used_atlases
from .records import Brain, CalibrationRuns, Chain, Comparison, Measured, Origin, Simulation
from .series import Series, several_subjects


@dataclass(frozen=True)
class Study:
    """All that a configuration asks for, without the brains that were refused, which `config` still has.

    `simulations` are by run and start: of `runs`, of studies, and of the calibration. `chains` are the brains behind
    the growth of a start, by its id and whose growth it is. `comparisons` are what the configuration calls studies.
    `unreachable` says why starts are not folded.
    """

    config: Config
    brains: Mapping[str, Brain]
    series: Series
    simulations: Mapping[tuple[str, str], Simulation]
    chains: Mapping[tuple[str, Origin], Chain]
    comparisons: Mapping[str, Comparison]
    calibration: CalibrationRuns | None
    unreachable: Mapping[str, InputError]

    @cached_property
    def folded(self) -> list[Simulation]:
        """The simulations of `runs`."""
        return [one for one in self.simulations.values() if one.run in self.config.runs]

    @cached_property
    def may_diverge(self) -> list[str]:
        """The runs of studies and of the calibration."""
        return list(dict.fromkeys(run for run, _ in self.simulations if run not in self.config.runs))

    @property
    def pairs(self) -> list[tuple[str, str]]:
        return [(one.run, one.start.id) for one in self.folded]

    def files(self, *patterns: str) -> list[str]:
        """Return the files of patterns for each of `folded`."""
        return [one.file(pattern) for one in self.folded for pattern in patterns]

    @cached_property
    def starts(self) -> list[Brain]:
        """The brains that some of `runs` folds, in the order of `brains`."""
        starts = {one.start for one in self.folded}
        return [brain for brain in self.brains.values() if brain in starts]

    @cached_property
    def growing(self) -> list[tuple[str, Brain]]:
        """The series and brain of all that growth is measured on, the earliest of each series first."""
        series = self.series.brains
        return [(name, brain) for name in series for brain in sorted(series[name], key=lambda brain: brain.week)]

    @property
    def with_thickness_curve(self) -> list[str]:
        """The ids of the brains whose cortical thickness gives a curve, where some run follows it."""
        followed = any(run.growth.thickness_mm == "measured" for run in self.config.runs.values())
        return [brain.id for _, brain in self.growing if followed and brain.has_thickness]

    @property
    def unmatched_starts(self) -> dict[str, str]:
        """Why the surfaces of a growth series with a start brain are not matched, by the series' name."""
        starts = set(self.starts)
        return {name: why for name, why in self.series.unmatched.items() if starts & set(self.series.brains[name])}

    def growth_of(self, one: Simulation) -> str:
        """Return in words whose measured growth a simulation follows; "" where it follows none."""
        if one.shapes:
            brains, name = self.chains[one.start.id, one.shapes].brains, self.series.with_brain(one.start)
            if one.shapes == "atlas":
                brains, name = brains[1:], self.series.with_brain(brains[1])
        else:
            name = one.followed_series or ""
            brains = self.series.brains.get(name, ())
        if several_subjects(brains):
            return f"population {name}"
        return "own" if one.start in brains else f"series {name}" if brains else ""

    # what runs are worth

    @cached_property
    def validated(self) -> list[Simulation]:
        """The simulations that are compared with some real brain."""
        return [one for one in self.folded if one.real]

    @cached_property
    def references(self) -> dict[tuple[str, float], tuple[Brain, Brain]]:
        """By start and week the real brain that runs are compared with, and the latest comparable real one before."""
        references = {}
        for one in self.validated:
            alike = [brain for brain in one.start.comparable(self.brains.values()) if not brain.given.synthetic]
            for week, real in one.real.items():
                before = [brain for brain in alike if brain.week < week]
                references[one.start.id, week] = real, max(before, key=lambda brain: brain.week)
        return references

    @cached_property
    def expected(self) -> list[Simulation]:
        """Those of them that say what was to be expected of a real brain."""
        return [one for one in self.validated if one.from_others_only]

    @cached_property
    def prediction(self) -> Simulation | None:
        """The one simulation of a study that folds no other, where it is a prediction by the growth of an atlas."""
        return self.folded[0] if len(self.folded) == 1 and self.folded[0].from_others_only else None

    def atlas_brain(self, one: Simulation) -> Brain:
        """Return the brain, of those whose growth a prediction has, that is nearest in week to its end."""
        return min(self.chains[one.start.id, "atlas"].later, key=lambda brain: abs(brain.week - one.weeks[-1]))

    @cached_property
    def predictions(self) -> list[Simulation]:
        """Those that say it, and other predictions from the same starts beside them."""
        starts = {one.start for one in self.expected}
        return [one for one in self.validated if one.start in starts and one.kind == "predicted"]

    @cached_property
    def validated_carried(self) -> list[Simulation]:
        """Those of them whose start is registered with later brains of its series."""
        return [one for one in self.validated if self.chains[one.start.id, "self"].later]

    @property
    def carried(self) -> list[str]:
        """The ids of their start brains."""
        starts = {one.start for one in self.validated_carried}
        return [start.id for start in self.starts if start in starts]

    def ceiling_weeks(self, brain: str) -> list[float]:
        """Return the compared weeks that a start brain's mesh is carried to."""
        return [week for week in self.chains[brain, "self"].later_weeks if (brain, week) in self.references]

    # what is measured

    @cached_property
    def measured(self) -> dict[str, Measured]:
        """All that the tables of the study are of, real and simulated, by folder."""
        rows = [brain.measured for brain in self.brains.values()]
        return {row.where: row for row in (*rows, *(row for one in self.folded for row in one.measured))}

    @cached_property
    def places(self) -> dict[str, Measured]:
        """All that is measured by folder, the runs of studies at the weeks of comparison among it."""
        rows = [member.at(study.week) for study in self.comparisons.values() for member, _ in study.members]
        return {**{row.where: row for row in rows}, **self.measured}

    @property
    def surfaces(self) -> list[str]:
        return [
            file.format(brain=brain.id)
            for brain in self.brains.values()
            for file in (
                *paths.pial_of(*brain.sides).values(),
                *(paths.THICKNESS.values() if brain.has_thickness else ()),
            )
        ]

    @property
    def folded_surfaces(self) -> list[str]:
        return [
            one.file(file, week=week)
            for one in self.folded
            for file in paths.folded_of(*one.start.sides).values()
            for week in one.weeks
        ]

    @cached_property
    def atlases(self) -> dict[str, Atlas]:
        """The atlas of each brain that is of one, by id."""
        return {
            used.atlas.brain_id(file.series, file.week): used.atlas
            for used in used_atlases(self.config)
            for file in used.files
        }

    def individuals(self, brains: Iterable[str]) -> bool:
        """Return whether measured brains differ as individuals do: none is of an atlas, which has averages.

        Brains of no named subject that are half a week or more apart may be an atlas' as well.
        """
        given = [self.brains[brain].given for brain in brains]
        weeks = sorted(brain.week for brain in given)
        told = all(brain.subject for brain in given) or any(late - early < 0.5 for early, late in pairwise(weeks))
        return told and not any(brain.id in self.atlases for brain in given)

    @cached_property
    def norm_reference(self) -> list[str]:
        """The ids of the measured brains that others are compared with: the given ones, or else all real ones.

        They have the hemispheres of the first start brain: half a brain is no measure of whole ones. If none are given
        and the real ones are of several populations, those of the start's are used.
        """
        # where nothing is to be folded, the first brain stands for the start
        first = self.starts or ([] if self.config.runs else list(self.brains.values()))
        if not first:
            return []
        start, given = first[0], self.config.metrics.norm_reference
        alike = [brain for brain in self.brains.values() if brain.sides == start.sides]
        if given is not None:
            named = {brain: atlas.name for brain, atlas in self.atlases.items()}
            return [brain.id for brain in alike if {brain.id, named.get(brain.id)} & set(given)]
        real = [brain for brain in alike if not brain.given.synthetic]
        if len({brain.given.population for brain in real}) > 1:
            real = [brain for brain in real if brain.given.population == start.given.population]
        return [brain.id for brain in real]

    @property
    def scans(self) -> dict[str, list[str]]:
        """The ids of the brains of each subject that was scanned at several weeks, by week."""
        scans: dict[str, list[str]] = {}
        for brain in sorted(self.brains.values(), key=lambda brain: (brain.given.subject or "", brain.week)):
            if brain.given.subject is not None:
                scans.setdefault(brain.given.subject, []).append(brain.id)
        return {subject: ids for subject, ids in scans.items() if len(ids) > 1}

    # regions, and maps at the vertices of the template

    def giver_of_regions(self, brain: str) -> Brain:
        """Return the brain with given regions that is nearest in week."""
        week = self.brains[brain].week
        given = [one for one in self.brains.values() if one.regions_from == "given"]
        return min(given, key=lambda other: abs(other.week - week))

    def template_sides(self, row: Measured) -> list[Side]:
        """Return the hemispheres of a brain that have maps at the template's vertices."""
        # it may have been refused
        template = self.brains.get(self.config.metrics.template or "")
        return [side for side in row.sides if template is not None and side in template.sides]

    @property
    def exported(self) -> list[dict[str, Any]]:
        """What the export needs to know of each brain that is measured: names, and files by side."""
        return [self._exported(row, self.brains[row.subject]) for row in self.measured.values()]

    def _exported(self, row: Measured, brain: Brain) -> dict[str, Any]:
        real = row.run == MEASURED
        white = paths.white_of(*row.sides) if real and brain.has_white else {}
        whites = {name: file.format(brain=brain.id) for name, file in white.items()}
        sides = [side for side in row.sides if whites]
        template = {side: paths.TEMPLATE_MAPS.format(where=row.where, side=side) for side in self.template_sides(row)}
        volume = {"labels": brain.labels, "surface": row.parts["whole"], "thickness": row.thickness}
        return {
            "brain": row.subject,
            "run": row.run,
            "week": row.week,
            "subject": brain.subject,
            "surfaces": {side: row.parts[side] for side in row.sides},
            "maps": {side: f"{row.folder}/{side}.shape.gii" for side in row.sides},
            "regions": dict(zip(SIDES, row.regions.values(), strict=False)),
            "report": brain.report,
            "covariates": brain.given.covariates,
            "white": {side: whites[f"{side}_surface"] for side in sides},
            "white_maps": {side: whites[f"{side}_maps"] for side in sides},
            "template": self.config.metrics.template,
            "template_maps": template,
            "volume": volume if brain.labels and not real else {},
        }

    # what the report and the table of quality say beside figures

    @property
    def used_settings(self) -> dict[str, Any]:
        """The configuration; the brains of the atlas are among the brains by now."""
        return self.config.model_dump(mode="json", exclude_defaults=True, exclude={"atlas", "participants"})

    @property
    def described_brains(self) -> list[dict[str, Any]]:
        """What the configuration says of each brain, refused ones too, with its licence where it is of an atlas."""
        licences = {brain: atlas.licence.name for brain, atlas in self.atlases.items()}
        keys = ("id", "week", "population", "source", "synthetic", "covariates")
        return [
            {**{key: getattr(brain, key) for key in keys}, "licence": licences.get(brain.id)}
            for brain in self.config.brains
        ]

    @property
    def prediction_facts(self) -> dict[str, Any] | None:
        """The names, weeks, growth and files of the one prediction, for its report; None if there is none."""
        if (one := self.prediction) is None:
            return None
        at, beside = one.measured[-1], self.atlas_brain(one)
        exported = [ExportedBrain(**brain) for brain in self.exported]
        last = next(brain for brain in exported if (brain.run, brain.week) == (one.run, at.week))
        atlas = self.atlases.get(beside.id)
        return {
            **{**one.names, "start_week": one.start.week, "week": at.week},
            **{"beside": beside.id, "beside_week": beside.week},
            # those whose growth it has
            "population": beside.population,
            "atlas": atlas and atlas.model_dump(include={"name", "title", "licence", "reference"}),
            "surfaces": [*at.parts.values()],
            "labels": labels_of("results/export", last, exported) if last.volume else None,
        }
