"""The figures and tables of a study: their brains and runs, and the inputs and options
that depend on these.

A function has the name of an entry of `workflow/figures.yaml`, which has the text and
the other inputs and options. An entry without a function is drawn for each of the
records that it names, or once.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

from ..settings.terms import MAX_COLOURS, min_norm_subjects, run_names
from .paths import DEVIATION, ENSEMBLE_MAPS, FOLDING, MESH
from .records import Brain, Measurement, Simulation, Sweep
from .registry import Arguments, Figure, Kind, kinds, observed_name
from .study import Study

ZONES = {"contact", "no_growth", "support"}
"""Settings that determine the zones of a run. Runs with equal ones share a figure of
the zones."""
MAX_SERIES = 4
MAX_DEVIATIONS = 4
"""Weeks for which the deviation from the expected brain is shown."""


EACH: Mapping[str, Callable[[Study], Iterable[Any]]] = {
    "study": lambda study: [study],
    "brains": lambda study: study.brains.values(),
    "runs": lambda study: study.run_simulations,
    "ensembles": lambda study: study.with_ensemble,
}
"""Records that have a figure each, by the key `each` of an entry."""


def figures_of(study: Study) -> list[Figure]:
    """Return the figures and tables of a study, in the order of the report."""
    found: list[Figure] = []
    for name, kind in kinds().items():
        if function := globals().get(name):
            found += function(kind, study)
            continue
        for item in EACH[kind.each](study):
            if not kind.needs or getattr(item, kind.needs):
                names = (
                    {"brain": item.id}
                    if isinstance(item, Brain)
                    else getattr(item, "names", {})
                )
                found.append(Figure(kind, names))
    return found


# brains


def brain_regions(kind: Kind, study: Study) -> Iterator[Figure]:
    for brain in study.brains.values():
        if brain.has_regions:
            yield Figure(
                kind,
                {"brain": brain.id},
                {"brains": {brain.id: brain.measurement.halves_with_regions}},
            )


def inputs_figure(kind: Kind, study: Study) -> Iterator[Figure]:
    # the first and the last brain
    ends = dict.fromkeys(
        pick(study.brains.values(), key=lambda brain: brain.week) for pick in (min, max)
    )
    observed = {f"{brain.id}\n{brain.week:g} GW": brain.pial for brain in ends}
    yield Figure(kind, inputs={"runs": {}, "observed": observed})


def mesh_quality(kind: Kind, study: Study) -> Iterator[Figure]:
    if study.starts:
        quality = {
            start.id: MESH["quality"].format(brain=start.id) for start in study.starts
        }
        yield Figure(
            kind,
            inputs={"quality": quality},
            options={"gates": study.config.mesh.gates},
        )


# growth


def growth_figure(kind: Kind, study: Study) -> Iterator[Figure]:
    # for many subjects without simulations, charts of metrics and change.csv show
    # growth; here each would need a panel
    if not study.growth_brains or (
        len(study.series.brains) > MAX_SERIES and not study.run_simulations
    ):
        return
    # runs that follow sizes or shapes have no given rate
    settings = [simulation.settings for simulation in study.simulations.values()]
    grown = [
        run for run in settings if "growth_rate_per_s" in run.growth.definition.rates
    ]
    rate: Any = grown[0].growth_rate_per_s if grown else None
    if any(run.growth_rate_per_s != rate for run in grown):
        rate = None
    elif grown and not isinstance(rate, float):
        rate = dict(rate.weeks or {}) if rate.map is None else None
    name = observed_name(brain for _, brain in study.growth_brains)
    yield Figure(kind, options={"observed_name": name, "folding_rate_per_s": rate})


def atlas_ages(kind: Kind, study: Study) -> Iterator[Figure]:
    for start in dict.fromkeys(
        run.start for run in study.run_simulations if run.shapes == "atlas"
    ):
        yield Figure(kind, {"brain": start.id})


# runs


def predicted_figure(kind: Kind, study: Study) -> Iterator[Figure]:
    if simulation := study.prediction:
        start, atlas_brain = simulation.start, study.atlas_brain(simulation)
        predicted = f"predicted\n{simulation.weeks[-1]:g} GW"
        brains = {
            f"start\n{start.week:g} GW": start.pial,
            predicted: simulation.measurements[-1].parts["whole"],
        }
        brains[f"atlas' own brain\n{atlas_brain.week:g} GW"] = atlas_brain.pial
        yield Figure(
            kind,
            simulation.names,
            {"runs": {}, "observed": brains},
            {"predicted": predicted},
        )


def _by_start(
    study: Study,
) -> Iterator[tuple[dict[str, str], list[Simulation], dict[float, Brain]]]:
    """Yield for each start brain its name, its simulations, and by week the observed
    brains shown with them."""
    for start in study.starts:
        simulations = [
            simulation
            for simulation in study.run_simulations
            if simulation.start is start
        ]
        observed = [simulation.observed_with_start for simulation in simulations]
        yield (
            {"brain": start.id},
            simulations,
            {week: brain for weeks in observed for week, brain in weeks.items()},
        )


def weekly_figure(kind: Kind, study: Study) -> Iterator[Figure]:
    for names, simulations, observed in _by_start(study):
        inputs = {
            "runs": {simulation.run: simulation.surfaces for simulation in simulations},
            "observed": {week: brain.pial for week, brain in observed.items()},
        }
        yield Figure(
            kind, names, inputs, {"observed_name": observed_name(observed.values())}
        )


def outlines_figure(kind: Kind, study: Study) -> Iterator[Figure]:
    for names, simulations, observed in _by_start(study):
        runs = {
            simulation.run: {
                week: simulation.surfaces[week]
                for week in simulation.observed_with_start
            }
            for simulation in simulations
        }
        inputs = {
            "observed": {week: brain.pial for week, brain in observed.items()},
            "runs": runs,
        }
        yield Figure(
            kind, names, inputs, {"observed_name": observed_name(observed.values())}
        )


def displacement_maps(kind: Kind, study: Study) -> Iterator[Figure]:
    for names, simulations, _ in _by_start(study):
        frames = {
            simulation.run: simulation.file(FOLDING["frames"])
            for simulation in simulations
        }
        yield Figure(kind, names, {"frames": frames})


def shape_maps(kind: Kind, study: Study) -> Iterator[Figure]:
    for names, simulations, observed in _by_start(study):
        brains = {
            simulation.run: {row.week: row.halves for row in simulation.measurements}
            for simulation in simulations
        }
        measured = {week: brain.measurement.halves for week, brain in observed.items()}
        yield Figure(
            kind,
            names,
            {"brains": {**brains, observed_name(observed.values()): measured}},
        )


def position_spread_figure(kind: Kind, study: Study) -> Iterator[Figure]:
    for simulation in study.with_ensemble:
        weeks = {}
        for row in simulation.measurements[1:]:
            maps = [
                simulation.file(ENSEMBLE_MAPS, week=row.week, side=side)
                for side in row.sides
            ]
            weeks[row.week] = [
                list(pair) for pair in zip(row.hemispheres, maps, strict=True)
            ]
        yield Figure(kind, simulation.names, {"brains": {simulation.run: weeks}})


sulcus_probability_figure = position_spread_figure


def zones_figure(kind: Kind, study: Study) -> Iterator[Figure]:
    shown = set()
    for simulation in study.run_simulations:
        zones = repr(
            (simulation.start.id, simulation.settings.model_dump(include=ZONES))
        )
        if zones not in shown:
            shown.add(zones)
            yield Figure(kind, simulation.names)


def model_figure(kind: Kind, study: Study) -> Iterator[Figure]:
    for simulation in study.run_simulations:
        if (
            "growth_rate_per_s" in simulation.settings.growth.definition.rates
            and not simulation.maps
        ):
            yield Figure(kind, simulation.names)


def displacement_figure(kind: Kind, study: Study) -> Iterator[Figure]:
    if study.run_simulations:
        yield Figure(kind, options={"runs": run_names(study.pairs)})


paper_displacement_figure = displacement_figure


# metrics


def metrics_figure(kind: Kind, study: Study) -> Iterator[Figure]:
    yield Figure(kind, options=_chart_options(study))


spectra_figure = metrics_figure


def _chart_options(study: Study) -> dict[str, Any]:
    """Return the names and groups of brains in charts over the weeks."""
    brains, groups = study.brains.values(), _groups(study)
    return {
        "runs": run_names(study.pairs),
        "observed_name": observed_name(
            [brain for brain in brains if brain.id not in groups] or brains
        ),
        "subjects": {
            brain.id: brain.subject
            for brain in brains
            if brain.config.subject is not None
        },
        "groups": groups,
    }


def _groups(study: Study) -> dict[str, str]:
    """Return the group of each observed brain: its value of the covariate that colours
    show.

    That is the first covariate with 2 to `MAX_COLOURS` values and fewer values than
    subjects.
    """
    brains = study.brains.values()
    covariates = dict.fromkeys(
        name for brain in brains for name in brain.config.covariates
    )
    for name in covariates:
        values = {}
        subjects = set()
        for brain in brains:
            if name in brain.config.covariates:
                values[brain.id] = brain.config.covariates[name]
                subjects.add(brain.subject)
        count = len(set(values.values()))
        if 1 < count <= MAX_COLOURS and count < len(subjects):
            return {brain: f"{name}: {value}" for brain, value in values.items()}
    return {}


def metrics_table(kind: Kind, study: Study) -> Iterator[Figure]:
    if study.run_simulations:
        yield Figure(
            kind, options={"observed_name": observed_name(study.brains.values())}
        )


def norms_figure(kind: Kind, study: Study) -> Iterator[Figure]:
    reference = [study.brains[brain] for brain in study.norm_reference]
    needed = min_norm_subjects(individuals=study.are_individuals(study.norm_reference))
    if (
        study.config.metrics.norms
        or len({brain.subject for brain in reference}) >= needed
    ):
        comparable = [
            brain.id
            for brain in study.brains.values()
            if brain.sides == reference[0].sides
        ]
        # norms of another study have no brains here
        own = [] if study.config.metrics.norms else study.norm_reference
        about = {
            "observed_name": observed_name(reference),
            "reference": own,
            "brains": comparable,
        }
        yield Figure(kind, options=_chart_options(study) | about)


def regions_chart(kind: Kind, study: Study) -> Iterator[Figure]:
    if brains := [brain for brain in study.brains.values() if brain.has_regions]:
        yield Figure(kind, options={"observed_name": observed_name(brains)})


def regions_figure(kind: Kind, study: Study) -> Iterator[Figure]:
    rows = {
        brain.id: brain.measurement
        for brain in study.brains.values()
        if brain.has_regions
    }
    simulated = {
        f"{name}, {simulation.weeks[-1]:g} GW": simulation.measurements[-1]
        for simulation, name in zip(
            study.run_simulations, run_names(study.pairs), strict=True
        )
        if simulation.has_regions
    }
    if rows and simulated:
        brains = {
            head: row.halves_with_regions for head, row in (rows | simulated).items()
        }
        yield Figure(kind, inputs={"brains": brains})


# runs compared with observed brains


def validation_figure(kind: Kind, study: Study) -> Iterator[Figure]:
    if study.validated:
        yield Figure(kind, options={"runs": list(study.config.runs)})


def prediction_figure(kind: Kind, study: Study) -> Iterator[Figure]:
    if study.predictions:
        yield Figure(kind, options={"runs": list(study.config.runs)})


def _deviations(simulation: Simulation) -> dict[float, list[str]]:
    """Return the expected surface and the maps of the observed brain's deviation from
    it, by week."""
    files = {
        week: simulation.file(DEVIATION["maps"], week=week)
        for week in simulation.observed
    }
    return {week: [simulation.surfaces[week], file] for week, file in files.items()}


def expected_figure(kind: Kind, study: Study) -> Iterator[Figure]:
    for simulation in study.atlas_predictions:
        surfaces, observed = simulation.surfaces, simulation.observed_with_start
        deviations = _deviations(simulation)
        # the last week, and others at equal steps
        every = -(-len(deviations) // MAX_DEVIATIONS)
        weeks = sorted(deviations, reverse=True)[::every]
        weeks_drawn = {min(surfaces), *weeks}
        inputs = {
            "runs": {
                "expected": {
                    week: surface
                    for week, surface in surfaces.items()
                    if week in weeks_drawn
                }
            },
            "observed": {
                week: brain.pial
                for week, brain in observed.items()
                if week in weeks_drawn
            },
            "deviations": {week: deviations[week] for week in weeks},
        }
        yield Figure(
            kind,
            simulation.names,
            inputs,
            {"observed_name": observed_name(observed.values())},
        )


def deviation_figure(kind: Kind, study: Study) -> Iterator[Figure]:
    for simulation in study.atlas_predictions:
        maps = {week: [files] for week, files in _deviations(simulation).items()}
        for quantity in (
            "log_area",
            *(["thickness_difference_mm"] if simulation.start.has_thickness else []),
        ):
            names = {**simulation.names, "quantity": quantity}
            yield Figure(
                kind,
                names,
                {"brains": {"observed minus expected": maps}},
                {"quantity": quantity},
            )


# sweeps, which the configuration calls studies


def _first_start(sweep: Sweep) -> Brain:
    """Return the start brain of the first run; figures show the runs from this
    brain."""
    return sweep.members[0][0].start


def _members(sweep: Sweep) -> dict[str, Measurement]:
    """Return the simulated brains from this start at the week of comparison, by run."""
    start = _first_start(sweep)
    return {
        simulation.run: simulation.at(sweep.week)
        for simulation, _ in sweep.members
        if simulation.start is start
    }


def _sweep_figure(
    kind: Kind, sweep: Sweep, inputs: Arguments, **options: Any
) -> Figure:
    """Return a figure of the runs of a sweep; runs may have ended before the week of
    comparison."""
    start = _first_start(sweep)
    values = {
        simulation.run: dict(values)
        for simulation, values in sweep.members
        if simulation.start is start
    }
    options |= {
        "values": values,
        "observed_name": observed_name(sweep.observed[start.id][:1]),
    }
    return Figure(kind, _sweep_names(sweep), inputs, options, (start.id, sweep.week))


def _sweep_names(sweep: Sweep) -> dict[str, str]:
    return {"study": sweep.name, "week": f"{sweep.week:g}"}


def influence_figure(kind: Kind, study: Study) -> Iterator[Figure]:
    for sweep in study.sweeps.values():
        observed = sweep.observed[_first_start(sweep).id]
        inputs = {
            "members": {run: row.halves for run, row in _members(sweep).items()},
            "observed": observed[0].measurement.halves if observed else None,
        }
        yield _sweep_figure(kind, sweep, inputs)


def influence_spectra(kind: Kind, study: Study) -> Iterator[Figure]:
    for sweep in study.sweeps.values():
        observed = sweep.observed[_first_start(sweep).id][:1]
        inputs = {
            "members": {
                run: f"{row.folder}/spectra.csv" for run, row in _members(sweep).items()
            },
            "observed": [
                f"{brain.measurement.folder}/spectra.csv" for brain in observed
            ],
        }
        yield _sweep_figure(kind, sweep, inputs, week=sweep.week)


def nearest_figure(kind: Kind, study: Study) -> Iterator[Figure]:
    for sweep in study.sweeps.values():
        start, values = _first_start(sweep), study.config.studies[sweep.name].vary
        observed = [brain.id for brain in sweep.observed[start.id][:1]]
        (varied, *others), tried = sweep.members[0][1], next(iter(values.values()))
        if (
            observed
            and not others
            and all(isinstance(value, int | float) for value in tried)
        ):
            options = {
                "varied": varied,
                "subject": start.id,
                "observed": observed,
                "week": sweep.week,
            }
            yield Figure(kind, _sweep_names(sweep), options=options)


paper_nearest_figure = nearest_figure


def calibration_figure(kind: Kind, study: Study) -> Iterator[Figure]:
    if study.calibration and (calibrate := study.config.calibrate):
        yield Figure(kind, options={"score": list(calibrate.score)})
