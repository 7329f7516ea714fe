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
from ..settings.terms import MEASURED, SIDES, Side
from . import paths
from .atlases import UsedAtlas
from .records import Brain, CalibrationRuns, Measurement, Simulation, Sweep
from .series import Chain, Series, several_subjects


@dataclass(frozen=True)
class Study:
    """Everything a configuration asks for. Refused brains are in `config`, not in
    `brains`.

    `checksums` are those of atlas files (see `known_checksums`). `simulations` are
    those of runs, sweeps and calibration, and of members of ensembles, by run and start
    brain. `chains` are the brains on which growth for a start brain is measured, by its
    id and their `chain_name`. `unreachable` has the reasons why start brains are not
    folded.
    """

    config: Config
    used_atlases: Sequence[UsedAtlas]
    checksums: Mapping[str, tuple[str, str]]
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
        return list(
            dict.fromkeys(
                run for run, _ in self.simulations if run not in self.config.runs
            )
        )

    @property
    def pairs(self) -> list[tuple[str, str]]:
        return [
            (simulation.run, simulation.start.id) for simulation in self.run_simulations
        ]

    def files(self, *patterns: str) -> list[str]:
        """Return the files of patterns for each of `run_simulations`."""
        return [
            simulation.file(pattern)
            for simulation in self.run_simulations
            for pattern in patterns
        ]

    @cached_property
    def starts(self) -> list[Brain]:
        """The start brains of `runs`, in the order of `brains`."""
        starts = {simulation.start for simulation in self.run_simulations}
        return [brain for brain in self.brains.values() if brain in starts]

    @cached_property
    def growth_brains(self) -> list[tuple[str, Brain]]:
        """All brains that growth is measured on, each with its series, in the order of
        weeks within a series."""
        series = self.series.brains
        return [
            (name, brain)
            for name in series
            for brain in sorted(series[name], key=lambda brain: brain.week)
        ]

    @cached_property
    def series_with_rates(self) -> list[str]:
        """The series whose differences between weeks are growth: of a subject, of an
        atlas, or used by a run."""
        simulations = self.simulations.values()
        starts = {simulation.start for simulation in simulations}
        grown = [
            self.chains[simulation.start.id, simulation.shapes]
            for simulation in simulations
            if simulation.shapes
        ]
        used = {simulation.followed_series for simulation in simulations}
        used |= {
            self.series.with_brain(brain) for chain in grown for brain in chain.later
        }
        for name, brains in self.series.brains.items():
            is_of_atlas = all(brain.id in self.atlases for brain in brains)
            # brains without a subject may be different fetuses
            if not several_subjects(brains) and (
                brains[0].config.subject or is_of_atlas or starts & {*brains}
            ):
                used.add(name)
        return [name for name in self.series.brains if name in used]

    def growth_source(self, simulation: Simulation) -> str:
        """Describe whose measured growth a simulation follows, or return ""."""
        if simulation.shapes:
            brains = self.chains[simulation.start.id, simulation.shapes].brains
            brains = brains[1:] if simulation.shapes == "atlas" else brains
            name = self.series.with_brain(brains[0])
        else:
            name = simulation.followed_series or ""
            brains = self.series.brains.get(name, ())
        if several_subjects(brains):
            return f"population {name}"
        return (
            "own" if simulation.start in brains else f"series {name}" if brains else ""
        )

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
            comparable = simulation.start.comparable(self.brains.values())
            candidates = [brain for brain in comparable if not brain.config.synthetic]
            for week, observed in simulation.observed.items():
                earlier = [brain for brain in candidates if brain.week < week]
                references[simulation.start.id, week] = (
                    observed,
                    max(earlier, key=lambda brain: brain.week),
                )
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
        simulations = self.run_simulations
        return (
            simulations[0]
            if len(simulations) == 1 and simulations[0].is_atlas_prediction
            else None
        )

    def atlas_brain(self, simulation: Simulation) -> Brain:
        """Return the brain of a prediction's atlas that is closest in week to its
        end."""
        end = simulation.weeks[-1]
        return min(
            self.chains[simulation.start.id, "atlas"].later,
            key=lambda brain: abs(brain.week - end),
        )

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
    def measurements(self) -> dict[str, Measurement]:
        """The measurements in the tables of the study, of observed and simulated
        brains, by folder."""
        rows = [brain.measurement for brain in self.brains.values()]
        return {
            row.where: row
            for row in (
                *rows,
                *(
                    row
                    for simulation in self.run_simulations
                    for row in simulation.measurements
                ),
            )
        }

    @cached_property
    def all_measurements(self) -> dict[str, Measurement]:
        """All measurements by folder, including those of sweeps at their week of
        comparison."""
        rows = [
            simulation.at(sweep.week)
            for sweep in self.sweeps.values()
            for simulation, _ in sweep.members
        ]
        return {**{row.where: row for row in rows}, **self.measurements}

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

    @cached_property
    def atlases(self) -> dict[str, Atlas]:
        """The atlas of each brain of an atlas, by the id of the brain."""
        return {
            used.atlas.brain_id(file.series, file.week): used.atlas
            for used in self.used_atlases
            for file in used.files
        }

    def are_individuals(self, ids: Iterable[str]) -> bool:
        """Return whether brains are individuals, not averages of an atlas.

        Brains without named subjects at intervals of half a week or more may be the
        averages of an unknown atlas.
        """
        brains = [self.brains[brain].config for brain in ids]
        weeks = sorted(brain.week for brain in brains)
        has_subjects = all(brain.subject for brain in brains)
        is_dense = any(late - early < 0.5 for early, late in pairwise(weeks))
        return (has_subjects or is_dense) and not any(
            brain.id in self.atlases for brain in brains
        )

    @cached_property
    def norm_reference(self) -> list[str]:
        """The ids of the brains that form the norm: those of the configuration, or else
        all observed brains.

        They have the hemispheres of the first start brain. By default, if there are
        several populations, only the start brain's is used.
        """
        # without runs, the first brain takes the place of the start brain
        first = self.starts or ([] if self.config.runs else list(self.brains.values()))
        if not first:
            return []
        start, reference = first[0], self.config.metrics.norm_reference
        candidates = [
            brain for brain in self.brains.values() if brain.sides == start.sides
        ]
        if reference is not None:
            atlas_names = {brain: atlas.name for brain, atlas in self.atlases.items()}
            return [
                brain.id
                for brain in candidates
                if {brain.id, atlas_names.get(brain.id)} & set(reference)
            ]
        observed = [brain for brain in candidates if not brain.config.synthetic]
        if len({brain.config.population for brain in observed}) > 1:
            observed = [
                brain
                for brain in observed
                if brain.config.population == start.config.population
            ]
        return [brain.id for brain in observed]

    @property
    def scans(self) -> dict[str, list[str]]:
        """The ids of the scans of each subject that was scanned several times, in the
        order of weeks."""
        scans: dict[str, list[str]] = {}
        for brain in sorted(
            self.brains.values(),
            key=lambda brain: (brain.config.subject or "", brain.week),
        ):
            if brain.config.subject is not None:
                scans.setdefault(brain.config.subject, []).append(brain.id)
        return {subject: ids for subject, ids in scans.items() if len(ids) > 1}

    def similar_in_thickness(self, brain: Brain) -> Brain | None:
        """Return the brain whose measured thickness fills another one's pial surface;
        None if none is measured.

        It is the brain with labels, or else with white surfaces, that is closest in
        week.
        """
        others = [
            other
            for other in self.brains.values()
            if other.has_thickness and other is not brain
        ]
        return min(
            others,
            key=lambda other: (other.labels is None, abs(other.week - brain.week)),
            default=None,
        )

    @property
    def filled(self) -> list[dict[str, Any]]:
        """The brains that are filled to labels for the growth of runs: ids, by source
        and use of their cortex.

        The source is "white", "measured" (on a similar brain) or "typical".
        """
        groups: dict[tuple[str, bool], dict[str, None]] = {}
        followed = [
            (simulation.start.id, simulation.shapes)
            for simulation in self.run_simulations
            if simulation.shapes
        ]
        for chain in (self.chains[key] for key in dict.fromkeys(followed)):
            for pair, posed in chain.pairs:
                has_cortex = all(brain.registered.scheme.cortex for brain in pair)
                for brain in (
                    brain
                    for brain, is_posed in zip(pair, posed, strict=True)
                    if is_posed
                ):
                    similar = (
                        "measured" if self.similar_in_thickness(brain) else "typical"
                    )
                    source = "white" if brain.config.white_files else similar
                    groups.setdefault((source, has_cortex), {})[brain.id] = None
        return [
            {"ids": list(ids), "cortex": cortex, "by_cortex": used}
            for (cortex, used), ids in groups.items()
        ]

    # regions, and maps at the vertices of the template

    def region_source(self, name: str) -> Brain:
        """Return the brain with regions of its own that is closest in week to a
        brain."""
        week = self.brains[name].week
        sources = [
            brain for brain in self.brains.values() if brain.regions_from == "given"
        ]
        return min(sources, key=lambda brain: abs(brain.week - week))

    def template_sides(self, row: Measurement) -> list[Side]:
        """Return the hemispheres of a brain that have maps at the template's
        vertices."""
        # the template may have been refused
        template = self.brains.get(self.config.metrics.template or "")
        return [
            side
            for side in row.sides
            if template is not None and side in template.sides
        ]

    @cached_property
    def exported(self) -> list[ExportedBrain]:
        """Each observed or simulated brain for the export."""
        return [
            self._exported(row, self.brains[row.subject])
            for row in self.measurements.values()
        ]

    def _exported(self, row: Measurement, brain: Brain) -> ExportedBrain:
        is_observed = row.run == MEASURED
        white_sides = row.sides if is_observed and brain.has_white else ()
        white = {
            name: file.format(brain=brain.id)
            for name, file in paths.white_of(*white_sides).items()
        }
        template = {
            side: paths.TEMPLATE_MAPS.format(where=row.where, side=side)
            for side in self.template_sides(row)
        }
        volume = {
            "labels": brain.labels,
            "surface": row.parts["whole"],
            "thickness": row.thickness,
        }
        return ExportedBrain(
            brain=row.subject,
            run=row.run,
            week=row.week,
            subject=brain.subject,
            surfaces=dict(zip(row.sides, row.hemispheres, strict=True)),
            maps=dict(zip(row.sides, row.maps, strict=True)),
            regions=dict(zip(SIDES, row.regions.values(), strict=False)),
            report=brain.report,
            covariates=brain.config.covariates,
            white={side: white[f"{side}_surface"] for side in white_sides},
            white_maps={side: white[f"{side}_maps"] for side in white_sides},
            template=self.config.metrics.template,
            template_maps=template,
            volume=volume if brain.labels and not is_observed else {},
        )

    # contents of the report and the quality table, other than figures

    @property
    def prediction_facts(self) -> dict[str, Any] | None:
        """The names, weeks, growth and files of the one prediction, for its report;
        None if there is none."""
        if (simulation := self.prediction) is None:
            return None
        last, atlas_brain = simulation.measurements[-1], self.atlas_brain(simulation)
        brain = next(
            brain
            for brain in self.exported
            if (brain.run, brain.week) == (simulation.run, last.week)
        )
        atlas = self.atlases.get(atlas_brain.id)
        return {
            **simulation.names,
            "start_week": simulation.start.week,
            "week": last.week,
            "atlas_brain": atlas_brain.id,
            "atlas_week": atlas_brain.week,
            # the population whose growth was used
            "population": atlas_brain.population,
            "atlas": (
                atlas
                and atlas.model_dump(include={"name", "title", "licence", "reference"})
            ),
            "surfaces": [*last.parts.values()],
            "atlas_surface": simulation.atlas_surface,
            "labels": (
                labels_file("results/export", brain, self.exported)
                if brain.volume
                else None
            ),
        }
