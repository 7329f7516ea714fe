"""What is measured: real brains, and simulated ones at their output weeks, with their places under `results`."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

from ..config.root import Config
from ..parameters.terms import MEASURED, SIDES, Side
from ..units import week_tag
from .brains import Brains
from .paths import (
    DISPLACEMENT,
    PIAL,
    SIMILARITY,
    TEMPLATE_MAPS,
    THICKNESS,
    VOLUMES,
    folded_of,
    region_files,
    surfaces_in,
    white_of,
)
from .runs import Runs


@dataclass(frozen=True)
class Measured:
    """A brain that is measured.

    `where` is the folder of its metrics under `results`. `subject` is its id, of a simulated brain that of the start,
    `run` is "real" for measured brains. `surfaces` is the folder of its surfaces. Of what is not known there are no
    files: the thickness of its cortex, the report with the volumes of its tissues, its regions by side.
    """

    where: str
    subject: str
    run: str
    week: float
    sides: tuple[Side, ...]
    surfaces: str
    thickness: str | list[str]
    report: str | list[str]
    regions: dict[str, str]

    @property
    def folder(self) -> str:
        """The folder of its metrics."""
        return f"results/{self.where}"

    @property
    def labels(self) -> dict[str, Any]:
        """The first columns of its tables."""
        return {"subject": self.subject, "run": self.run, "week": self.week}

    @property
    def parts(self) -> dict[str, str]:
        """The files of its surfaces: of the whole, and of its hemispheres."""
        return surfaces_in(self.surfaces, self.sides)

    @property
    def hemispheres(self) -> list[str]:
        """The files of its hemispheres."""
        return [self.parts[side] for side in self.sides]


@dataclass(frozen=True)
class Measuring:
    """All that is measured in a study, and the tables that are joined from it."""

    config: Config
    brains: Brains
    runs: Runs

    @cached_property
    def named(self) -> list[str]:
        """The brains whose sulci can be named: real ones of both sides, where no regions are given."""
        found = [brain.id for brain in self.config.brains if not brain.synthetic and len(brain.sides) == len(SIDES)]
        return [] if self.config.metrics.regions else found

    @cached_property
    def regioned(self) -> list[str]:
        """The brains that have regions: named sulci, or given, or carried from the brain of the nearest week."""
        if self.config.metrics.named_sulci:
            return self.named
        return [
            brain.id
            for brain in self.config.brains
            if self.config.regions_from(brain.id) == brain.id
            or (self.config.regions_from(brain.id) and brain.source != "shape")
        ]

    @property
    def given(self) -> list[str]:
        """The brains whose regions are given."""
        return [brain for brain in self.regioned if self.config.regions_from(brain) == brain]

    @property
    def regioned_runs(self) -> list[tuple[str, str]]:
        """The runs from brains that have regions."""
        return [(run, brain) for run, brain in self.runs.folded if brain in self.regioned]

    @cached_property
    def real(self) -> list[Measured]:
        """The measured brains."""
        return [self.of_brain(brain) for brain in self.brains.ids]

    @cached_property
    def simulated(self) -> list[Measured]:
        """The simulated brains of all runs at all output weeks."""
        return [
            self.simulated_at(run, brain, week)
            for run, brain in self.runs.folded
            for week in self.config.weeks(run, brain)
        ]

    @property
    def every(self) -> list[Measured]:
        """The measured and the simulated brains that the tables of the study are of."""
        return self.real + self.simulated

    @property
    def with_regions(self) -> list[Measured]:
        """Those with regions."""
        return [measured for measured in self.every if measured.regions]

    @cached_property
    def places(self) -> dict[str, Measured]:
        """All that is measured by its folder, the runs of studies at the weeks of comparison among it."""
        of_studies = {
            (member.run, brain, study.compare_week)
            for name, study in self.config.studies.items()
            for member in self.config.members[name]
            for brain in self.config.starts(member.run)
        }
        compared = [self.simulated_at(*member) for member in sorted(of_studies)]
        return {measured.where: measured for measured in [*compared, *self.every]}

    def at(self, where: str) -> Measured:
        """Returns what is measured in a folder."""
        return self.places[where]

    def of_sides(self, *sides: Side) -> list[str]:
        """Returns the folders with metrics of brains that have these hemispheres."""
        return [where for where, measured in self.places.items() if measured.sides == sides]

    @cached_property
    def comparisons(self) -> list[tuple[str, str, str, str]]:
        """Run, brain, week and measured brain for every output week after the start with measured brains."""
        return [
            (run, brain, week, measured)
            for run, brain in self.runs.folded
            for week, brains in self.after_start(run, brain).items()
            for measured in brains
        ]

    def after_start(self, run: str, brain: str) -> dict[str, list[str]]:
        """Returns, by output week after the start, the ids of the measured brains that a run is compared with.

        Later scans of the start's own subject come first.
        """
        subject = self.config.brain(brain).subject
        ordered = sorted(self.config.comparable(brain), key=lambda other: subject is None or other.subject != subject)
        found = {
            week: [other.id for other in ordered if week_tag(other.week) == week]
            for week in self.runs.week_tags(run, brain)[1:]
        }
        return {week: brains for week, brains in found.items() if brains}

    def beside(self, run: str, brain: str) -> dict[str, str]:
        """Returns, by week, the measured brain that a run's surface is shown beside, the start at its own week."""
        later = {week: brains[0] for week, brains in self.after_start(run, brain).items()}
        return {self.runs.week_tags(run, brain)[0]: brain, **later}

    @cached_property
    def tables(self) -> dict[str, list[str]]:
        """The tables of a study by name, and the files that each is joined from."""
        return {
            "metrics": [
                *(f"{measured.folder}/metrics.csv" for measured in self.every),
                *(white_of()["metrics"].format(brain=brain) for brain in self.brains.with_white_measured),
            ],
            "spectra": [f"{measured.folder}/spectra.csv" for measured in self.every],
            "regions": [f"{measured.folder}/regions.csv" for measured in self.with_regions],
            "volumes": [VOLUMES["volumes"].format(brain=brain) for brain in self.brains.with_volumes],
            "published_centiles": [VOLUMES["scores"].format(brain=brain) for brain in self.brains.with_volumes],
            "displacement": self.runs.of(DISPLACEMENT),
            "similarity": [
                SIMILARITY.format(run=run, brain=brain, week=week, measured=measured)
                for run, brain, week, measured in self.comparisons
            ],
        }

    @property
    def exported(self) -> list[dict[str, Any]]:
        """What the export needs to know of each brain that is measured: names, and files by side."""
        return [
            {
                "brain": measured.subject,
                "run": measured.run,
                "week": measured.week,
                "subject": self.config.brain(measured.subject).subject or measured.subject,
                "surfaces": {side: measured.parts[side] for side in measured.sides},
                "maps": {side: f"{measured.folder}/{side}.shape.gii" for side in measured.sides},
                "regions": dict(zip(SIDES, measured.regions.values(), strict=False)),
                "report": PIAL["report"].format(brain=measured.subject),
                "covariates": self.config.brain(measured.subject).covariates,
                "white": self._white(measured, "surface"),
                "white_maps": self._white(measured, "maps"),
                "template": self.config.metrics.template,
                "template_maps": {
                    side: TEMPLATE_MAPS.format(where=measured.where, side=side)
                    for side in self.template_sides(measured)
                },
                "volume": self._volume(measured),
            }
            for measured in self.every
        ]

    def _white(self, measured: Measured, kind: str) -> dict[Side, str]:
        """Returns the white surfaces of a measured brain or the maps on them, by side."""
        if measured.run != MEASURED or measured.subject not in self.brains.with_white_measured:
            return {}
        files = white_of(*measured.sides)
        return {side: files[f"{side}_{kind}"].format(brain=measured.subject) for side in measured.sides}

    def with_white(self, *sides: Side) -> list[str]:
        """Returns the brains with these hemispheres whose white surfaces are measured."""
        return [brain for brain in self.brains.with_sides(*sides) if brain in self.brains.with_white_measured]

    def white_source(self, brain: str) -> dict[str, str]:
        """Returns by what they are of the files that a brain's white surfaces are made from: `labels`, or surfaces."""
        return self.config.brain(brain).white_files or {"labels": self.brains.label_volume(brain)}

    def _volume(self, measured: Measured) -> dict[str, Any]:
        """Returns what the labels of a simulated brain are made of; nothing where its start has none."""
        start = self.config.brain(measured.subject)
        if measured.run == MEASURED or not start.has_labels:
            return {}
        files = {"labels": self.brains.label_volume(start.id), "surface": measured.parts["whole"]}
        return files | {"thickness": measured.thickness, "affine_from": start.affine_from}

    def template_sides(self, measured: Measured) -> list[Side]:
        """Returns the hemispheres of a brain that have maps at the template's vertices."""
        template = self.config.metrics.template
        # it may have been refused
        return [side for side in measured.sides if template in self.brains.ids and side in self.brains.sides(template)]

    def template_files(self, where: str, side: Side) -> dict[str, str]:
        """Returns the surfaces of the template's hemisphere and of one that has maps, with the reports of their poses.

        A simulated brain's surface is that of its start, whose vertices it keeps.
        """
        measured, template = self.at(where), self.of_brain(self.config.metrics.template or "")
        first = self.config.weeks(measured.run, measured.subject)[0] if measured.run != MEASURED else 0.0
        at_start = measured if measured.run == MEASURED else self.simulated_at(measured.run, measured.subject, first)
        return {
            "template": template.parts[side],
            "template_report": PIAL["report"].format(brain=template.subject),
            "surface": at_start.parts[side],
            "report": PIAL["report"].format(brain=measured.subject),
        }

    def similarity(self, run: str, brain: str, week: str, measured: str) -> dict[str, list[str]]:
        """Returns the surfaces of a simulated brain and of a measured one, part by part."""
        real = f"results/brains/{measured}/surface"
        pair = {"simulated": f"results/runs/{run}/{brain}/surfaces/week-{week}", "real": real}
        return {name: list(surfaces_in(folder, self.brains.sides(brain)).values()) for name, folder in pair.items()}

    @property
    def folded_surfaces(self) -> list[str]:
        """The surfaces of all simulated brains, and their thickness."""
        return [
            path.format(run=run, brain=brain, week=week)
            for run, brain in self.runs.folded
            for path in folded_of(*self.brains.sides(brain)).values()
            for week in self.runs.week_tags(run, brain)
        ]

    def of_brain(self, brain: str) -> Measured:
        """Returns a measured brain."""
        where = f"brains/{brain}/metrics"
        thickness = THICKNESS["measured"].format(brain=brain)
        return Measured(
            where, brain, MEASURED, self.brains.week(brain), self.brains.sides(brain),
            f"results/brains/{brain}/surface",
            thickness=thickness if brain in self.brains.with_thickness else [],
            report=PIAL["report"].format(brain=brain),
            regions=region_files(f"results/{where}") if brain in self.regioned else {},
        )  # fmt: skip

    def simulated_at(self, run: str, brain: str, week: float) -> Measured:
        """Returns the simulated brain of a run at a week."""
        where = f"runs/{run}/{brain}/metrics"
        surfaces = f"results/runs/{run}/{brain}/surfaces/week-{week_tag(week)}"
        return Measured(
            f"{where}/week-{week_tag(week)}", brain, run, float(week_tag(week)), self.brains.sides(brain), surfaces,
            thickness=f"{surfaces}/thickness.shape.gii",
            report=[],
            # those of a run hold at all its weeks
            regions=region_files(f"results/{where}") if brain in self.regioned and run in self.config.runs else {},
        )  # fmt: skip
