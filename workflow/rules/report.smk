# Resources and warnings of all jobs, and the report: an HTML page of the study and one of each brain, with the figures
# and tables of `figures.smk`.
from gyriflow.settings.terms import run_names

# the configuration; brains of atlases and of the table of participants are already among its brains
USED_SETTINGS = CONFIG.model_dump(mode="json", exclude_defaults=True, exclude={"atlas", "participants"})
DESCRIBED = ("id", "week", "population", "source", "covariates")
PAGE = f"{workflow.basedir}/workflow/report/page"
# all figures and tables of the report and of the pages of brains
ON_PAGES = []
for sections in (SECTIONS, BRAIN_SECTIONS):
    for names in sections.values():
        ON_PAGES += names


def descriptions(brains):
    """Return the properties of brains, refused ones too, with the licence of their atlas."""
    described = []
    for brain in brains:
        facts = {name: getattr(brain, name) for name in DESCRIBED}
        used = study.atlases.get(brain.id)
        facts["synthetic"] = brain.shape is not None
        described.append(facts | {"licence": used.atlas.licence.name if used else None})
    return described


# figures that need not be asked for: of this rule, and those that are made with the rows of the quality table
MADE_WITH_OTHERS = ("study_resources", "quality_page", "brain_depth", "brain_maps")


# also of the report's own tables, so that they exist if the page cannot be made
rule study_records:
    input:
        # logs and messages, with time and memory, are not inputs, since a missing one would repeat its job
        figure_files(*(name for name in ON_PAGES if name not in MADE_WITH_OTHERS)),
        rules.metrics.input,
        # made from a row of each brain, with which its figures are made
        rules.quality_table.output,
        run_params=study.files(PARAMETERS),
        summaries=study.files(FOLDING["summary"]),
        template=f"{PAGE}/methods.rst",
        atlases=f"{workflow.basedir}/norms/atlases.yaml",
        differences=rules.metrics_tables.output.atlas_differences,
    output:
        resources=f"{STUDY}/resources.csv",
        resources_page=f"{STUDY}/resources.html",
        warnings=f"{STUDY}/warnings.csv",
        study=f"{STUDY}/provenance.json",
        brains=expand(f"{BRAIN}/provenance.json", brain=BRAINS),
        runs=study.files(f"{RUN}/provenance.json"),
        report=f"{REPORT}/provenance.json",
        methods=f"{REPORT}/methods.rst",
        # the configuration with the paths of its files
        config=f"{REPORT}/config.yaml",
    params:
        config=USED_SETTINGS,
        # also refused brains
        known_brains=[brain.id for brain in CONFIG.brains],
        brains=[
            brain.model_dump(mode="json", exclude_defaults=True)
            for brain in CONFIG.brains
            if brain.id in BRAINS
        ],
        files=[
            (brain.id, what, path)
            for brain in BRAINS.values()
            for what, paths in (
                (brain.source, brain.files),
                ("image", [brain.image] if brain.image else []),
                ("white", brain.white_files.values()),
            )
            for path in paths
        ],
        folded=PAIRS,
        # also those of sweeps, whose time and memory count
        simulated=list(study.simulations),
        growth_of=[simulation.growth_of for simulation in study.run_simulations],
        # used by the methods text
        method=lambda w: {
            "brains": descriptions(brain for brain in CONFIG.brains if brain.id in BRAINS),
            "filled": study.filled,
            "surface": LABEL_SETTINGS,
            "mesh": CONFIG.mesh.model_dump(mode="json", include={"mesher", "order"}),
            "metrics": CONFIG.metrics.model_dump(mode="json", include={"curvature_radius_mm"}),
        },
    script:
        "../scripts/study_records.py"


def on_page(sections):
    """Return the figures of the sections of a page: their file, place, and names in title and caption."""
    figures = []
    for section, names in sections.items():
        for name in names:
            drawn = FIGURES.get(name, {"files": [], "names": []})
            look = {"first": name in IN_SUMMARY, "technical": name in TECHNICAL}
            for values in drawn["names"]:
                path = drawn["files"][0].format(**values)
                figures.append({"name": name, "section": section, "path": path, "names": values, **look})
    return figures


def on_brain_pages():
    """Return the figures of the page of each brain."""
    figures = {brain: [] for brain in BRAINS}
    for figure in on_page(BRAIN_SECTIONS):
        figures[figure["names"]["brain"]].append(figure)
    return figures


def captions_of(*pages):
    """Return the files with title and caption of the figures of pages."""
    names = [name for sections in pages for section in sections.values() for name in section]
    return [f"{workflow.basedir}/workflow/report/captions/{name}.rst" for name in names if name in FIGURES]


# the surfaces of the 3D view by week: of all runs, and of measured brains of the start's population
VIEWED = [brain for brain in BRAINS.values() if study.starts and brain.population == study.starts[0].population]
VIEWED_ROWS = list(VIEWED)
for simulation in study.run_simulations:
    VIEWED_ROWS += study.rows_of(simulation)


def halves(row):
    """Return the hemispheres of a brain, each with its maps."""
    return [list(pair) for pair in zip(row.hemispheres, row.maps)]


SURFACES = {
    "runs": {
        name: [[row.week, halves(row)] for row in study.rows_of(simulation)]
        for name, simulation in zip(run_names(PAIRS), study.run_simulations)
    },
    "observed": [[brain.week, halves(brain)] for brain in sorted(VIEWED, key=lambda brain: brain.week)],
}


rule html_report:
    input:
        figure_files(*ON_PAGES),
        rules.metrics.input,
        quality=rules.quality_table.output[0],
        metrics=f"{STUDY}/metrics.csv",
        centiles=rules.metrics_tables.output.centiles,
        curves=rules.metrics_tables.output.atlas_curves,
        differences=rules.metrics_tables.output.atlas_differences,
        warnings=rules.study_records.output.warnings,
        runs=rules.run_tables.output.csv if study.run_simulations else [],
        validation=f"{STUDY}/validation.csv" if study.validated else [],
        atlas_brain=study.prediction_facts["atlas_surface"] if study.prediction else [],
        intervals=study.prediction.file(ENSEMBLE) if study.prediction and study.prediction.members else [],
        small=[f"{BRAIN}/figures/small.png".format(brain=brain) for brain in BRAINS],
        accuracy=PREDICTION_TESTS if study.prediction else [],
        targets=study.prediction.targets if study.prediction else [],
        surfaces=[file for row in VIEWED_ROWS for file in (*row.hemispheres, *row.maps)],
        captions=captions_of(SECTIONS, BRAIN_SECTIONS),
        provenance=rules.study_records.output.report,
        methods=rules.study_records.output.methods,
        page=f"{PAGE}/page.html",
        style=f"{PAGE}/style.css",
        three=f"{PAGE}/three.min.js",
        notice=f"{PAGE}/three.LICENSE.txt",
        controls=f"{PAGE}/OrbitControls.min.js",
        viewer=f"{PAGE}/viewer.js",
    output:
        report=f"{REPORT}/report.html",
        brains=expand(f"{REPORT}/brains/{{brain}}.html", brain=BRAINS),
        view=f"{REPORT}/surfaces.json",
    params:
        figures=on_page(SECTIONS),
        brain_figures=on_brain_pages(),
        brains=lambda w: descriptions(CONFIG.brains),
        prediction=lambda w: study.prediction_facts,
        surfaces=SURFACES,
        observed_name=observed_name(VIEWED),
        norm=CONFIG.metrics.norms or observed_name(BRAINS[brain] for brain in study.norm_reference),
        config=USED_SETTINGS,
    script:
        "../scripts/html_report.py"


rule report:
    input:
        rules.html_report.output.report,
        rules.study_records.output.report,
