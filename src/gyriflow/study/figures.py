"""Figures and tables of a study: each kind with its function and text, and its input files."""

from collections.abc import Iterator
from typing import Any

from ..settings.terms import MAX_COLOURS, min_norm_subjects, run_names
from .comparison_figures import comparison_figures
from .paths import (
    BRAIN,
    ENSEMBLE,
    ENSEMBLE_MAPS,
    FOLDING,
    GROWTH,
    GROWTH_MAPS,
    GROWTH_SD,
    MESH,
    PARAMETERS,
    PUBLISHED,
    REGIONS,
    STUDY,
    TARGETS,
)
from .records import Brain, Simulation
from .registry import (
    RUN_FIGURES,
    STUDY_FIGURES,
    THREE_SIDES,
    Arguments,
    Figure,
    Kind,
    halves_of,
    observed_by_week,
    observed_name,
    regions_of,
    surfaces_by_week,
)
from .study import Study

BRAIN_FIGURES = f"{BRAIN}/figures"
ZONES = {"contact", "no_growth", "support"}
"""Settings that determine the zones of a run. Runs with equal ones share a figure of the zones."""
MAX_SERIES = 4


def figures_of(study: Study) -> list[Figure]:
    """Return the figures and tables of a study, in the order of the report."""
    return [
        *_brain_figures(study),
        *_growth_figures(study),
        *_folding_figures(study),
        *_metric_figures(study),
        *_region_figures(study),
        *comparison_figures(study),
        Figure(RESOURCES),
    ]


# brains


def _brain_figures(study: Study) -> Iterator[Figure]:
    for brain in study.brains.values():
        names = {"brain": brain.id}
        yield from (Figure(kind, names=names) for kind in (QUALITY, SMALL, BRAIN_MAPS))
        if brain.has_regions:
            yield Figure(BRAIN_REGIONS, {"brains": {brain.id: regions_of(brain.measurement)}}, names=names)
    yield inputs_figure(study)
    if study.starts:
        yield mesh_quality(study)


# these three are drawn by the rule `brain_figures`
QUALITY = Kind(
    "quality_page",
    f"{BRAIN_FIGURES}/quality.png",
    section="Inputs",
    title="Quality of the brain",
    caption=(
        "Quality of *{brain}*: (a) outlines of the pial surface and of the inner border of the cortex on the image or "
        "the labels, (b) the surface from several sides, (c) cortical thickness, or more views where it is unknown, "
        "and the warnings."
    ),
    target="quality",
)
SMALL = Kind("small_pictures", f"{BRAIN_FIGURES}/small.png", target="small")
BRAIN_MAPS = Kind(
    "brain_maps",
    f"{BRAIN_FIGURES}/shape_index.png",
    section="Metrics",
    title="Shape index",
    caption="Shape index: −½ is a valley (sulci, blue), +½ a ridge (gyri, red), −1 a cup, +1 a cap.",
    target="brain",
)
BRAIN_REGIONS = Kind(
    "brain_regions",
    f"{BRAIN_FIGURES}/regions.png",
    "pictures:regions_picture",
    section="Metrics",
    title="Regions of the cortex",
    caption=(
        "Regions of the cortex, given on this brain or carried to it by registration. Metrics by region are in "
        "``results/study/regions.csv``."
    ),
    target="brain",
)

INPUTS = Kind("inputs_figure", f"{STUDY_FIGURES}/inputs.png", "pictures:runs_by_week", target="", paper=True)


def inputs_figure(study: Study) -> Figure:
    """Return the picture of the first and the last brain of a study."""
    ends = dict.fromkeys(pick(study.brains.values(), key=lambda brain: brain.week) for pick in (min, max))
    inputs: Arguments = {"runs": {}, "observed": {f"{brain.id}\n{brain.week:g} GW": brain.pial for brain in ends}}
    return Figure(INPUTS, inputs, {"views": THREE_SIDES, "observed_name": ""})


MESH_QUALITY = Kind(
    "mesh_quality",
    f"{STUDY}/mesh_quality.html",
    "tables:mesh_quality_table",
    section="Inputs",
    title="Mesh quality",
    caption=(
        "Radius ratio (3 × inscribed / circumscribed radius, 1 for a regular element), dihedral angles and volume of "
        "the tetrahedra, the distance of the mesh from the pial surface, and how much of gaps narrower than 3 mm, such "
        "as the fissure, is open, with the limits of the configuration."
    ),
    technical=True,
    job="html_tables",
)


def mesh_quality(study: Study) -> Figure:
    quality = {start.id: MESH["quality"].format(brain=start.id) for start in study.starts}
    return Figure(MESH_QUALITY, {"quality": quality}, {"gates": study.config.mesh.gates})


# growth


def _growth_figures(study: Study) -> Iterator[Figure]:
    # for many subjects without simulations, charts of metrics and change.csv show growth; here each would need a panel
    if study.growth_brains and (len(study.series.brains) <= MAX_SERIES or study.run_simulations):
        yield growth_figure(study)
    for start in dict.fromkeys(run.start for run in study.run_simulations if run.shapes == "atlas"):
        yield Figure(ATLAS_AGES, {"ages": TARGETS.format(brain=start.id, origin="atlas")}, names={"brain": start.id})


ATLAS_AGES = Kind(
    "atlas_ages",
    f"{BRAIN}/atlas_ages.html",
    "tables:atlas_ages_table",
    section="Growth",
    title="Ages of the atlas' brains by size",
    caption=(
        "The atlas whose growth *{brain}* follows, by stated week: volume of its brain, the smooth curve through all "
        "its brains, and the week at which the curve has the brain's volume. The prediction uses each brain's shape at "
        "its age by size, and the curve's volume."
    ),
)
GROWTH_RATES = Kind(
    "growth_figure",
    f"{STUDY}/growth/growth.png",
    "growth:growth_chart",
    section="Growth",
    title="Cortical growth rates",
    caption=(
        "Pial area (a; both hemispheres, without the cut at the midline, with the caps of open medial walls) and brain "
        "volume (b) of the observed brains, "
        "and the tangential growth rate between successive weeks of a series, α = (√θ − 1)/Δt, where θ is the ratio of "
        "the areas. Dashed: the growth rate of the simulations. A series has rates if it is of one subject or of an "
        "atlas, or if a run uses it: other brains may be different fetuses, whose differences are not growth."
    ),
    target="growth",
    paper=True,
)


def growth_figure(study: Study) -> Figure:
    # runs that follow sizes or shapes have no given rate
    settings = [simulation.settings for simulation in study.simulations.values()]
    grown = [run for run in settings if "growth_rate_per_s" in run.growth.definition.rates]
    rate: Any = grown[0].growth_rate_per_s if grown else None
    if any(run.growth_rate_per_s != rate for run in grown):
        rate = None
    elif grown and not isinstance(rate, float):
        rate = dict(rate.weeks or {}) if rate.map is None else None
    options = {"observed_name": observed_name(brain for _, brain in study.growth_brains), "folding_rate_per_s": rate}
    return Figure(GROWTH_RATES, GROWTH, options)


# folding


def _folding_figures(study: Study) -> Iterator[Figure]:
    if study.prediction is not None:
        yield predicted_figure(study.prediction, study.atlas_brain(study.prediction))
    for start in study.starts:
        simulations = [simulation for simulation in study.run_simulations if simulation.start is start]
        yield weekly_figure(start, simulations)
        yield outlines_figure(start, simulations)
        yield displacement_maps(start, simulations)
        yield shape_maps(start, simulations)
    zones = set()
    for simulation in study.with_ensemble:
        yield Figure(INTERVALS, {"ensemble": simulation.file(ENSEMBLE)}, names=simulation.names)
        if simulation.has_growth_maps:
            yield growth_found_figure(simulation, GROWTH_SPREAD, GROWTH_SD)
        yield spread_figure(simulation, POSITION_SPREAD, "position_sd_mm")
        yield spread_figure(simulation, SULCUS_PROBABILITY, "sulcus_probability")
    for simulation in study.run_simulations:
        if simulation.has_growth_maps:
            yield growth_found_figure(simulation)
            yield growth_found_figure(simulation, GROWTH_ACROSS, quantity="thickness_growth_percent_per_gw")
        if (zoned := repr((simulation.start.id, simulation.settings.model_dump(include=ZONES)))) not in zones:
            zones.add(zoned)
            inputs = {"regions": simulation.file(REGIONS["data"]), "params": simulation.file(PARAMETERS)}
            yield Figure(ZONES_OF_RUN, inputs, names=simulation.names)
        settings = simulation.settings
        if "growth_rate_per_s" in settings.growth.definition.rates and not simulation.maps:
            yield Figure(MODEL_OF_RUN, {"model": simulation.file(FOLDING["series"])}, names=simulation.names)
    if study.run_simulations:
        yield Figure(RUNS)
        table, runs = {"displacement": f"{STUDY}/displacement.csv"}, {"runs": run_names(study.pairs)}
        yield Figure(DISPLACEMENT, table, runs)
        yield Figure(PAPER_DISPLACEMENT, {**table, "published": PUBLISHED}, runs)


PREDICTED = Kind(
    "predicted_figure",
    f"{RUN_FIGURES}/predicted.png",
    "pictures:runs_by_week",
    section="Folding",
    title="Start, prediction and atlas",
    caption=(
        "The start brain as scanned, the brain that run *{run}* predicts (blue), and the own brain of the atlas whose "
        "growth it uses, at one scale."
    ),
)


def predicted_figure(simulation: Simulation, atlas_brain: Brain) -> Figure:
    start, predicted = simulation.start, f"predicted\n{simulation.weeks[-1]:g} GW"
    brains = {f"start\n{start.week:g} GW": start.pial, predicted: simulation.measurements[-1].parts["whole"]}
    brains[f"atlas' own brain\n{atlas_brain.week:g} GW"] = atlas_brain.pial
    options: Arguments = {"views": THREE_SIDES, "observed_name": "", "predicted": predicted}
    return Figure(PREDICTED, {"runs": {}, "observed": brains}, options, simulation.names)


WEEKLY = Kind(
    "weekly_figure",
    f"{STUDY_FIGURES}/weekly.{{brain}}.png",
    "pictures:runs_by_week",
    section="Folding",
    title="Simulated and observed brains",
    caption=(
        "Runs from *{brain}* (blue) above the observed brains of the same weeks (beige), from the left and from above, "
        "at one scale. The first week is the meshed start brain. Differences between the runs are in "
        "``results/study/runs.csv``."
    ),
    paper=True,
    job="folding_figures",
)


def weekly_figure(start: Brain, simulations: list[Simulation]) -> Figure:
    observed = observed_by_week(*simulations)
    inputs: Arguments = {
        "runs": {simulation.run: surfaces_by_week(simulation) for simulation in simulations},
        "observed": {week: brain.pial for week, brain in observed.items()},
    }
    return Figure(WEEKLY, inputs, {"observed_name": observed_name(observed.values())}, {"brain": start.id})


OUTLINES = Kind(
    "outlines_figure",
    f"{STUDY_FIGURES}/outlines.{{brain}}.png",
    "sections:outlines_chart",
    section="Folding",
    title="Outlines of simulated and observed brains",
    caption=(
        "Outlines of the simulated brains and of the observed brain of the same week (black), rigidly aligned: coronal "
        "(a) and axial sections (b) through the middle, sagittal sections (c) through the right hemisphere."
    ),
    paper=True,
    job="folding_figures",
)


def outlines_figure(start: Brain, simulations: list[Simulation]) -> Figure:
    observed = observed_by_week(*simulations)
    inputs: Arguments = {"observed": {week: brain.pial for week, brain in observed.items()}, "runs": {}}
    for simulation in simulations:
        surfaces = surfaces_by_week(simulation)
        inputs["runs"][simulation.run] = {week: surfaces[week] for week in observed_by_week(simulation)}
    return Figure(OUTLINES, inputs, {"observed_name": observed_name(observed.values())}, {"brain": start.id})


DISPLACEMENT_MAPS = Kind(
    "displacement_maps",
    f"{STUDY_FIGURES}/displacement_maps.{{brain}}.png",
    "pictures:displacement_maps",
    section="Folding",
    title="Displacement maps",
    caption=(
        "Magnitude of the displacement between output weeks on the pial surface, on one scale for all runs; 0.5 % of "
        "the vertices are above the scale. Ring: the largest displacement, dotted if it is on the far side, and its "
        "position in RAS+ mm. The mean is over the vertices."
    ),
    paper=True,
    job="folding_figures",
)


def displacement_maps(start: Brain, simulations: list[Simulation]) -> Figure:
    frames = {simulation.run: simulation.file(FOLDING["frames"]) for simulation in simulations}
    return Figure(DISPLACEMENT_MAPS, {"frames": frames}, names={"brain": start.id})


SHAPE_MAPS = Kind(
    "shape_maps",
    f"{STUDY_FIGURES}/shape_index.{{brain}}.png",
    "pictures:shape_maps",
    section="Metrics",
    title="Maps of the shape index",
    caption=(
        "Shape index on the pial surfaces of the runs and of the observed brains of the same weeks: −½ is a valley "
        "(sulci, blue), +½ a ridge (gyri, red), −1 a cup, +1 a cap."
    ),
)


def shape_maps(start: Brain, simulations: list[Simulation]) -> Figure:
    observed = observed_by_week(*simulations)
    brains = {
        simulation.run: {row.week: halves_of(row) for row in simulation.measurements} for simulation in simulations
    }
    brains[observed_name(observed.values())] = {week: halves_of(brain.measurement) for week, brain in observed.items()}
    return Figure(SHAPE_MAPS, {"brains": brains}, {"quantity": "shape_index"}, {"brain": start.id})


GROWTH_FOUND = Kind(
    "growth_found_figure",
    f"{RUN_FIGURES}/growth_found.png",
    "pictures:growth_maps",
    section="Folding",
    title="Growth towards the target shapes",
    caption=(
        "Growth in area along the pial surface by which run *{run}* approaches its target shapes from week to week, on "
        "the surface at the end of the interval. Lines: direction of largest growth along the surface, longer where it "
        "exceeds the growth across it by more. The maps are in ``surfaces/growth.shape.gii`` of the run."
    ),
    job="growth_found_figures",
)
GROWTH_ACROSS = Kind(
    "growth_across_figure",
    f"{RUN_FIGURES}/growth_across.png",
    "pictures:growth_maps",
    section="Folding",
    title="Growth across the surface",
    caption=(
        "Growth along the normal of the pial surface, by which run *{run}* approaches its target shapes from week to "
        "week: positive where tissue becomes thicker by growth."
    ),
    job="growth_found_figures",
)


GROWTH_SPREAD = Kind(
    "growth_sd_figure",
    f"{RUN_FIGURES}/growth_sd.png",
    "pictures:growth_maps",
    section="Folding",
    title="Standard deviation of growth in the ensemble",
    caption=(
        "Standard deviation of the growth in area over the members of the ensemble of run *{run}*: its repeat error "
        "if the run follows its own later brains. The maps are in ``surfaces/growth_sd.shape.gii`` of the run."
    ),
)


def growth_found_figure(
    simulation: Simulation, kind: Kind = GROWTH_FOUND, maps: str = GROWTH_MAPS, **options: str
) -> Figure:
    inputs = {"frames": simulation.file(FOLDING["frames"]), "growth": simulation.file(maps)}
    return Figure(kind, inputs, {"views": THREE_SIDES, **options}, simulation.names)


INTERVALS = Kind(
    "intervals_figure",
    f"{RUN_FIGURES}/intervals.png",
    "charts:intervals_chart",
    section="Folding",
    title="Intervals of the ensemble",
    caption=(
        "Run *{run}* (line) and the interval for one further member of its ensemble, of 90 % (band). Members "
        "differ in registrations, in labels and, for predictions, in age, atlas and persistence of individual "
        "differences. Stars: observed brains. Bands of predictions include the largest error of such predictions in "
        "tests, and contain as many brains as `ensemble.csv` says (`coverage`), at most."
    ),
)
POSITION_SPREAD = Kind(
    "position_spread_figure",
    f"{RUN_FIGURES}/position_sd.png",
    "pictures:shape_maps",
    section="Folding",
    title="Standard deviation of positions in the ensemble",
    caption="Standard deviation of the position of each vertex over the members of the ensemble of run *{run}*.",
    job="ensemble_figures",
)
SULCUS_PROBABILITY = Kind(
    "sulcus_probability_figure",
    f"{RUN_FIGURES}/sulcus_probability.png",
    "pictures:shape_maps",
    section="Folding",
    title="Probability of a sulcus",
    caption=(
        "Share of run *{run}* and the members of its ensemble in which a vertex is in a sulcus (shape index at most "
        "−⅜)."
    ),
    job="ensemble_figures",
)


def spread_figure(simulation: Simulation, kind: Kind, quantity: str) -> Figure:
    weeks = {}
    for row in simulation.measurements[1:]:
        maps = [simulation.file(ENSEMBLE_MAPS, week=row.week, side=side) for side in row.sides]
        weeks[row.week] = [list(pair) for pair in zip(row.hemispheres, maps, strict=True)]
    return Figure(kind, {"brains": {simulation.run: weeks}}, {"quantity": quantity}, simulation.names)


ZONES_OF_RUN = Kind("zones_figure", f"{RUN_FIGURES}/zones.png", "pictures:zones_picture", target="", paper=True)
MODEL_OF_RUN = Kind("model_figure", f"{RUN_FIGURES}/model.png", "sections:model_sections", target="", paper=True)
RUNS = Kind(
    "run_tables",
    f"{STUDY}/runs.html",
    section="Folding",
    title="Parameters of the runs",
    caption=(
        "Parameters that differ between the runs come first, then shared ones. All parameters are in "
        "``results/study/runs.csv``."
    ),
    technical=True,
    target="metrics",
    paper=True,
)
DISPLACEMENT = Kind(
    "displacement_figure",
    f"{STUDY_FIGURES}/displacement.png",
    "growth:displacement_chart",
    section="Folding",
    title="Displacement per week",
    caption="Largest (a) and mean (b) displacement between output weeks over all nodes, per week.",
)
PAPER_DISPLACEMENT = Kind(
    "paper_displacement_figure",
    f"{STUDY_FIGURES}/displacement_paper.png",
    "growth:displacement_chart",
    target="",
    paper=True,
)

# metrics


def _metric_figures(study: Study) -> Iterator[Figure]:
    metrics, spectra = {"metrics": f"{STUDY}/metrics.csv"}, {"spectra": f"{STUDY}/spectra.csv"}
    options = _chart_options(study)
    yield Figure(METRICS, metrics, options)
    if study.run_simulations:
        yield Figure(METRICS_TABLE, metrics, {"observed_name": observed_name(study.brains.values())})
    yield Figure(SPECTRA, spectra, options)
    reference = study.norm_reference
    needed = min_norm_subjects(individuals=study.are_individuals(reference))
    if study.config.metrics.norms or len({study.brains[brain].subject for brain in reference}) >= needed:
        yield norms_figure(study, options)


def _chart_options(study: Study) -> Arguments:
    """Return the names and groups of brains in charts over the weeks."""
    brains, groups = study.brains.values(), _groups(study)
    return {
        "runs": run_names(study.pairs),
        "observed_name": observed_name([brain for brain in brains if brain.id not in groups] or brains),
        "subjects": {brain.id: brain.subject for brain in brains if brain.config.subject is not None},
        "groups": groups,
    }


def _groups(study: Study) -> dict[str, str]:
    """Return the group of each observed brain, its value of the covariate that colours show."""
    brains, colour_by = study.brains.values(), study.config.metrics.colour_by
    covariates = dict.fromkeys(name for brain in brains for name in brain.config.covariates)
    for name in [colour_by] if colour_by else covariates:
        values = {brain.id: of[name] for brain in brains if name in (of := brain.config.covariates)}
        subjects = {study.brains[brain].subject for brain in values}
        if 1 < len(set(values.values())) <= MAX_COLOURS and (colour_by or len(set(values.values())) < len(subjects)):
            return {brain: f"{name}: {value}" for brain, value in values.items()}
    return {}


METRICS = Kind(
    "metrics_figure",
    f"{STUDY_FIGURES}/metrics.png",
    "charts:metrics_chart",
    section="Metrics",
    title="Metrics over the weeks",
    caption=(
        "Lines are runs, marks are observed brains; scans of one subject are joined. The gyrification index is the "
        "pial area over that of the convex hulls of the hemispheres, or of tighter envelopes. The cut at the midline "
        "is excluded from both areas, so a smooth brain may have an index a few per cent below 1. Shape index: −1 is a "
        "cup, −½ a valley, +½ a ridge, +1 a cap."
    ),
    job="metrics_charts",
)
METRICS_TABLE = Kind(
    "metrics_table",
    f"{STUDY}/metrics_table.html",
    "tables:metrics_table",
    section="Metrics",
    title="Metrics, table",
    caption=(
        "The observed brain, each run, and the run's difference from the observed brain. Curvature of folds shorter "
        "than the curvature wavelength is flattened, and with it the mean curvature norm. All weeks, and the "
        "hemispheres, are in ``results/study/metrics.csv``."
    ),
    job="html_tables",
)
SPECTRA = Kind(
    "spectra_figure",
    f"{STUDY_FIGURES}/spectra.png",
    "charts:spectra_weeks_chart",
    section="Metrics",
    title="SpAnGy bands of folds over the weeks",
    caption=(
        "Relative power in the bands B4, B5 and B6 (primary, secondary and tertiary folds), as far as the spectra "
        "reach, per hemisphere (SpAnGy of the mean curvature, Germanaud et al. 2012). Open marks: the band is cut off, "
        "or finer than the edges and the curvature radius resolve."
    ),
    job="metrics_charts",
)
NORMS = Kind(
    "norms_figure",
    f"{STUDY_FIGURES}/norms.png",
    "charts:norms_chart",
    section="Metrics",
    title="Norms over the weeks",
    caption=(
        "Metrics of whole brains over the weeks, and the norm: the median (line) and the bands between the centiles 5 "
        "and 95, 25 and 75, by week (LMS method; of fewer than 30 subjects a quadratic with one relative scatter; of "
        "fewer than 10 none). Sex and site are ignored. If the norm has one average brain a week, the spread of "
        "individuals is unknown: there is no band, and brains have a difference from the curve in % instead of a "
        "centile and z. Brains with other hemispheres than those of the norm are not compared and not drawn."
    ),
    job="metrics_charts",
)


def norms_figure(study: Study, options: Arguments) -> Figure:
    reference = [study.brains[brain] for brain in study.norm_reference]
    tables = {"metrics": f"{STUDY}/metrics.csv", "curves": f"{STUDY}/norm_curves.csv"}
    comparable = [brain.id for brain in study.brains.values() if brain.sides == reference[0].sides]
    # norms of another study have no brains here
    own = [] if study.config.metrics.norms else study.norm_reference
    arguments = {"observed_name": observed_name(reference), "reference": own, "brains": comparable}
    return Figure(NORMS, tables, options | arguments)


def _region_figures(study: Study) -> Iterator[Figure]:
    brains = [brain for brain in study.brains.values() if brain.has_regions]
    if not brains:
        return
    tables = {"regions": f"{STUDY}/regions.csv", "asymmetry": f"{STUDY}/asymmetry.csv"}
    yield Figure(REGIONS_CHART, tables, {"observed_name": observed_name(brains)})
    simulated = {
        f"{name}, {simulation.weeks[-1]:g} GW": simulation.measurements[-1]
        for simulation, name in zip(study.run_simulations, run_names(study.pairs), strict=True)
        if simulation.has_regions
    }
    if simulated:
        rows = {brain.id: brain.measurement for brain in brains} | simulated
        yield Figure(REGIONS_FIGURE, {"brains": {heading: regions_of(row) for heading, row in rows.items()}})


REGIONS_CAPTION = (
    "Regions of the cortex, given on a brain (named sulci: on one of the spina bifida atlas), carried to other "
    "observed brains by registration, and to simulated ones with the tissue. Metrics by region: areas are sums of both "
    r"sides, other values means by area; the asymmetry index is 2 (left − right)/(\|left\| + \|right\|)."
)
REGIONS_CHART = Kind(
    "regions_chart",
    f"{STUDY_FIGURES}/regions_metrics.png",
    "charts:regions_chart",
    section="Metrics",
    title="Metrics by region",
    caption=REGIONS_CAPTION,
)
REGIONS_FIGURE = Kind(
    "regions_figure",
    f"{STUDY_FIGURES}/regions.png",
    "pictures:regions_picture",
    section="Metrics",
    title="Regions of the cortex",
    caption=REGIONS_CAPTION,
)

# the report

RESOURCES = Kind(
    "study_resources",
    f"{STUDY}/resources.html",
    section="Resources",
    title="Time, memory, energy and emissions",
    caption=(
        "Resources of the jobs of this study. Energy is estimated as core hours × ``costs.core_power_w``, emissions as "
        "energy × ``costs.carbon_g_per_kwh``. The numbers are in ``results/study/resources.csv``."
    ),
    technical=True,
    target="report",
)
