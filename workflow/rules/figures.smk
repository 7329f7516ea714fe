# Figures and tables of a study. The function that draws one has its name and is in `src/gyriflow/report/`.
#
# A rule draws one figure, or several from the same files, since Python takes 2 s to start: each of its outputs has the
# name of its figure. The function gets those of the rule's inputs and parameters that it has arguments for. Title and
# caption are in `workflow/report/captions/`, the place in the report is in `SECTIONS`.
from gyriflow.code_hash import code_hash
from gyriflow.settings.terms import run_names
from gyriflow.study.records import observed_name

# the figures and tables of the report by section, in its order
SECTIONS = {
    "Inputs": ["mesh_quality"],
    "Growth": ["growth_figure", "atlas_ages"],
    "Folding": [
        *("predicted_figure", "weekly_figure", "outlines_figure", "displacement_maps"),
        *("intervals_figure", "growth_sd_figure", "position_spread_figure", "sulcus_probability_figure"),
        *("growth_found_figure", "growth_across_figure", "run_tables", "displacement_figure"),
    ],
    "Metrics": [
        *("shape_maps", "metrics_figure", "metrics_table", "spectra_figure", "norms_figure"),
        *("regions_chart", "regions_figure"),
    ],
    "Validation": [
        *("validation_figure", "prediction_figure", "prediction_table"),
        *("expected_figure", "deviation_figure"),
    ],
    "Sweeps": ["influence_figure", "influence_spectra", "nearest_figure"],
    "Resources": ["study_resources"],
}
# those of the page of each brain
BRAIN_SECTIONS = {"Quality": ["quality_page"], "Metrics": ["brain_depth", "brain_maps", "brain_regions"]}
# the first of these that there is stands at the top of a page
IN_SUMMARY = ("predicted_figure", "weekly_figure", "brain_depth")
# collapsed in the report
TECHNICAL = ("mesh_quality", "run_tables", "study_resources")
# the files of each figure of this study, and the values of the wildcards in them, of each brain, run or sweep that has one
FIGURES = {}


def show(outputs, names=({},)):
    """Add the figures of a rule to those of the study; one of each without wildcards."""
    for figure, files in outputs.items():
        files = [files] if isinstance(files, str) else files
        # text, as the report's job gets it: files of Snakemake refer to their rules
        FIGURES[figure] = {"files": [str(file) for file in files], "names": list(names)}


def figure_files(*figures):
    """Return the files of figures, without those that this study does not have."""
    files = []
    for figure in [FIGURES[name] for name in figures if name in FIGURES]:
        for names in figure["names"]:
            files += [file.format(**names) for file in figure["files"]]
    return files


def drawn_by(*modules):
    """Return the modules of the report that have the functions of a rule, and the hash of their code."""
    script = Path(workflow.basedir, "workflow", "scripts", "figures.py")
    files = [Path(SOURCE, "gyriflow", "report", f"{module}.py") for module in modules]
    return {"modules": modules, "code": code_hash(script, *files)}


def names_of(records):
    """Return the names of brains, simulations or sweeps."""
    return [record.names for record in records]


def only(simulations):
    """Return the constraints of wildcards for the runs and start brains of some simulations."""
    names = names_of(simulations)
    return {key: one_of(dict.fromkeys(name[key] for name in names)) for key in ("run", "brain")}


def placed(row, column, surfaces, maps=(), simulated=False):
    """Return a brain of a grid: row, column (a week or a name), surfaces, and the maps or regions on each."""
    return {
        "row": row,
        "column": column,
        "surfaces": list(surfaces),
        "maps": list(maps),
        "simulated": simulated,
    }


def files_in_grid(grid):
    """Return all files of a grid."""
    return [file for brain in grid for file in (*brain["surfaces"], *brain["maps"])]


# brains: drawn by rule brain_figures in quality.smk

show(
    {"quality_page": [f"{BRAIN}/figures/quality.png", f"{BRAIN}/figures/quality.pdf"]},
    names_of(BRAINS.values()),
)
show(
    {"brain_depth": [f"{BRAIN}/figures/depth.png", f"{BRAIN}/figures/depth.pdf"]},
    names_of(BRAINS.values()),
)
show(
    {"brain_maps": [f"{BRAIN}/figures/shape_index.png", f"{BRAIN}/figures/shape_index.pdf"]},
    names_of(BRAINS.values()),
)
show(
    {"small_pictures": [f"{BRAIN}/figures/small.png", f"{BRAIN}/figures/small.pdf"]},
    names_of(BRAINS.values()),
)

WITH_REGIONS = [brain for brain in BRAINS.values() if brain.regions]


def brain_regions_grid(brain):
    return [placed("", brain.id, brain.hemispheres, brain.regions)]


rule brain_regions:
    input:
        grid=lambda w: files_in_grid(brain_regions_grid(BRAINS[w.brain])),
    output:
        brain_regions=multiext(f"{BRAIN}/figures/regions", ".png", ".pdf"),
    wildcard_constraints:
        brain=brains_where(lambda brain: brain.regions),
    params:
        **drawn_by("pictures"),
        grid=lambda w: brain_regions_grid(BRAINS[w.brain]),
    script:
        "../scripts/figures.py"


show(rules.brain_regions.output, names_of(WITH_REGIONS))


def first_and_last_grid():
    by_week = sorted(BRAINS.values(), key=lambda brain: brain.week)
    # of several brains of the last week, the first
    last = next(brain for brain in by_week if brain.week == by_week[-1].week)
    return [placed("", f"{brain.id}\n{brain.week:g} GW", [brain.pial]) for brain in (by_week[0], last)]


rule inputs_figure:
    input:
        grid=files_in_grid(first_and_last_grid()),
    output:
        inputs_figure=multiext(f"{STUDY}/figures/inputs", ".png", ".pdf"),
    params:
        **drawn_by("pictures"),
        grid=first_and_last_grid(),
    script:
        "../scripts/figures.py"


show(rules.inputs_figure.output)

if study.run_simulations:

    rule html_tables:
        input:
            quality=expand(MESH["quality"], brain=[start.id for start in study.starts]),
            metrics=f"{STUDY}/metrics.csv",
        output:
            mesh_quality=f"{STUDY}/mesh_quality.html",
            metrics_table=f"{STUDY}/metrics_table.html",
        params:
            **drawn_by("measures", "tables"),
            starts=[start.id for start in study.starts],
            gates=CONFIG.mesh.model_dump(include={"max_surface_distance_mm"}),
            observed_name=observed_name(BRAINS.values()),
        script:
            "../scripts/figures.py"

    show(rules.html_tables.output)


# growth

# for many subjects without simulations, charts of metrics and change.csv show growth; here each would need a panel
MAX_SERIES = 4
HAS_FEW_SERIES = len(study.series) <= MAX_SERIES


def common_growth_rate():
    """Return the growth rate by week, if all runs that have one share it."""
    # other growth models have no rate, or change it
    rates = [
        simulation.settings.growth_rate_per_s
        for simulation in study.simulations.values()
        if simulation.settings.growth.model == "rates"
    ]
    if not rates or any(rate != rates[0] for rate in rates):
        return None
    if isinstance(rates[0], float):
        return {0.0: rates[0]}
    return dict(rates[0].weeks or {}) if rates[0].map is None else None


# without rates, brains of different weeks are different fetuses, and the charts of metrics have their sizes
HAS_RATES = any(series.has_rates and len(series.brains) > 1 for series in study.series.values())

if study.growth_brains and (study.run_simulations or (HAS_RATES and HAS_FEW_SERIES)):

    rule growth_figure:
        input:
            **GROWTH,
        output:
            growth_figure=multiext(f"{STUDY}/growth/growth", ".png", ".pdf"),
        params:
            **drawn_by("growth"),
            observed_name=observed_name(brain for _, brain in study.growth_brains),
            folding_rate_per_s=common_growth_rate(),
        script:
            "../scripts/figures.py"

    show(rules.growth_figure.output)


# start brains of predictions by the growth of an atlas
BY_ATLAS = {
    simulation.brain for simulation in study.run_simulations if simulation.settings.growth.shapes == "atlas"
}
CARRIED = [start for start in study.starts if start.id in BY_ATLAS]


rule atlas_ages:
    input:
        ages=TARGETS.format(brain="{brain}", origin="atlas"),
    output:
        atlas_ages=f"{BRAIN}/atlas_ages.html",
    wildcard_constraints:
        brain=one_of(start.id for start in CARRIED),
    params:
        **drawn_by("tables"),
    script:
        "../scripts/figures.py"


show(rules.atlas_ages.output, names_of(CARRIED))

# runs


def predicted_grid(simulation):
    start = BRAINS[simulation.brain]
    predicted = study.rows_of(simulation)[-1]
    atlas_brain = study.atlas_brain(simulation)
    return [
        placed("", f"start\n{start.week:g} GW", [start.pial]),
        placed(
            "", f"predicted\n{predicted.week:g} GW", [study.measured_parts(predicted)["whole"]], simulated=True
        ),
        placed("", f"atlas' own brain\n{atlas_brain.week:g} GW", [atlas_brain.pial]),
    ]


# the study's only run, if it is a prediction
PREDICTIONS = [study.prediction] if study.prediction else []


rule predicted_figure:
    input:
        grid=lambda w: files_in_grid(predicted_grid(simulation_of(w))),
    output:
        predicted_figure=multiext(f"{RUN}/figures/predicted", ".png", ".pdf"),
    wildcard_constraints:
        **only(PREDICTIONS),
    params:
        **drawn_by("pictures"),
        grid=lambda w: predicted_grid(simulation_of(w)),
    script:
        "../scripts/figures.py"


show(rules.predicted_figure.output, names_of(PREDICTIONS))


def runs_from(brain):
    """Return the simulations from a start brain, and by week the observed brains shown with them."""
    simulations = [simulation for simulation in study.run_simulations if simulation.brain == brain]
    observed = {}
    for simulation in simulations:
        observed |= study.shown(simulation)
    return simulations, observed


def weekly_grid(brain):
    simulations, observed = runs_from(brain)
    grid = []
    for simulation in simulations:
        for row in study.rows_of(simulation):
            grid.append(placed(simulation.run, row.week, [study.measured_parts(row)["whole"]], simulated=True))
    name = observed_name(observed.values())
    for week, brain in observed.items():
        grid.append(placed(name, week, [brain.pial]))
    return grid


rule folding_figures:
    input:
        grid=lambda w: files_in_grid(weekly_grid(w.brain)),
        frames=lambda w: [simulation.file(FOLDING["frames"]) for simulation in runs_from(w.brain)[0]],
    output:
        weekly_figure=multiext(f"{STUDY}/figures/weekly.{{brain}}", ".png", ".pdf"),
        outlines_figure=multiext(f"{STUDY}/figures/outlines.{{brain}}", ".png", ".pdf"),
        displacement_maps=multiext(f"{STUDY}/figures/displacement_maps.{{brain}}", ".png", ".pdf"),
    wildcard_constraints:
        brain=one_of(start.id for start in study.starts),
    params:
        **drawn_by("pictures", "sections"),
        grid=lambda w: weekly_grid(w.brain),
        runs=lambda w: [simulation.run for simulation in runs_from(w.brain)[0]],
    script:
        "../scripts/figures.py"


show(rules.folding_figures.output, names_of(study.starts))


rule intervals_figure:
    input:
        ensemble=ENSEMBLE,
    output:
        intervals_figure=multiext(f"{RUN}/figures/intervals", ".png", ".pdf"),
    wildcard_constraints:
        **only(WITH_ENSEMBLE),
    params:
        **drawn_by("weeks"),
    script:
        "../scripts/figures.py"


show(rules.intervals_figure.output, names_of(WITH_ENSEMBLE))

ENSEMBLES_WITH_GROWTH = [simulation for simulation in WITH_ENSEMBLE if simulation.has_growth_maps]


rule growth_sd_figure:
    input:
        frames=FOLDING["frames"],
        growth=GROWTH_SD,
    output:
        growth_sd_figure=multiext(f"{RUN}/figures/growth_sd", ".png", ".pdf"),
    wildcard_constraints:
        **only(ENSEMBLES_WITH_GROWTH),
    params:
        **drawn_by("pictures"),
    script:
        "../scripts/figures.py"


show(rules.growth_sd_figure.output, names_of(ENSEMBLES_WITH_GROWTH))


def ensemble_grid(simulation):
    grid = []
    # without the start brain, which all members share
    for row in study.rows_of(simulation)[1:]:
        maps = [simulation.file(ENSEMBLE_MAPS, week=row.week, side=side) for side in row.sides]
        grid.append(placed(simulation.run, row.week, row.hemispheres, maps, simulated=True))
    return grid


rule ensemble_figures:
    input:
        grid=lambda w: files_in_grid(ensemble_grid(simulation_of(w))),
    output:
        position_spread_figure=multiext(f"{RUN}/figures/position_sd", ".png", ".pdf"),
        sulcus_probability_figure=multiext(f"{RUN}/figures/sulcus_probability", ".png", ".pdf"),
    wildcard_constraints:
        **only(WITH_ENSEMBLE),
    params:
        **drawn_by("pictures"),
        grid=lambda w: ensemble_grid(simulation_of(w)),
    script:
        "../scripts/figures.py"


show(rules.ensemble_figures.output, names_of(WITH_ENSEMBLE))

WITH_GROWTH = [simulation for simulation in study.run_simulations if simulation.has_growth_maps]


rule growth_found_figures:
    input:
        frames=FOLDING["frames"],
        growth=GROWTH_MAPS,
    output:
        growth_found_figure=multiext(f"{RUN}/figures/growth_found", ".png", ".pdf"),
        growth_across_figure=multiext(f"{RUN}/figures/growth_across", ".png", ".pdf"),
    wildcard_constraints:
        **only(WITH_GROWTH),
    params:
        **drawn_by("pictures"),
    script:
        "../scripts/figures.py"


show(rules.growth_found_figures.output, names_of(WITH_GROWTH))

# the settings that determine the zones of a run; runs with equal ones share a figure
ZONES = {"contact", "support"}
BY_ZONES = {}
for simulation in study.run_simulations:
    zones = repr(simulation.settings.model_dump(include=ZONES))
    BY_ZONES.setdefault((simulation.brain, zones), simulation)
ZONED = list(BY_ZONES.values())


rule zones_figure:
    input:
        boundary=MESH_REGIONS["data"],
        parameters=PARAMETERS,
    output:
        zones_figure=multiext(f"{RUN}/figures/zones", ".png", ".pdf"),
    wildcard_constraints:
        **only(ZONED),
    params:
        **drawn_by("pictures"),
    script:
        "../scripts/figures.py"


show(rules.zones_figure.output, names_of(ZONED))

# growth that follows measured sizes differs by step, and that towards shapes by element
BY_LAW = [
    simulation
    for simulation in study.run_simulations
    if simulation.settings.growth.definition.measured is None and not simulation.maps
]


rule model_figure:
    input:
        elements=FOLDING["frames"],
        parameters=PARAMETERS,
    output:
        model_figure=multiext(f"{RUN}/figures/model", ".png", ".pdf"),
    wildcard_constraints:
        **only(BY_LAW),
    params:
        **drawn_by("sections"),
    script:
        "../scripts/figures.py"


show(rules.model_figure.output, names_of(BY_LAW))

if study.run_simulations:

    # made by rule run_tables in study.smk
    show({"run_tables": f"{STUDY}/runs.html"})

    rule displacement_figure:
        input:
            displacement=f"{STUDY}/displacement.csv",
        output:
            displacement_figure=multiext(f"{STUDY}/figures/displacement", ".png", ".pdf"),
        params:
            **drawn_by("weeks"),
            runs=run_names(PAIRS),
        script:
            "../scripts/figures.py"

    show(rules.displacement_figure.output)

    rule paper_displacement_figure:
        input:
            displacement=f"{STUDY}/displacement.csv",
            published=PUBLISHED,
        output:
            paper_displacement_figure=multiext(f"{STUDY}/figures/displacement_paper", ".png", ".pdf"),
        params:
            **drawn_by("weeks"),
            runs=run_names(PAIRS),
        script:
            "../scripts/figures.py"

    show(rules.paper_displacement_figure.output)


# metrics


def shape_grid(brain):
    simulations, observed = runs_from(brain)
    grid = []
    for simulation in simulations:
        for row in study.rows_of(simulation):
            grid.append(placed(simulation.run, row.week, row.hemispheres, row.maps, simulated=True))
    name = observed_name(observed.values())
    for week, brain in observed.items():
        grid.append(placed(name, week, brain.hemispheres, brain.maps))
    return grid


rule shape_maps:
    input:
        grid=lambda w: files_in_grid(shape_grid(w.brain)),
    output:
        shape_maps=multiext(f"{STUDY}/figures/shape_index.{{brain}}", ".png", ".pdf"),
    wildcard_constraints:
        brain=one_of(start.id for start in study.starts),
    params:
        **drawn_by("pictures"),
        grid=lambda w: shape_grid(w.brain),
    script:
        "../scripts/figures.py"


show(rules.shape_maps.output, names_of(study.starts))

# the names and colours of brains in charts over the weeks
CHARTED = {
    "runs": run_names(PAIRS),
    "subjects": {brain.id: brain.subject for brain in BRAINS.values() if brain.subject is not None},
    "groups": {brain.id: brain.group for brain in BRAINS.values() if brain.group},
}
UNGROUPED = [brain for brain in BRAINS.values() if brain.group is None]


rule metrics_charts:
    input:
        metrics=f"{STUDY}/metrics.csv",
        spectra=f"{STUDY}/spectra.csv",
        atlases=f"{STUDY}/atlas_curves.csv",
    output:
        metrics_figure=multiext(f"{STUDY}/figures/metrics", ".png", ".pdf"),
        spectra_figure=multiext(f"{STUDY}/figures/spectra", ".png", ".pdf"),
    params:
        **drawn_by("weeks"),
        **CHARTED,
        observed_name=observed_name(UNGROUPED or BRAINS.values()),
    script:
        "../scripts/figures.py"


show(rules.metrics_charts.output)

NORM_BRAINS = [BRAINS[brain] for brain in study.norm_reference]

if study.has_norm:

    rule norms_figure:
        input:
            metrics=f"{STUDY}/metrics.csv",
            curves=f"{STUDY}/norm_curves.csv",
        output:
            norms_figure=multiext(f"{STUDY}/figures/norms", ".png", ".pdf"),
        params:
            **drawn_by("weeks"),
            **CHARTED,
            norm_name=observed_name(NORM_BRAINS),
            # norms of another study have no brains here
            reference=[] if CONFIG.metrics.norms else study.norm_reference,
            brains=[brain.id for brain in BRAINS.values() if brain.sides == NORM_BRAINS[0].sides],
        script:
            "../scripts/figures.py"

    show(rules.norms_figure.output)


if WITH_REGIONS:

    rule regions_chart:
        input:
            regions=f"{STUDY}/regions.csv",
            asymmetry=f"{STUDY}/asymmetry.csv",
        output:
            regions_chart=multiext(f"{STUDY}/figures/regions_metrics", ".png", ".pdf"),
        params:
            **drawn_by("weeks"),
            observed_name=observed_name(WITH_REGIONS),
        script:
            "../scripts/figures.py"

    show(rules.regions_chart.output)


def regions_grid():
    grid = []
    for brain in WITH_REGIONS:
        grid += brain_regions_grid(brain)
    for simulation, name in zip(study.run_simulations, run_names(PAIRS)):
        if simulation.has_regions:
            last = study.rows_of(simulation)[-1]
            column = f"{name}, {last.week:g} GW"
            grid.append(placed("", column, last.hemispheres, last.regions, simulated=True))
    return grid


if WITH_REGIONS and any(brain["simulated"] for brain in regions_grid()):

    rule regions_figure:
        input:
            grid=files_in_grid(regions_grid()),
        output:
            regions_figure=multiext(f"{STUDY}/figures/regions", ".png", ".pdf"),
        params:
            **drawn_by("pictures"),
            grid=regions_grid(),
        script:
            "../scripts/figures.py"

    show(rules.regions_figure.output)


# runs compared with observed brains

if study.validated:

    rule validation_figure:
        input:
            validation=f"{STUDY}/validation.csv",
        output:
            validation_figure=multiext(f"{STUDY}/figures/validation", ".png", ".pdf"),
        params:
            **drawn_by("scores"),
            runs=list(CONFIG.runs),
        script:
            "../scripts/figures.py"

    show(rules.validation_figure.output)


if study.predictions:

    rule prediction_figure:
        input:
            prediction=f"{STUDY}/prediction.csv",
        output:
            prediction_figure=multiext(f"{STUDY}/figures/prediction", ".png", ".pdf"),
        params:
            **drawn_by("weeks"),
            runs=list(CONFIG.runs),
        script:
            "../scripts/figures.py"

    show(rules.prediction_figure.output)

    rule prediction_table:
        input:
            prediction=f"{STUDY}/prediction.csv",
        output:
            prediction_table=f"{STUDY}/prediction.html",
        params:
            **drawn_by("tables"),
        script:
            "../scripts/figures.py"

    show(rules.prediction_table.output)


# weeks for which the deviation from the expected brain is shown
MAX_DEVIATIONS = 4


def expected_grid(simulation):
    observed = study.shown(simulation)
    # the last week, and others at equal steps
    compared = study.observed(simulation)
    step = -(-len(compared) // MAX_DEVIATIONS)
    deviating = sorted(compared, reverse=True)[::step]
    weeks = {simulation.weeks[0], *deviating}
    name = observed_name(observed.values())
    grid = []
    for row in study.rows_of(simulation):
        if row.week in weeks:
            grid.append(placed("expected", row.week, [study.measured_parts(row)["whole"]], simulated=True))
    for week, brain in observed.items():
        if week in weeks:
            grid.append(placed(name, week, [brain.pial]))
    for brain in deviation_grid(simulation):
        if brain["column"] in weeks:
            grid.append(brain | {"row": "distance"})
    return grid


def deviation_grid(simulation):
    grid = []
    for week in study.observed(simulation):
        surface = SIMULATED[*simulation.key, week].pial
        maps = simulation.file(DEVIATION["maps"], week=week)
        grid.append(placed("observed minus expected", week, [surface], [maps]))
    return grid


rule expected_figure:
    input:
        grid=lambda w: files_in_grid(expected_grid(simulation_of(w))),
    output:
        expected_figure=multiext(f"{RUN}/figures/expected", ".png", ".pdf"),
    wildcard_constraints:
        **only(study.atlas_predictions),
    params:
        **drawn_by("pictures"),
        grid=lambda w: expected_grid(simulation_of(w)),
    script:
        "../scripts/figures.py"


show(rules.expected_figure.output, names_of(study.atlas_predictions))

DEVIATIONS = []
for simulation in study.atlas_predictions:
    DEVIATIONS.append(simulation.names | {"quantity": "log_area"})
    if BRAINS[simulation.brain].thickness:
        DEVIATIONS.append(simulation.names | {"quantity": "thickness_difference_mm"})


rule deviation_figure:
    input:
        grid=lambda w: files_in_grid(deviation_grid(simulation_of(w))),
    output:
        deviation_figure=multiext(f"{RUN}/figures/deviation_{{quantity}}", ".png", ".pdf"),
    wildcard_constraints:
        **only(study.atlas_predictions),
        quantity=one_of(dict.fromkeys(names["quantity"] for names in DEVIATIONS)),
    params:
        **drawn_by("pictures"),
        grid=lambda w: deviation_grid(simulation_of(w)),
        quantity=lambda w: w.quantity,
    script:
        "../scripts/figures.py"


show(rules.deviation_figure.output, DEVIATIONS)

# sweeps: the runs from the start brain of the first run


def first_members(sweep):
    """Return the runs of a sweep from its first start brain, by name."""
    rows = SWEEPS[sweep]
    return {row.run: row for row in rows if row.brain == rows[0].brain}


def first_observed(sweep):
    """Return the first brain that these runs are compared with, if any."""
    return [BRAINS[brain] for brain in SWEEPS[sweep][0].observed[:1]]


def first_values(sweep):
    """Return the varied values of these runs."""
    return {run: row.values for run, row in first_members(sweep).items()}


def names_of_sweeps(sweeps):
    """Return the names of sweeps with their weeks."""
    return [{"sweep": sweep, "week": f"{SWEEPS[sweep][0].week:g}"} for sweep in sweeps]


def influence_grid(sweep):
    grid = []
    for run, member in first_members(sweep).items():
        row = SIMULATED[run, member.brain, member.week]
        # a run that ended before has no files
        has_files = reaches(run, member.brain, member.week)
        files = (row.hemispheres, row.maps) if has_files else ([], [])
        grid.append(placed("", run, *files, simulated=True))
    for brain in first_observed(sweep):
        grid.append(placed("", observed_name([brain]), brain.hemispheres, brain.maps))
    return grid


rule influence_figure:
    input:
        grid=lambda w: files_in_grid(influence_grid(w.sweep)),
    output:
        influence_figure=multiext(f"{SWEEP}/figures/influence", ".png", ".pdf"),
    params:
        **drawn_by("pictures"),
        grid=lambda w: influence_grid(w.sweep),
        values=lambda w: first_values(w.sweep),
    script:
        "../scripts/figures.py"


show(rules.influence_figure.output, names_of_sweeps(SWEEPS))


def member_spectra(wildcards):
    """Return the spectra of the runs of a sweep that reached its week."""
    return [
        f"{SIMULATED[run, member.brain, member.week].folder}/spectra.csv"
        for run, member in first_members(wildcards.sweep).items()
        if reaches(run, member.brain, member.week)
    ]


rule influence_spectra:
    input:
        members=member_spectra,
        observed=lambda w: [f"{brain.folder}/spectra.csv" for brain in first_observed(w.sweep)],
    output:
        influence_spectra=multiext(f"{SWEEP}/figures/spectra", ".png", ".pdf"),
    params:
        **drawn_by("weeks"),
        values=lambda w: first_values(w.sweep),
        week=lambda w: SWEEPS[w.sweep][0].week,
        observed_name=lambda w: observed_name(first_observed(w.sweep)),
    script:
        "../scripts/figures.py"


show(rules.influence_spectra.output, names_of_sweeps(SWEEPS))


def has_nearest(sweep):
    """Return whether the runs of a sweep are compared over one parameter with numbers."""
    vary = CONFIG.sweeps[sweep].vary
    values = next(iter(vary.values()))
    are_numbers = all(isinstance(value, int | float) for value in values)
    return bool(first_observed(sweep)) and len(vary) == 1 and are_numbers


OVER_NUMBERS = [sweep for sweep in SWEEPS if has_nearest(sweep)]


rule nearest_figure:
    input:
        comparison=f"{SWEEP}/comparison.csv",
    output:
        nearest_figure=multiext(f"{SWEEP}/figures/nearest", ".png", ".pdf"),
    wildcard_constraints:
        sweep=one_of(OVER_NUMBERS),
    params:
        **drawn_by("scores"),
        varied=lambda w: next(iter(CONFIG.sweeps[w.sweep].vary)),
        subject=lambda w: SWEEPS[w.sweep][0].brain,
        observed=lambda w: [brain.id for brain in first_observed(w.sweep)],
        week=lambda w: SWEEPS[w.sweep][0].week,
    script:
        "../scripts/figures.py"


show(rules.nearest_figure.output, names_of_sweeps(OVER_NUMBERS))


use rule nearest_figure as paper_nearest_figure with:
    input:
        comparison=f"{SWEEP}/comparison.csv",
        published=PUBLISHED,
    output:
        paper_nearest_figure=multiext(f"{SWEEP}/figures/nearest_paper", ".png", ".pdf"),


show(rules.paper_nearest_figure.output, names_of_sweeps(OVER_NUMBERS))

if study.calibration:

    rule calibration_figure:
        input:
            runs=f"{CALIBRATION}/runs.csv",
            optimum=f"{CALIBRATION}/optimum.csv",
        output:
            calibration_figure=multiext(f"{CALIBRATION}/calibration", ".png", ".pdf"),
        params:
            **drawn_by("scores"),
            score=list(CONFIG.calibrate.score),
        script:
            "../scripts/figures.py"

    show(rules.calibration_figure.output)


# made by rule study_records in report.smk
show({"study_resources": f"{STUDY}/resources.html"})


rule figures:
    input:
        figure_files(*SECTIONS["Inputs"], *SECTIONS["Growth"], *SECTIONS["Folding"], *SECTIONS["Metrics"]),


rule influence_figures:
    input:
        figure_files(*SECTIONS["Sweeps"]),
