"""The figures and tables of a study: their brains and runs, and the inputs and options
that depend on these.

`FIGURES` has a function for entries of `workflow/figures.yaml`, which has the text and
the other inputs and options. An entry without a function is drawn for each of the
records that it names, or once.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

from ..settings.terms import MAX_COLOURS, min_norm_subjects, run_names
from .paths import DEVIATION, ENSEMBLE_MAPS, FOLDING, MESH
from .records import Brain, Measurement, Simulation, Sweep
from .registry import (
    Arguments,
    Drawing,
    Figure,
    Kind,
    figure_of,
    kinds,
    observed_name,
)
from .study import Study

ZONES = {"contact", "no_growth", "support"}
"""Settings that determine the zones of a run. Runs with equal ones share a figure of
the zones."""
MAX_SERIES = 4
MAX_DEVIATIONS = 4
"""Weeks for which the deviation from the expected brain is shown."""
Drawings = Iterator[Drawing]

EACH: Mapping[str, Callable[[Study], Iterable[Any]]] = {
    "study": lambda study: [study],
    "brains": lambda study: study.brains.values(),
    "runs": lambda study: study.run_simulations,
    "ensembles": lambda study: study.with_ensemble,
}
"""Records that have a figure each, by the key `each` of an entry."""


def figures_of(study: Study) -> list[Figure]:
    """Return the figures and tables of a study, in the order of the report."""
    figures = []
    for name, kind in kinds().items():
        if name in FIGURES:
            drawings = FIGURES[name](study)
        else:
            drawings = _drawing_of_each(kind, study)
        figures += [figure_of(kind, drawing) for drawing in drawings]
    return figures


def _drawing_of_each(kind: Kind, study: Study) -> Drawings:
    for record in EACH[kind.each](study):
        if kind.needs and not getattr(record, kind.needs):
            continue
        if isinstance(record, Study):
            yield Drawing()
        else:
            yield Drawing(record.names)


# brains


def _brain_regions(study: Study) -> Drawings:
    for brain in study.brains.values():
        if brain.has_regions:
            inputs = {"brains": {brain.id: brain.measurement.halves_with_regions}}
            yield Drawing(brain.names, inputs)


def _first_and_last_brain(study: Study) -> Drawings:
    brains = study.brains.values()
    first = min(brains, key=lambda brain: brain.week)
    last = max(brains, key=lambda brain: brain.week)
    observed = {}
    for brain in (first, last):
        observed[f"{brain.id}\n{brain.week:g} GW"] = brain.pial
    yield Drawing(inputs={"runs": {}, "observed": observed})


def _mesh_quality(study: Study) -> Drawings:
    quality = {
        start.id: MESH["quality"].format(brain=start.id) for start in study.starts
    }
    if quality:
        options = {"gates": study.config.mesh.gates}
        yield Drawing(inputs={"quality": quality}, options=options)


# growth


def _growth_figure(study: Study) -> Drawings:
    # for many subjects without simulations, charts of metrics and change.csv show
    # growth; here each would need a panel
    has_many = len(study.series.brains) > MAX_SERIES
    if not study.growth_brains or (has_many and not study.run_simulations):
        return
    options = {
        "observed_name": observed_name(brain for _, brain in study.growth_brains),
        "folding_rate_per_s": _common_growth_rate(study),
    }
    yield Drawing(options=options)


def _common_growth_rate(study: Study) -> float | dict[float, float] | None:
    """Return the growth rate or its curve, if all runs that have one share it."""
    rates = []
    for simulation in study.simulations.values():
        # runs that follow sizes or shapes have no given rate
        if simulation.has_growth_rate:
            rates.append(simulation.settings.growth_rate_per_s)
    if not rates or any(rate != rates[0] for rate in rates):
        return None
    rate = rates[0]
    if isinstance(rate, float):
        return rate
    return dict(rate.weeks or {}) if rate.map is None else None


def _atlas_ages(study: Study) -> Drawings:
    starts = {}
    for simulation in study.run_simulations:
        if simulation.shapes == "atlas":
            starts[simulation.start.id] = simulation.start
    for start in starts.values():
        yield Drawing(start.names)


# runs


def _predicted_figure(study: Study) -> Drawings:
    simulation = study.prediction
    if simulation is None:
        return
    start = simulation.start
    atlas_brain = study.atlas_brain(simulation)
    predicted = f"predicted\n{simulation.weeks[-1]:g} GW"
    brains = {
        f"start\n{start.week:g} GW": start.pial,
        predicted: simulation.measurements[-1].parts["whole"],
        f"atlas' own brain\n{atlas_brain.week:g} GW": atlas_brain.pial,
    }
    inputs = {"runs": {}, "observed": brains}
    yield Drawing(simulation.names, inputs, {"predicted": predicted})


def _by_start(
    study: Study,
) -> Iterator[tuple[dict[str, str], list[Simulation], dict[float, Brain]]]:
    """Yield for each start brain its name, its simulations, and by week the observed
    brains shown with them."""
    for start in study.starts:
        simulations = []
        observed: dict[float, Brain] = {}
        for simulation in study.run_simulations:
            if simulation.start is start:
                simulations.append(simulation)
                observed |= simulation.observed_with_start
        yield start.names, simulations, observed


def _surfaces(brains: Mapping[float, Brain]) -> dict[float, str]:
    return {week: brain.pial for week, brain in brains.items()}


def _weekly_figure(study: Study) -> Drawings:
    for names, simulations, observed in _by_start(study):
        runs = {simulation.run: simulation.surfaces for simulation in simulations}
        inputs = {"runs": runs, "observed": _surfaces(observed)}
        options = {"observed_name": observed_name(observed.values())}
        yield Drawing(names, inputs, options)


def _outlines_figure(study: Study) -> Drawings:
    for names, simulations, observed in _by_start(study):
        runs = {}
        for simulation in simulations:
            surfaces = simulation.surfaces
            runs[simulation.run] = {
                week: surfaces[week] for week in simulation.observed_with_start
            }
        inputs = {"observed": _surfaces(observed), "runs": runs}
        options = {"observed_name": observed_name(observed.values())}
        yield Drawing(names, inputs, options)


def _displacement_maps(study: Study) -> Drawings:
    for names, simulations, _ in _by_start(study):
        frames = {
            simulation.run: simulation.file(FOLDING["frames"])
            for simulation in simulations
        }
        yield Drawing(names, {"frames": frames})


def _shape_maps(study: Study) -> Drawings:
    for names, simulations, observed in _by_start(study):
        brains = {}
        for simulation in simulations:
            rows = simulation.measurements
            brains[simulation.run] = {row.week: row.halves for row in rows}
        brains[observed_name(observed.values())] = {
            week: brain.measurement.halves for week, brain in observed.items()
        }
        yield Drawing(names, {"brains": brains})


def _ensemble_maps(study: Study) -> Drawings:
    for simulation in study.with_ensemble:
        weeks = {}
        for row in simulation.measurements[1:]:
            weeks[row.week] = [
                [
                    row.parts[side],
                    simulation.file(ENSEMBLE_MAPS, week=row.week, side=side),
                ]
                for side in row.sides
            ]
        yield Drawing(simulation.names, {"brains": {simulation.run: weeks}})


def _zones_figure(study: Study) -> Drawings:
    shown = []
    for simulation in study.run_simulations:
        zones = simulation.settings.model_dump(include=ZONES)
        if (simulation.start, zones) not in shown:
            shown.append((simulation.start, zones))
            yield Drawing(simulation.names)


def _model_figure(study: Study) -> Drawings:
    for simulation in study.run_simulations:
        if simulation.has_growth_rate and not simulation.maps:
            yield Drawing(simulation.names)


def _displacement_figure(study: Study) -> Drawings:
    if study.run_simulations:
        yield Drawing(options={"runs": run_names(study.pairs)})


# metrics


def _metrics_figure(study: Study) -> Drawings:
    yield Drawing(options=_chart_options(study))


def _chart_options(study: Study) -> dict[str, Any]:
    """Return the names and groups of brains in charts over the weeks."""
    groups = _groups(study)
    subjects = {}
    ungrouped = []
    for brain in study.brains.values():
        if brain.config.subject is not None:
            subjects[brain.id] = brain.subject
        if brain.id not in groups:
            ungrouped.append(brain)
    return {
        "runs": run_names(study.pairs),
        "observed_name": observed_name(ungrouped or study.brains.values()),
        "subjects": subjects,
        "groups": groups,
    }


def _groups(study: Study) -> dict[str, str]:
    """Return the group of each observed brain: its value of the covariate that colours
    show.

    That is the first covariate with 2 to `MAX_COLOURS` values and fewer values than
    subjects.
    """
    brains: dict[str, list[Brain]] = {}
    for brain in study.brains.values():
        for name in brain.config.covariates:
            brains.setdefault(name, []).append(brain)
    for name, with_value in brains.items():
        groups = {}
        for brain in with_value:
            groups[brain.id] = f"{name}: {brain.config.covariates[name]}"
        n_groups = len(set(groups.values()))
        n_subjects = len({brain.subject for brain in with_value})
        if 1 < n_groups <= MAX_COLOURS and n_groups < n_subjects:
            return groups
    return {}


def _metrics_table(study: Study) -> Drawings:
    if study.run_simulations:
        name = observed_name(study.brains.values())
        yield Drawing(options={"observed_name": name})


def _norms_figure(study: Study) -> Drawings:
    reference = [study.brains[brain] for brain in study.norm_reference]
    subjects = {brain.subject for brain in reference}
    has_norms = study.config.metrics.norms is not None
    needed = min_norm_subjects(individuals=study.are_individuals(study.norm_reference))
    if not has_norms and len(subjects) < needed:
        return
    options = _chart_options(study) | {
        "observed_name": observed_name(reference),
        # norms of another study have no brains here
        "reference": [] if has_norms else study.norm_reference,
        "brains": [
            brain.id
            for brain in study.brains.values()
            if brain.sides == reference[0].sides
        ],
    }
    yield Drawing(options=options)


def _regions_chart(study: Study) -> Drawings:
    brains = [brain for brain in study.brains.values() if brain.has_regions]
    if brains:
        yield Drawing(options={"observed_name": observed_name(brains)})


def _regions_figure(study: Study) -> Drawings:
    observed = {}
    for brain in study.brains.values():
        if brain.has_regions:
            observed[brain.id] = brain.measurement.halves_with_regions
    simulated = {}
    names = run_names(study.pairs)
    for simulation, name in zip(study.run_simulations, names, strict=True):
        if simulation.has_regions:
            last = simulation.measurements[-1]
            simulated[f"{name}, {last.week:g} GW"] = last.halves_with_regions
    if observed and simulated:
        yield Drawing(inputs={"brains": observed | simulated})


# runs compared with observed brains


def _validation_figure(study: Study) -> Drawings:
    if study.validated:
        yield Drawing(options={"runs": list(study.config.runs)})


def _prediction_figure(study: Study) -> Drawings:
    if study.predictions:
        yield Drawing(options={"runs": list(study.config.runs)})


def _deviations(simulation: Simulation) -> dict[float, list[str]]:
    """Return the expected surface and the maps of the observed brain's deviation from
    it, by week."""
    surfaces = simulation.surfaces
    return {
        week: [surfaces[week], simulation.file(DEVIATION["maps"], week=week)]
        for week in simulation.observed
    }


def _expected_figure(study: Study) -> Drawings:
    for simulation in study.atlas_predictions:
        surfaces = simulation.surfaces
        observed = simulation.observed_with_start
        deviations = _deviations(simulation)
        # the last week, and others at equal steps
        step = -(-len(deviations) // MAX_DEVIATIONS)
        weeks = sorted(deviations, reverse=True)[::step]
        drawn = {min(surfaces), *weeks}
        expected = {week: file for week, file in surfaces.items() if week in drawn}
        shown = {week: brain for week, brain in observed.items() if week in drawn}
        inputs = {
            "runs": {"expected": expected},
            "observed": _surfaces(shown),
            "deviations": {week: deviations[week] for week in weeks},
        }
        options = {"observed_name": observed_name(observed.values())}
        yield Drawing(simulation.names, inputs, options)


def _deviation_figure(study: Study) -> Drawings:
    for simulation in study.atlas_predictions:
        maps = {week: [files] for week, files in _deviations(simulation).items()}
        inputs = {"brains": {"observed minus expected": maps}}
        quantities = ["log_area"]
        if simulation.start.has_thickness:
            quantities.append("thickness_difference_mm")
        for quantity in quantities:
            options = {"quantity": quantity}
            yield Drawing(simulation.names | options, inputs, options)


# sweeps, which the configuration calls studies; figures show the runs from the start
# brain of the first run


def _members(sweep: Sweep) -> dict[str, Measurement]:
    """Return the simulated brains from this start at the week of comparison, by run."""
    return {
        simulation.run: simulation.at(sweep.week)
        for simulation, _ in sweep.members
        if simulation.start is sweep.first_start
    }


def _of_sweep(sweep: Sweep, inputs: Arguments, **options: Any) -> Drawing:
    """Return a figure of the runs of a sweep; runs may have ended before the week of
    comparison."""
    start = sweep.first_start
    options["values"] = {
        simulation.run: dict(values)
        for simulation, values in sweep.members
        if simulation.start is start
    }
    options["observed_name"] = observed_name(sweep.first_observed)
    return Drawing(sweep.names, inputs, options, (start.id, sweep.week))


def _influence_figure(study: Study) -> Drawings:
    for sweep in study.sweeps.values():
        members = {run: row.halves for run, row in _members(sweep).items()}
        observed = [brain.measurement.halves for brain in sweep.first_observed]
        inputs = {
            "members": members,
            "observed": observed[0] if observed else None,
        }
        yield _of_sweep(sweep, inputs)


def _influence_spectra(study: Study) -> Drawings:
    for sweep in study.sweeps.values():
        rows = [brain.measurement for brain in sweep.first_observed]
        inputs = {
            "members": {run: row.spectra for run, row in _members(sweep).items()},
            "observed": [row.spectra for row in rows],
        }
        yield _of_sweep(sweep, inputs, week=sweep.week)


def _nearest_figure(study: Study) -> Drawings:
    for sweep in study.sweeps.values():
        vary = study.config.studies[sweep.name].vary
        varied, values = next(iter(vary.items()))
        are_numbers = all(isinstance(value, int | float) for value in values)
        if sweep.first_observed and len(vary) == 1 and are_numbers:
            options = {
                "varied": varied,
                "subject": sweep.first_start.id,
                "observed": [brain.id for brain in sweep.first_observed],
                "week": sweep.week,
            }
            yield Drawing(sweep.names, options=options)


def _calibration_figure(study: Study) -> Drawings:
    settings = study.config.calibrate
    if study.calibration and settings:
        yield Drawing(options={"score": list(settings.score)})


FIGURES: Mapping[str, Callable[[Study], Drawings]] = {
    "brain_regions": _brain_regions,
    "inputs_figure": _first_and_last_brain,
    "mesh_quality": _mesh_quality,
    "growth_figure": _growth_figure,
    "atlas_ages": _atlas_ages,
    "predicted_figure": _predicted_figure,
    "weekly_figure": _weekly_figure,
    "outlines_figure": _outlines_figure,
    "displacement_maps": _displacement_maps,
    "shape_maps": _shape_maps,
    "position_spread_figure": _ensemble_maps,
    "sulcus_probability_figure": _ensemble_maps,
    "zones_figure": _zones_figure,
    "model_figure": _model_figure,
    "displacement_figure": _displacement_figure,
    "paper_displacement_figure": _displacement_figure,
    "metrics_figure": _metrics_figure,
    "spectra_figure": _metrics_figure,
    "metrics_table": _metrics_table,
    "norms_figure": _norms_figure,
    "regions_chart": _regions_chart,
    "regions_figure": _regions_figure,
    "validation_figure": _validation_figure,
    "prediction_figure": _prediction_figure,
    "expected_figure": _expected_figure,
    "deviation_figure": _deviation_figure,
    "influence_figure": _influence_figure,
    "influence_spectra": _influence_spectra,
    "nearest_figure": _nearest_figure,
    "paper_nearest_figure": _nearest_figure,
    "calibration_figure": _calibration_figure,
}
"""The functions that find the figures of an entry, by its name."""
