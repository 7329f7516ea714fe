"""Figures and tables of a study that compare runs with observed brains and with each other."""

from collections.abc import Iterator
from typing import Any

from .paths import CALIBRATION, DEVIATION, PUBLISHED, STUDY, SWEEP, file_of
from .records import Brain, Measurement, Simulation, Sweep
from .registry import (
    AROUND,
    RUN_FIGURES,
    STUDY_FIGURES,
    Arguments,
    Figure,
    Kind,
    halves_of,
    observed_by_week,
    observed_name,
    surfaces_by_week,
)
from .study import Study

SWEEP_FIGURES = f"{SWEEP}/figures"
MAX_DEVIATIONS = 4
"""Weeks for which the deviation from the expected brain is shown."""


def comparison_figures(study: Study) -> Iterator[Figure]:
    """Yield the figures of a study's validation, sweeps and calibration."""
    yield from _validation_figures(study)
    for sweep in study.sweeps.values():
        yield from _sweep_figures(study, sweep)
    if study.calibration and (calibrate := study.config.calibrate):
        tables = {name: f"{CALIBRATION}/{name}.csv" for name in ("runs", "optimum")}
        yield Figure(CALIBRATION_FIGURE, tables, {"score": list(calibrate.score)})


CALIBRATION_FIGURE = Kind(
    "calibration_figure", f"{CALIBRATION}/calibration.png", "scores:calibration_chart", target="calibrate"
)


def _validation_figures(study: Study) -> Iterator[Figure]:
    runs = {"runs": list(study.config.runs)}
    if study.validated:
        ceiling = f"{STUDY}/registration_ceiling.csv" if study.registered_starts else None
        yield Figure(VALIDATION, {"validation": f"{STUDY}/validation.csv", "ceiling": ceiling}, runs)
    if study.predictions:
        table = {"prediction": f"{STUDY}/prediction.csv"}
        yield Figure(PREDICTION, table, runs)
        yield Figure(PREDICTION_TABLE, table)
    for simulation in study.atlas_predictions:
        yield expected_figure(simulation)
        yield deviation_figure(simulation, "log_area")
        if simulation.start.has_thickness:
            yield deviation_figure(simulation, "thickness_difference_mm")
    if study.validated_registered:
        yield Figure(ONSET, {"onset": f"{STUDY}/onset.csv"}, runs)


VALIDATION = Kind(
    "validation_figure",
    f"{STUDY_FIGURES}/validation.png",
    "scores:validation_chart",
    section="Validation",
    title="Gain over no folding, by week",
    caption=(
        "Gain: the correlation r of the shape index (a) and of the mean curvature (b) with those of the observed "
        "brain, less the r of the scaled start brain. Above 0, the simulation places folds better than the scaled "
        "start. Stars: headroom, the gain of the observed brain of the week before. Bars: 95 % intervals of a "
        "bootstrap over the modes of this one brain's surface, not over subjects. Filled marks: explained weeks, whose "
        "observed brains gave the growth; open marks: predicted weeks. Dotted: the start carried to the observed brain "
        "by registration."
    ),
    target="validate",
    job="validation_charts",
)
PREDICTION = Kind(
    "prediction_figure",
    f"{STUDY_FIGURES}/prediction.png",
    "scores:prediction_chart",
    section="Validation",
    title="Predicted and observed brains",
    caption=(
        "Brains predicted with the growth of another population, by weeks after the start: correlation of their shape "
        "index with that of the observed brain, at one size, and mean distance between the surfaces, unscaled and "
        "rigidly aligned. Dashed: simpler predictions, without mechanics, and the target shape of the run."
    ),
    target="validate",
    job="validation_charts",
)
PREDICTION_TABLE = Kind(
    "prediction_table",
    f"{STUDY}/prediction.html",
    "tables:prediction_table",
    section="Validation",
    title="Predicted brains, table",
    caption=(
        "The same in numbers, unscaled except for r. Skill is 1 − distance / distance of the best simpler prediction "
        "of the week, with its 95 % interval (low, high): patches of one brain are resampled, not subjects. Roughness "
        "is relative to the observed surface. All columns are in ``results/study/prediction.csv``."
    ),
    target="validate",
)
EXPECTED = Kind(
    "expected_figure",
    f"{RUN_FIGURES}/expected.png",
    "pictures:runs_by_week",
    section="Validation",
    title="Start, expected and observed brains",
    caption=(
        "The start and the expected brains (blue) and the observed brains (beige), from the left and from above, at "
        "one scale. Below: how far the observed surface lies outside (red) or inside (blue) the expected one."
    ),
    target="validate",
)


def _deviations(simulation: Simulation) -> dict[float, list[str]]:
    """Return the expected surface and the maps of the observed brain's deviation from it, by week."""
    surfaces = surfaces_by_week(simulation)
    return {week: [surfaces[week], simulation.file(DEVIATION["maps"], week=week)] for week in simulation.observed}


def expected_figure(simulation: Simulation) -> Figure:
    surfaces, observed, deviations = surfaces_by_week(simulation), observed_by_week(simulation), _deviations(simulation)
    # the last week, and others at equal steps
    weeks = sorted(deviations, reverse=True)[:: -(-len(deviations) // MAX_DEVIATIONS)]
    weeks_drawn = {min(surfaces), *weeks}
    inputs: Arguments = {
        "runs": {"expected": {week: surface for week, surface in surfaces.items() if week in weeks_drawn}},
        "observed": {week: brain.pial for week, brain in observed.items() if week in weeks_drawn},
        "deviations": {week: deviations[week] for week in weeks},
    }
    return Figure(EXPECTED, inputs, {"observed_name": observed_name(observed.values())}, simulation.names)


DEVIATION_MAPS = Kind(
    "deviation_figure",
    f"{RUN_FIGURES}/deviation_{{quantity}}.png",
    "pictures:shape_maps",
    section="Validation",
    title="Deviation from the expected: {quantity}",
    caption=(
        "Deviation of observed brains from those that run *{run}* expects, on the expected surface: logarithm of "
        "observed over expected area, or observed minus expected thickness. Values by region, with z among the study's "
        "other brains, are in ``results/study/deviation_centiles.csv``."
    ),
    target="validate",
)


def deviation_figure(simulation: Simulation, quantity: str) -> Figure:
    maps = {week: [files] for week, files in _deviations(simulation).items()}
    options: Arguments = {"quantity": quantity, "views": AROUND}
    inputs: Arguments = {"brains": {"observed minus expected": maps}}
    return Figure(DEVIATION_MAPS, inputs, options, {**simulation.names, "quantity": quantity})


ONSET = Kind(
    "onset_figure",
    f"{STUDY_FIGURES}/onset.png",
    "scores:onset_chart",
    section="Validation",
    title="Onset of sulci",
    caption=(
        "Weeks in which the sulci of the last observed brain that are absent at the start become 2 mm deep, from the "
        "neighbouring crowns. Marks at the right edge: not within the simulated or observed weeks."
    ),
    target="validate",
    job="validation_charts",
)

# sweeps, which the configuration calls studies


def _sweep_figures(study: Study, sweep: Sweep) -> Iterator[Figure]:
    yield influence_figure(sweep)
    yield influence_spectra(sweep)
    vary = study.config.studies[sweep.name].vary
    if len(vary) == 1 and sweep.observed[_start(sweep).id]:
        (values,) = vary.values()
        if all(isinstance(value, int | float) for value in values):
            yield nearest_figure(NEAREST, sweep)
            yield nearest_figure(PAPER_NEAREST, sweep, published=PUBLISHED)


def _start(sweep: Sweep) -> Brain:
    """Return the start brain of the first run; figures show the runs from this brain."""
    return sweep.members[0][0].start


def _members(sweep: Sweep) -> dict[str, Measurement]:
    """Return the simulated brains from this start at the week of comparison, by run."""
    start = _start(sweep)
    return {simulation.run: simulation.at(sweep.week) for simulation, _ in sweep.members if simulation.start is start}


def _sweep_figure(kind: Kind, sweep: Sweep, inputs: Arguments, **options: Any) -> Figure:
    """Return a figure of the runs of a sweep; runs may have ended before the week of comparison."""
    start = _start(sweep)
    values = {simulation.run: dict(values) for simulation, values in sweep.members if simulation.start is start}
    may_end = tuple((run, start.id, sweep.week) for run in inputs["members"])
    arguments = {"values": values, "observed_name": observed_name(sweep.observed[start.id][:1]), **options}
    return Figure(kind, inputs, arguments, _sweep_names(sweep), may_end)


def _sweep_names(sweep: Sweep) -> dict[str, str]:
    return {"study": sweep.name, "week": f"{sweep.week:g}"}


INFLUENCE = Kind(
    "influence_figure",
    f"{SWEEP_FIGURES}/influence.png",
    "pictures:influence_picture",
    section="Studies",
    title="Influence on the folds",
    caption=(
        "Runs of the study *{study}* at {week} GW, with the observed brain last, from the left (a, c) and from above "
        "(b, d): surfaces, and the shape index, about −½ in sulci (blue) and +½ on gyri (red)."
    ),
    target="influence_figures",
    paper=True,
)


def influence_figure(sweep: Sweep) -> Figure:
    observed = sweep.observed[_start(sweep).id]
    inputs: Arguments = {
        "members": {run: halves_of(row) for run, row in _members(sweep).items()},
        "observed": halves_of(observed[0].measurement) if observed else None,
    }
    return _sweep_figure(INFLUENCE, sweep, inputs)


INFLUENCE_SPECTRA = Kind(
    "influence_spectra",
    f"{SWEEP_FIGURES}/spectra.png",
    "charts:influence_spectra",
    section="Studies",
    title="Influence on the spectrum of the folds",
    caption=(
        "Relative power in the bands B4 to B6 (primary to tertiary folds) of each hemisphere in the study *{study}* at "
        "{week} GW, by mean curvature and, below, by shape index (the FetalFoldSim paper's): runs from pale to dark in "
        "their order, the observed brain as stars. Hatched bars and open stars: the band is cut off or not resolved."
    ),
    target="influence_figures",
    paper=True,
)


def influence_spectra(sweep: Sweep) -> Figure:
    inputs: Arguments = {
        "members": {run: f"{row.folder}/spectra.csv" for run, row in _members(sweep).items()},
        "observed": [f"{brain.measurement.folder}/spectra.csv" for brain in sweep.observed[_start(sweep).id][:1]],
    }
    return _sweep_figure(INFLUENCE_SPECTRA, sweep, inputs, week=sweep.week)


NEAREST = Kind(
    "nearest_figure",
    f"{SWEEP_FIGURES}/nearest.png",
    "scores:nearest_chart",
    section="Studies",
    title="Distance from the observed brain",
    caption=(
        "Distance of the runs of the study *{study}* from the observed brain at {week} GW by each measure, over the "
        "varied parameter. Ring and number: the nearest run whose mesh resolves the cortex. Open marks: the mesh does "
        "not resolve the cortex, or the band is cut off."
    ),
    target="influence_figures",
)
PAPER_NEAREST = Kind(
    "paper_nearest_figure", f"{SWEEP_FIGURES}/nearest_paper.png", "scores:nearest_chart", target="", paper=True
)


def nearest_figure(kind: Kind, sweep: Sweep, **inputs: str) -> Figure:
    start, (varied,) = _start(sweep), sweep.members[0][1]
    observed = [brain.id for brain in sweep.observed[start.id][:1]]
    options = {"varied": varied, "subject": start.id, "observed": observed, "week": sweep.week}
    inputs["comparison"] = file_of(f"{SWEEP}/comparison.csv", study=sweep.name)
    return Figure(kind, inputs, options, _sweep_names(sweep))
