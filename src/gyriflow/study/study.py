"""The plan of a study: its tables, and selections of their rows for rules and the
report.

The tables are written before rules are read; jobs read them.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from operator import attrgetter
from pathlib import Path
from typing import Any

import yaml

from ..io.exports import ExportedBrain, labels_file
from ..io.yaml_files import read_keys
from ..settings.root import Config
from ..settings.terms import OBSERVED, SIDES, Side, min_norm_subjects
from . import paths
from .atlases import UsedAtlas, atlas_by_brain, used_atlases
from .brains import closest, label_source, registered_source
from .records import (
    Brain,
    CalibrationRun,
    Chain,
    Comparison,
    Download,
    GrowthSeries,
    LeftOut,
    Link,
    MeasuredBrain,
    Simulation,
    SweepRun,
)
from .series import PATH
from .tables import read_rows, write_changed, write_rows

MAX_AGE_OFF_GW = 2.0
"""Difference between the stated week of an atlas' brain and its age by size up to which
the brain may be the nearest to a predicted week."""


@dataclass(frozen=True)
class Study:
    """Everything a configuration asks for. Refused brains are in `config` and
    `left_out`, not in `brains`.

    The rows of each table are by their key (see `TABLES`).
    """

    config: Config
    brains: Mapping[str, Brain]
    series: Mapping[str, GrowthSeries]
    simulations: Mapping[tuple[str, str], Simulation]
    simulated: Mapping[tuple[str, str, float], MeasuredBrain]
    compared: Mapping[tuple[str, str, float], Comparison]
    links: Mapping[str, Link]
    chains: Mapping[tuple[str, str], Chain]
    sweeps: Mapping[tuple[str, str, str], SweepRun]
    calibration: Mapping[tuple[str, str], CalibrationRun]
    left_out: Mapping[tuple[str, str], LeftOut]
    downloads: Mapping[str, Download]

    @cached_property
    def run_simulations(self) -> list[Simulation]:
        """The simulations of `runs`, without those of sweeps, calibration and
        ensembles."""
        return [
            simulation
            for simulation in self.simulations.values()
            if not simulation.may_diverge
        ]

    def files(self, *patterns: str) -> list[str]:
        """Return the files of patterns for each of `run_simulations`."""
        files = []
        for simulation in self.run_simulations:
            files += [simulation.file(pattern) for pattern in patterns]
        return files

    @cached_property
    def starts(self) -> list[Brain]:
        """The start brains of `runs`, in the order of `brains`."""
        starts = {simulation.brain for simulation in self.run_simulations}
        return [brain for brain in self.brains.values() if brain.id in starts]

    def rows_of(self, simulation: Simulation) -> list[MeasuredBrain]:
        """Return the simulated brains of a simulation, in the order of weeks."""
        return [self.simulated[*simulation.key, week] for week in simulation.weeks]

    def comparisons(self, simulation: Simulation) -> list[Comparison]:
        """Return the later weeks of a simulation with an observed brain."""
        keys = [(*simulation.key, week) for week in simulation.weeks]
        return [self.compared[key] for key in keys if key in self.compared]

    @cached_property
    def by_sweep(self) -> dict[str, list[SweepRun]]:
        """The runs of each sweep, by its name."""
        runs: dict[str, list[SweepRun]] = {}
        for row in self.sweeps.values():
            runs.setdefault(row.sweep, []).append(row)
        return runs

    @property
    def paths(self) -> dict[str, Chain]:
        """The paths of atlases by their first brain."""
        paths = {}
        for chain in self.chains.values():
            if chain.name == PATH:
                paths[chain.brain] = chain
        return paths

    @cached_property
    def growth_brains(self) -> list[tuple[str, Brain]]:
        """All brains that growth is measured on, each with its series, in the order of
        weeks within a series."""
        growth_brains = []
        for series in self.series.values():
            growth_brains += [
                (series.name, self.brains[name]) for name in series.brains
            ]
        return growth_brains

    # comparison with observed brains

    def observed(self, simulation: Simulation) -> dict[float, Brain]:
        """Return the brain that a simulation is compared with by week."""
        observed = {}
        for row in self.comparisons(simulation):
            if row.observed is not None:
                observed[row.week] = self.brains[row.observed]
        return observed

    def shown(self, simulation: Simulation) -> dict[float, Brain]:
        """Return the brain that figures show for each week of a simulation, the start
        brain first."""
        start = self.brains[simulation.brain]
        shown = {start.week: start}
        for row in self.comparisons(simulation):
            shown[row.week] = self.brains[row.shown]
        return shown

    @cached_property
    def validated(self) -> list[Simulation]:
        """The simulations of runs that are compared with an observed brain."""
        return [
            simulation
            for simulation in self.run_simulations
            if self.observed(simulation)
        ]

    @cached_property
    def atlas_predictions(self) -> list[Simulation]:
        """The validated simulations that are predictions by an atlas' growth."""
        return [
            simulation
            for simulation in self.validated
            if simulation.is_atlas_prediction
        ]

    @cached_property
    def prediction(self) -> Simulation | None:
        """The only simulation of the study if it is a prediction by an atlas' growth,
        else None."""
        if len(self.run_simulations) == 1:
            (simulation,) = self.run_simulations
            if simulation.is_atlas_prediction:
                return simulation
        return None

    def has_fine_surfaces(self, simulation: Simulation) -> bool:
        """Return whether a simulation is measured and compared by surfaces with the
        resolution of observed brains: a prediction of a brain with both
        hemispheres."""
        start = self.brains[simulation.brain]
        return simulation.is_atlas_prediction and start.sides == SIDES

    def measured_parts(self, row: MeasuredBrain) -> dict[str, str]:
        """Return the surfaces that a brain is measured and compared by: whole, left,
        right."""
        simulation = self.simulations.get((row.run, row.id))
        if simulation is None or not self.has_fine_surfaces(simulation):
            return row.parts
        parts = paths.fine_of(*row.sides)
        return {
            name: simulation.file(file, week=row.week) for name, file in parts.items()
        }

    def atlas_brains_near(self, simulation: Simulation, week: float) -> list[Brain]:
        """Return the brains of a prediction's atlas that may have the age of a week,
        those within `MAX_AGE_OFF_GW` of it or else the nearest."""
        chain = self.chains[simulation.brain, str(simulation.chain)]
        path = self.chains[str(chain.path), PATH]
        brains = [self.brains[name] for name in path.brains]
        near = []
        for brain in brains:
            if abs(brain.week - week) <= MAX_AGE_OFF_GW:
                near.append(brain)
        return near or [closest(brains, week)]

    def atlas_brain(self, simulation: Simulation) -> Brain:
        """Return the brain of a prediction's atlas that is closest in week to its
        end."""
        chain = self.chains[simulation.brain, "atlas"]
        return closest(
            [self.brains[name] for name in chain.later],
            simulation.weeks[-1],
        )

    @cached_property
    def predictions(self) -> list[Simulation]:
        """The `atlas_predictions`, and other predictions from the same start brains."""
        starts = {simulation.brain for simulation in self.atlas_predictions}
        return [
            simulation
            for simulation in self.validated
            if simulation.brain in starts and simulation.kind == "predicted"
        ]

    # measurements

    @cached_property
    def measured(self) -> dict[str, MeasuredBrain]:
        """The brains in the tables of the study, observed and simulated, by place."""
        rows: list[MeasuredBrain] = list(self.brains.values())
        for simulation in self.run_simulations:
            rows += self.rows_of(simulation)
        return {row.place: row for row in rows}

    @cached_property
    def used_atlases(self) -> list[UsedAtlas]:
        """The atlases of the study, with the files that exist now."""
        return used_atlases(self.config)

    @cached_property
    def atlases(self) -> dict[str, UsedAtlas]:
        """The atlas of each brain of an atlas, refused ones too, by the id of the
        brain."""
        return atlas_by_brain(self.used_atlases)

    def are_individuals(self, ids: Iterable[str]) -> bool:
        """Return whether brains are individuals, not averages of an atlas.

        Brains without named subjects at intervals of half a week or more may be the
        averages of an unknown atlas.
        """
        brains = [self.brains[brain] for brain in ids]
        if any(brain.atlas for brain in brains):
            return False
        weeks = sorted(brain.week for brain in brains)
        is_dense = any(late - early < 0.5 for early, late in pairwise(weeks))
        return is_dense or all(brain.subject for brain in brains)

    @cached_property
    def norm_reference(self) -> list[str]:
        """The ids of the brains that form the norm: those of the configuration, or else
        all observed brains.

        They have the hemispheres of the first start brain. By default, if there are
        several populations, only the start brain's is used.
        """
        # without runs, the first brain takes the place of the start brain
        starts = self.starts if self.config.runs else list(self.brains.values())
        if not starts:
            return []
        start = starts[0]
        brains = [brain for brain in self.brains.values() if brain.sides == start.sides]
        reference = self.config.metrics.norm_reference
        if reference is not None:
            # their ids, or that of their atlas
            return [
                brain.id
                for brain in brains
                if brain.id in reference or brain.atlas in reference
            ]
        brains = [brain for brain in brains if brain.shape is None]
        if len({brain.population for brain in brains}) > 1:
            brains = [brain for brain in brains if brain.population == start.population]
        return [brain.id for brain in brains]

    @property
    def has_norm(self) -> bool:
        """True if metrics are compared with a norm: of another study, or of enough
        subjects of this one."""
        if self.config.metrics.norms is not None:
            return True
        subjects = {self.brains[name].subject_name for name in self.norm_reference}
        are_individuals = self.are_individuals(self.norm_reference)
        return len(subjects) >= min_norm_subjects(individuals=are_individuals)

    @property
    def scans(self) -> dict[str, list[str]]:
        """The ids of the scans of each subject that was scanned several times, in the
        order of weeks."""
        scans: dict[str, list[str]] = {}
        by_week = sorted(
            self.brains.values(),
            key=attrgetter("week"),
        )
        for brain in by_week:
            if brain.subject is not None:
                scans.setdefault(brain.subject, []).append(brain.id)
        several = {}
        for subject in sorted(scans):
            if len(scans[subject]) > 1:
                several[subject] = scans[subject]
        return several

    @property
    def filled(self) -> list[dict[str, Any]]:
        """The brains that are filled to labels for the growth of runs: ids, by source
        and use of their cortex.

        The source is "white", "measured" (on a similar brain) or "typical".
        """
        groups: dict[tuple[str, bool], list[str]] = {}
        for file in self._followed_links:
            link = self.links[file]
            pair = (self.brains[link.earlier], self.brains[link.later])
            sources = [registered_source(self.config, brain) for brain in pair]
            by_cortex = all(source.scheme.cortex for source in sources)
            for brain, is_posed in zip(
                pair,
                link.posed,
                strict=True,
            ):
                if is_posed:
                    measured = "measured" if brain.thickness_of else "typical"
                    cortex = "white" if brain.white_files else measured
                    groups.setdefault((cortex, by_cortex), []).append(brain.id)
        return [
            {
                "ids": [*dict.fromkeys(ids)],
                "cortex": cortex,
                "by_cortex": by_cortex,
            }
            for (cortex, by_cortex), ids in groups.items()
        ]

    @property
    def _followed_links(self) -> list[str]:
        """The files of the chains that runs, without their ensembles, follow."""
        files: list[str] = []
        for simulation in self.run_simulations:
            if simulation.chain is not None:
                chain = self.chains[simulation.brain, simulation.chain]
                files += chain.links
                if chain.path is not None:
                    files += self.chains[chain.path, PATH].links
        return files

    # export

    @cached_property
    def exported(self) -> list[ExportedBrain]:
        """Each observed or simulated brain for the export."""
        return [
            self._exported(row, self.brains[row.id]) for row in self.measured.values()
        ]

    def _exported(self, row: MeasuredBrain, brain: Brain) -> ExportedBrain:
        volume: dict[str, Any] = {}
        if brain.labels and row.run != OBSERVED:
            volume = {
                "labels": label_source(self.config, brain),
                "surface": row.pial,
                "thickness": row.thickness,
            }

        def by_side(files: Iterable[str]) -> dict[Side, str]:
            return dict(zip(row.sides, files, strict=False))

        template_maps = {}
        template = self.brains.get(self.config.metrics.template or "")
        for side in row.sides:
            # the template may have been refused
            if template is not None and side in template.sides:
                place = {"where": row.place, "side": side}
                template_maps[side] = paths.TEMPLATE_MAPS.format(**place)
        return ExportedBrain(
            brain=row.id,
            run=row.run,
            week=row.week,
            subject=brain.subject_name,
            surfaces=by_side(row.hemispheres),
            maps=by_side(row.maps),
            regions=by_side(row.regions),
            report=brain.report,
            covariates=brain.covariates,
            # simulated brains have none
            white=by_side(brain.white) if row is brain else {},
            white_maps=by_side(brain.white_maps) if row is brain else {},
            template=self.config.metrics.template,
            template_maps=template_maps,
            volume=volume,
        )

    # contents of the report and the quality table, other than figures

    @property
    def prediction_facts(self) -> dict[str, Any] | None:
        """The names, weeks, growth and files of the one prediction, for its report;
        None if there is none."""
        simulation = self.prediction
        if simulation is None:
            return None
        start = self.brains[simulation.brain]
        last = self.rows_of(simulation)[-1]
        atlas_brain = self.atlas_brain(simulation)
        exported = self._exported(last, start)
        labels = None
        if exported.volume:
            labels = labels_file("results/export", exported, self.exported)
        used = self.atlases.get(atlas_brain.id)
        atlas_keys = {"name", "title", "licence", "reference"}
        return {
            **simulation.names,
            "start_week": start.week,
            "week": last.week,
            "atlas_brain": atlas_brain.id,
            "atlas_week": atlas_brain.week,
            # the population whose growth was used
            "population": atlas_brain.population_name,
            "atlas": used and used.atlas.model_dump(include=atlas_keys),
            "surfaces": [*self.measured_parts(last).values()],
            "atlas_surface": simulation.file(paths.ATLAS_BRAIN, week=last.week),
            "labels": labels,
        }


# the tables on disk


@dataclass(frozen=True)
class Table:
    """A table of the plan: the class of its rows, and the key of a row in the field of
    `Study` with the table's name."""

    kind: type
    key: Callable[[Any], Any]


TABLES = {
    "brains": Table(Brain, attrgetter("id")),
    "simulations": Table(Simulation, attrgetter("run", "brain")),
    "simulated": Table(MeasuredBrain, attrgetter("run", "id", "week")),
    "compared": Table(Comparison, attrgetter("run", "brain", "week")),
    "links": Table(Link, attrgetter("file")),
    "chains": Table(Chain, attrgetter("brain", "name")),
    "series": Table(GrowthSeries, attrgetter("name")),
    "sweeps": Table(SweepRun, attrgetter("sweep", "member", "brain")),
    "calibration": Table(CalibrationRun, attrgetter("run", "brain")),
    "left_out": Table(LeftOut, attrgetter("brain", "why")),
    "downloads": Table(Download, attrgetter("file")),
}


def study_of(config: Config, rows: Mapping[str, Iterable[Any]]) -> Study:
    """Return the study with the rows of each table."""
    tables = {}
    for name, table in TABLES.items():
        tables[name] = {table.key(row): row for row in rows[name]}
    return Study(config, **tables)


def write_plan(study: Study, folder: Path) -> None:
    """Write the tables and the configuration of a study, those that have changed."""
    for name, table in TABLES.items():
        rows = getattr(study, name).values()
        write_rows(folder / f"{name}.csv", table.kind, rows)
    plain = study.config.model_dump(mode="json", exclude_unset=True)
    text = yaml.safe_dump(plain, sort_keys=False, allow_unicode=True)
    write_changed(folder / "config.yaml", text)


def read_plan(folder: Path) -> Study:
    """Return the study whose plan is in a folder; InputError if there is none."""
    rows: dict[str, list[Any]] = {}
    for name, table in TABLES.items():
        rows[name] = read_rows(
            folder / f"{name}.csv",
            table.kind,
        )
    # its paths are absolute, and files of an atlas may be missing
    plain = read_keys(folder / "config.yaml")
    config = Config.model_validate(plain)
    return study_of(config, rows)
