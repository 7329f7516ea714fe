"""A resolved study: its records, and selections of them for rules, tables and the
report."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

from ..errors import InputError
from ..io.exports import ExportedBrain, labels_file
from ..settings.atlas import Atlas
from ..settings.root import Config
from ..settings.terms import MEASURED, SIDES, min_norm_subjects
from . import paths
from .atlases import UsedAtlas
from .brains import closest, comparable, label_source, registered_source
from .records import Brain, CalibrationRuns, MeasuredBrain, Simulation, Sweep
from .series import Chain, Series, several_subjects


@dataclass(frozen=True)
class Study:
    """Everything a configuration asks for. Refused brains are in `config`, not in
    `brains`.

    `simulations` are those of runs, sweeps and calibration, and of members of
    ensembles, by run and start brain. `chains` are the brains on which growth for a start brain is measured, by its
    id and their `chain_name`. `unreachable` has the reasons why start brains are not
    folded.
    """

    config: Config
    used_atlases: Sequence[UsedAtlas]
    brains: Mapping[str, Brain]
    series: Series
    simulations: Mapping[tuple[str, str], Simulation]
    chains: Mapping[tuple[str, str], Chain]
    sweeps: Mapping[str, Sweep]
    calibration: CalibrationRuns | None
    unreachable: Mapping[str, InputError]

    @cached_property
    def run_simulations(self) -> list[Simulation]:
        """The simulations of `runs`, without those of sweeps, calibration and
        ensembles."""
        return [
            simulation
            for simulation in self.simulations.values()
            if simulation.run in self.config.runs
        ]

    @cached_property
    def may_diverge(self) -> list[str]:
        """The runs of sweeps, calibration and ensembles, which may diverge without
        stopping the study."""
        runs = dict.fromkeys(run for run, _ in self.simulations)
        return [run for run in runs if run not in self.config.runs]

    @property
    def pairs(self) -> list[tuple[str, str]]:
        return [
            (simulation.run, simulation.start.id) for simulation in self.run_simulations
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
        starts = {simulation.start for simulation in self.run_simulations}
        return [brain for brain in self.brains.values() if brain in starts]

    @cached_property
    def growth_brains(self) -> list[tuple[str, Brain]]:
        """All brains that growth is measured on, each with its series, in the order of
        weeks within a series."""
        growth_brains = []
        for name, brains in self.series.brains.items():
            by_week = sorted(brains, key=lambda brain: brain.week)
            growth_brains += [(name, brain) for brain in by_week]
        return growth_brains

    @cached_property
    def series_with_rates(self) -> list[str]:
        """The series whose differences between weeks are growth: of a subject, of an
        atlas, or used by a run."""
        starts = set()
        used = set()
        for simulation in self.simulations.values():
            starts.add(simulation.start)
            used.add(simulation.followed_series)
            if simulation.shapes:
                chain = self.chains[simulation.start.id, simulation.shapes]
                used |= {self.series.with_brain(brain) for brain in chain.later}
        for name, brains in self.series.brains.items():
            if several_subjects(brains):
                continue
            is_of_atlas = all(brain.atlas for brain in brains)
            # brains without a subject may be different fetuses
            if brains[0].subject or is_of_atlas or starts & {*brains}:
                used.add(name)
        return [name for name in self.series.brains if name in used]

    def growth_source(self, simulation: Simulation) -> str:
        """Describe whose measured growth a simulation follows, or return ""."""
        if simulation.shapes:
            chain = self.chains[simulation.start.id, simulation.shapes]
            brains = chain.later if simulation.shapes == "atlas" else chain.brains
            name = self.series.with_brain(brains[0])
        else:
            name = simulation.followed_series or ""
            brains = self.series.brains.get(name, ())
        if several_subjects(brains):
            return f"population {name}"
        if simulation.start in brains:
            return "own"
        return f"series {name}" if brains else ""

    @cached_property
    def with_ensemble(self) -> list[Simulation]:
        """The simulations of runs that have an ensemble."""
        return [
            simulation for simulation in self.run_simulations if simulation.ensemble
        ]

    def members(self, simulation: Simulation) -> list[Simulation]:
        """Return the members of a simulation's ensemble."""
        return [
            self.simulations[name, simulation.start.id] for name in simulation.ensemble
        ]

    # comparison with observed brains

    @cached_property
    def validated(self) -> list[Simulation]:
        """The simulations of runs that are compared with an observed brain."""
        return [
            simulation for simulation in self.run_simulations if simulation.observed
        ]

    @cached_property
    def references(self) -> dict[tuple[str, float], tuple[Brain, Brain]]:
        """The observed brain, and the latest comparable one of an earlier week, by
        start brain and week."""
        references = {}
        for simulation in self.validated:
            start = simulation.start
            candidates = [
                brain
                for brain in comparable(start, self.brains.values())
                if brain.shape is None
            ]
            for week, observed in simulation.observed.items():
                earlier = [brain for brain in candidates if brain.week < week]
                latest = max(earlier, key=lambda brain: brain.week)
                references[start.id, week] = (observed, latest)
        return references

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

    def atlas_brain(self, simulation: Simulation) -> Brain:
        """Return the brain of a prediction's atlas that is closest in week to its
        end."""
        chain = self.chains[simulation.start.id, "atlas"]
        return closest(chain.later, simulation.weeks[-1])

    @cached_property
    def predictions(self) -> list[Simulation]:
        """The `atlas_predictions`, and other predictions from the same start brains."""
        starts = {simulation.start for simulation in self.atlas_predictions}
        return [
            simulation
            for simulation in self.validated
            if simulation.start in starts and simulation.kind == "predicted"
        ]

    # measurements

    @cached_property
    def measured(self) -> dict[str, MeasuredBrain]:
        """The brains in the tables of the study, observed and simulated, by place."""
        rows: list[MeasuredBrain] = list(self.brains.values())
        for simulation in self.run_simulations:
            rows += simulation.simulated
        return {row.place: row for row in rows}

    @cached_property
    def all_measured(self) -> dict[str, MeasuredBrain]:
        """All measured brains by place, including those of sweeps at their week of
        comparison."""
        rows = {}
        for sweep in self.sweeps.values():
            for simulation, _ in sweep.members:
                row = simulation.at(sweep.week)
                rows[row.place] = row
        return rows | self.measured

    @property
    def surfaces(self) -> list[str]:
        files = []
        for brain in self.brains.values():
            patterns = [*paths.pial_of(*brain.sides).values()]
            if brain.thickness:
                patterns += paths.THICKNESS.values()
            files += [pattern.format(**brain.names) for pattern in patterns]
        return files

    @cached_property
    def atlases(self) -> dict[str, Atlas]:
        """The atlas of each brain of an atlas, by the id of the brain."""
        atlases: dict[str, Atlas] = {}
        for used in self.used_atlases:
            atlases |= {file.brain: used.atlas for file in used.files}
        return atlases

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
        starts = self.starts
        if not self.config.runs:
            # without runs, the first brain takes the place of the start brain
            starts = list(self.brains.values())
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
        """Whether metrics are compared with a norm: of another study, or of enough
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
        scans: dict[str, list[Brain]] = {}
        for brain in self.brains.values():
            if brain.subject is not None:
                scans.setdefault(brain.subject, []).append(brain)
        several = {}
        for subject in sorted(scans):
            if len(scans[subject]) > 1:
                by_week = sorted(scans[subject], key=lambda brain: brain.week)
                several[subject] = [brain.id for brain in by_week]
        return several

    @property
    def filled(self) -> list[dict[str, Any]]:
        """The brains that are filled to labels for the growth of runs: ids, by source
        and use of their cortex.

        The source is "white", "measured" (on a similar brain) or "typical".
        """
        chains = {}
        for simulation in self.run_simulations:
            if simulation.shapes:
                key = (simulation.start.id, simulation.shapes)
                chains[key] = self.chains[key]
        groups: dict[tuple[str, bool], dict[str, None]] = {}
        for chain in chains.values():
            for pair, posed in chain.pairs:
                by_cortex = all(self._has_cortex(brain) for brain in pair)
                for brain, is_posed in zip(pair, posed, strict=True):
                    if is_posed:
                        group = (self._cortex_source(brain), by_cortex)
                        groups.setdefault(group, {})[brain.id] = None
        return [
            {"ids": list(ids), "cortex": cortex, "by_cortex": by_cortex}
            for (cortex, by_cortex), ids in groups.items()
        ]

    def _cortex_source(self, brain: Brain) -> str:
        if brain.white_files:
            return "white"
        return "measured" if brain.thickness_of else "typical"

    def _has_cortex(self, brain: Brain) -> bool:
        return bool(registered_source(self.config, brain).scheme.cortex)

    # export

    @cached_property
    def exported(self) -> list[ExportedBrain]:
        """Each observed or simulated brain for the export."""
        return [
            self._exported(row, self.brains[row.id]) for row in self.measured.values()
        ]

    def _exported(self, row: MeasuredBrain, brain: Brain) -> ExportedBrain:
        is_observed = row.run == MEASURED
        volume: dict[str, Any] = {}
        if brain.labels and not is_observed:
            volume = {
                "labels": label_source(self.config, brain),
                "surface": row.pial,
                "thickness": row.thickness,
            }
        white = brain.white if is_observed else ()
        white_maps = brain.white_maps if is_observed else ()
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
            surfaces=dict(zip(row.sides, row.hemispheres, strict=True)),
            maps=dict(zip(row.sides, row.maps, strict=True)),
            regions=dict(zip(SIDES, row.regions, strict=False)),
            report=brain.report,
            covariates=brain.covariates,
            white=dict(zip(row.sides, white, strict=False)),
            white_maps=dict(zip(row.sides, white_maps, strict=False)),
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
        last = simulation.simulated[-1]
        atlas_brain = self.atlas_brain(simulation)
        exported = self._exported(last, simulation.start)
        labels = None
        if exported.volume:
            labels = labels_file("results/export", exported, self.exported)
        atlas = self.atlases.get(atlas_brain.id)
        atlas_keys = {"name", "title", "licence", "reference"}
        return {
            **simulation.names,
            "start_week": simulation.start.week,
            "week": last.week,
            "atlas_brain": atlas_brain.id,
            "atlas_week": atlas_brain.week,
            # the population whose growth was used
            "population": atlas_brain.population_name,
            "atlas": atlas and atlas.model_dump(include=atlas_keys),
            "surfaces": [*last.parts.values()],
            "atlas_surface": simulation.atlas_surface,
            "labels": labels,
        }
