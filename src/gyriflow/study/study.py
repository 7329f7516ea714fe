"""A study as it was resolved from its configuration: its records, and what is joined from all of them."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from ..config.root import Config
from ..errors import InputError
from ..parameters.terms import MEASURED, SIDES, Side
from ..units import week_tag
from .paths import (
    AGREEMENT,
    CEILING,
    DEVIATION,
    DISPLACEMENT,
    ONSET,
    PIAL,
    PREDICTION,
    READY,
    SIMILARITY,
    TEMPLATE_MAPS,
    THICKNESS,
    VALIDATION,
    VOLUMES,
    folded_of,
    pial_of,
)
from .records import Brain, Calibration, Chain, Comparison, Measured, Origin, Simulation
from .series import Series


@dataclass(frozen=True)
class Study:
    """All that a configuration asks for, without the brains that were refused.

    Attributes
    ----------
    config
        The configuration, with refused brains.
    brains
        By id, in the order of the configuration.
    simulations
        By run and start: of `runs`, of studies, and of the calibration.
    chains
        The brains behind the growth of a start, by its id and whose growth it is.
    comparisons
        What the configuration calls studies, by name.
    references
        By start and week the real brain that runs are compared with, and the latest real one before it.
    norm_reference
        The ids of the brains that others are compared with.
    unreachable
        Why start brains are not folded, by their ids.
    """

    config: Config
    brains: Mapping[str, Brain]
    series: Series
    simulations: Mapping[tuple[str, str], Simulation]
    chains: Mapping[tuple[str, Origin], Chain]
    comparisons: Mapping[str, Comparison]
    calibration: Calibration | None
    references: Mapping[tuple[str, str], tuple[Brain, Brain]]
    norm_reference: list[str]
    unreachable: Mapping[str, InputError]

    @cached_property
    def folded(self) -> list[Simulation]:
        """The simulations of `runs`."""
        return [one for one in self.simulations.values() if one.run in self.config.runs]

    @cached_property
    def may_diverge(self) -> list[str]:
        """The runs of studies and of the calibration."""
        return list(dict.fromkeys(run for run, _ in self.simulations if run not in self.config.runs))

    @cached_property
    def pairs(self) -> list[tuple[str, str]]:
        """The run and the start of each of `folded`."""
        return [(one.run, one.start.id) for one in self.folded]

    @cached_property
    def starts(self) -> list[Brain]:
        """The brains that some of `runs` folds, in the order of `brains`."""
        starts = {one.start.id for one in self.folded}
        return [brain for brain in self.brains.values() if brain.id in starts]

    @cached_property
    def growing(self) -> list[tuple[str, Brain]]:
        """The series and brain of all that growth is measured on, the earliest of each series first."""
        return [
            (name, brain)
            for name, brains in self.series.brains.items()
            for brain in sorted(brains, key=lambda brain: brain.week)
        ]

    @cached_property
    def validated(self) -> list[Simulation]:
        """The simulations that are compared with some real brain."""
        return [one for one in self.folded if one.real]

    @cached_property
    def expected(self) -> list[Simulation]:
        """Those of them that say what was to be expected of a real brain."""
        return [one for one in self.validated if one.from_others_only]

    @cached_property
    def predictions(self) -> list[Simulation]:
        """Those that say it, and other predictions from the same starts beside them."""
        starts = {one.start for one in self.expected}
        return [one for one in self.validated if one.start in starts and one.kind == "predicted"]

    @cached_property
    def carried(self) -> list[str]:
        """The ids of start brains that others of their series follow."""
        return [start.id for start in self.starts if self.chains[start.id, "self"].later]

    @cached_property
    def validated_carried(self) -> list[Simulation]:
        """The simulations that are compared, from such starts."""
        return [one for one in self.validated if one.start.id in self.carried]

    @cached_property
    def measured(self) -> dict[str, Measured]:
        """All that the tables of the study are of, real and simulated, by folder."""
        rows = [brain.measured for brain in self.brains.values()]
        rows += [row for one in self.folded for row in one.measured]
        return {row.where: row for row in rows}

    @cached_property
    def places(self) -> dict[str, Measured]:
        """All that is measured by folder, the runs of studies at the weeks of comparison among it."""
        rows = [member.at(study.week) for study in self.comparisons.values() for member, _ in study.members]
        return {**{row.where: row for row in rows}, **self.measured}

    @property
    def surfaces(self) -> list[str]:
        """The surfaces of all brains, and their thickness where it is measured."""
        return [
            file.format(brain=brain.id)
            for brain in self.brains.values()
            for file in (*pial_of(*brain.sides).values(), *(THICKNESS.values() if brain.thickness_from else ()))
        ]

    @property
    def folded_surfaces(self) -> list[str]:
        """The surfaces of all simulated brains, and their thickness."""
        return [
            one.file(pattern, week=week)
            for one in self.folded
            for pattern in folded_of(*one.start.sides).values()
            for week in one.week_tags
        ]

    @property
    def with_thickness_curve(self) -> list[str]:
        """The ids of the brains whose cortical thickness gives a curve, where some run follows it."""
        followed = any(run.growth.thickness_mm == "measured" for run in self.config.runs.values())
        return [brain.id for _, brain in self.growing if followed and brain.thickness_from]

    @property
    def unmatched_starts(self) -> dict[str, str]:
        """Why the surfaces of a growth series with a start brain are not matched, by the series' name."""
        starts = set(self.starts)
        return {name: why for name, why in self.series.unmatched.items() if starts & set(self.series.brains[name])}

    def files(self, *patterns: str) -> list[str]:
        """Return the files of patterns for every run and each brain that it folds."""
        return [one.file(pattern) for one in self.folded for pattern in patterns]

    @cached_property
    def tables(self) -> dict[str, list[str]]:
        """The tables of metrics by name, and the files that each is joined from."""
        rows = self.measured.values()
        with_volumes = [brain for brain in self.brains.values() if brain.given.has_labels]
        return {
            "metrics": [
                *(f"{row.folder}/metrics.csv" for row in rows),
                *(brain.white["metrics"] for brain in self.brains.values() if brain.white_from),
            ],
            "spectra": [f"{row.folder}/spectra.csv" for row in rows],
            "regions": [f"{row.folder}/regions.csv" for row in rows if row.regions],
            "volumes": [VOLUMES["volumes"].format(brain=brain.id) for brain in with_volumes],
            "published_centiles": [VOLUMES["scores"].format(brain=brain.id) for brain in with_volumes],
            "displacement": self.files(DISPLACEMENT),
            "similarity": [
                one.file(SIMILARITY, week=week, measured=brain.id)
                for one in self.folded
                for week, brains in one.compared.items()
                for brain in brains
            ],
        }

    @cached_property
    def validation_tables(self) -> dict[str, list[str]]:
        """The tables of validation by name, and the files that each is joined from."""
        return {
            "prediction": [one.file(PREDICTION) for one in self.predictions],
            "deviation": [one.file(DEVIATION["table"], week=week) for one in self.expected for week in one.real],
            "validation": [one.file(VALIDATION) for one in self.validated],
            "displacement_agreement": [one.file(AGREEMENT) for one in self.validated_carried],
            "registration_ceiling": [
                CEILING.format(brain=start)
                for start in self.carried
                if start in [one.start.id for one in self.validated]
            ],
            "onset": [one.file(ONSET) for one in self.validated_carried],
        }

    def template_sides(self, measured: Measured) -> list[Side]:
        """Return the hemispheres of a brain that have maps at the template's vertices."""
        # it may have been refused
        template = self.brains.get(self.config.metrics.template or "")
        return [side for side in measured.sides if template is not None and side in template.sides]

    def template_inputs(self, where: str, side: Side) -> dict[str, Any]:
        """Return the surfaces of the template's hemisphere and of one that has maps, and how their brains correspond.

        A simulated brain's surface is that of its start, whose vertices it keeps.
        """
        row, template = self.places[where], self.brains[self.config.metrics.template or ""]
        brain = self.brains[row.subject]
        if row.run != MEASURED:
            row = self.simulations[row.run, row.subject].at(brain.week)
        return {
            "template": template.measured.parts[side],
            "template_report": template.report,
            "surface": row.parts[side],
            "report": brain.report,
            "correspondence": [] if brain is template else [self.series.correspondence(template, brain)],
        }

    def ceiling_weeks(self, brain: str) -> list[float]:
        """Return the compared weeks that a start brain's mesh is carried to."""
        weeks = [week_tag(other.week) for other in self.chains[brain, "self"].later]
        return [float(week) for week in weeks if (brain, week) in self.references]

    def ceiling_files(self, brain: str) -> dict[str, list[str]]:
        """Return the surfaces that tell what registration alone is worth, week by week."""
        weeks = [week_tag(week) for week in self.ceiling_weeks(brain)]
        ready = {name: [pattern.format(brain=brain, week=week) for week in weeks] for name, pattern in READY.items()}
        return ready | {"whole": [self.references[brain, week][0].pial for week in weeks]}

    def onset_files(self, run: str, brain: str) -> dict[str, str | list[str]]:
        """Return the surfaces in which the beginning of sulci is looked for, and how they correspond."""
        one, chain = self.simulations[run, brain], self.chains[brain, "self"]
        return {
            **{f"run_{side}": [row.parts[side] for row in one.measured] for side in one.start.sides},
            **{f"real_{side}": [real.measured.parts[side] for real in chain.brains] for side in one.start.sides},
            **chain.brains[-1].regions,
            "reports": [real.report for real in chain.brains],
            "correspondences": list(chain.correspondences),
        }

    def region_inputs(self, brain: str) -> dict[str, str]:
        """Return the regions that a brain gets, the surfaces that they are given on, and what carries them."""
        given = self.regions_of(self.brains[brain])
        surfaces = {f"given_{name}": PIAL[name].format(brain=given.id) for name in ("left", "right", "report")}
        return {
            **given.regions,
            **surfaces,
            "correspondence": self.series.correspondence(given, self.brains[brain]),
        }

    def posed_regions(self, brain: str) -> list[bool]:
        """Return for the brain of the regions and the one that gets them whether they correspond in their poses."""
        return self.series.posed(self.regions_of(self.brains[brain]), self.brains[brain])

    def regions_of(self, brain: Brain) -> Brain:
        """Return the brain with given regions that is nearest in week."""
        given = [self.brains[name] for name in self.config.metrics.regions if name in self.brains]
        return min(given, key=lambda other: abs(other.week - brain.week))

    @property
    def exported(self) -> list[dict[str, Any]]:
        """What the export needs to know of each brain that is measured: names, and files by side."""
        return [self._exported(row) for row in self.measured.values()]

    def _exported(self, row: Measured) -> dict[str, Any]:
        brain, real = self.brains[row.subject], row.run == MEASURED
        white = brain.white if real else {}
        volume = (
            {}
            if real or not brain.given.has_labels
            else {
                "labels": brain.label_volume,
                "surface": row.parts["whole"],
                "thickness": row.thickness,
                "affine_from": brain.given.affine_from,
            }
        )
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
            "white": {side: white[f"{side}_surface"] for side in row.sides if white},
            "white_maps": {side: white[f"{side}_maps"] for side in row.sides if white},
            "template": self.config.metrics.template,
            "template_maps": {
                side: TEMPLATE_MAPS.format(where=row.where, side=side) for side in self.template_sides(row)
            },
            "volume": volume,
        }

    @property
    def scans(self) -> dict[str, list[str]]:
        """The ids of the brains of each subject that was scanned at several weeks, by week."""
        subjects = sorted({brain.given.subject for brain in self.brains.values() if brain.given.subject is not None})
        by_week = sorted(self.brains.values(), key=lambda brain: brain.week)
        scans = {name: [brain.id for brain in by_week if brain.given.subject == name] for name in subjects}
        return {name: ids for name, ids in scans.items() if len(ids) > 1}
