# Tables of a study: all measured brains and all runs; and the export.
from gyriflow.study.checks import norm_settings

PLACES = study.measured.values()
WITH_WHITE = [brain.id for brain in BRAINS.values() if brain.white]
LABELLED = [brain for brain in BRAINS.values() if brain.labels]
METRICS_TABLES = [
    *("metrics", "spectra", "metrics_long", "metrics_wide", "change", "asymmetry"),
    *("norm_curves", "centiles", "spectral_distance", "atlas_curves", "atlas_differences"),
    *(["regions"] if any(row.regions for row in PLACES) else []),
    *(["volumes", "published_centiles"] if LABELLED else []),
]


rule metrics_tables:
    input:
        metrics=[f"{row.folder}/metrics.csv" for row in PLACES]
        + expand(white_of()["metrics"], brain=WITH_WHITE),
        spectra=[f"{row.folder}/spectra.csv" for row in PLACES],
        regions=[f"{row.folder}/regions.csv" for row in PLACES if row.regions],
        # they contain the volumes of labels
        labelled=[brain.report for brain in LABELLED],
        norms=f"{workflow.basedir}/norms/svrtk-volumes.yaml",
        atlases=f"{workflow.basedir}/norms/atlases.yaml",
        noise=f"{workflow.basedir}/norms/repeatability.yaml",
        # norms of another study
        cohort=[CONFIG.metrics.norms] if CONFIG.metrics.norms else [],
    output:
        **{name: f"{STUDY}/{name}.csv" for name in METRICS_TABLES},
        norms=f"{STUDY}/norms.json",
    params:
        labelled=[(brain.id, brain.week, brain.sides, label_source(CONFIG, brain).scheme) for brain in LABELLED],
        scans=study.scans,
        covariates={brain.id: {"person": brain.subject_name, **brain.covariates} for brain in BRAINS.values()},
        reference=study.norm_reference,
        individuals=study.are_individuals(study.norm_reference),
        subjects={brain.id: brain.subject_name for brain in BRAINS.values()},
        made_with=norm_settings(study.config),
        population=sorted({BRAINS[brain].population_name for brain in study.norm_reference}),
    script:
        "../scripts/metrics_tables.py"


rule run_tables:
    input:
        params=study.files(PARAMETERS),
        summaries=study.files(FOLDING["summary"]),
        zones=study.files(FOLDING["zones"]),
        steps=study.files(FOLDING["steps"]),
        frames=study.files(FOLDING["frames"]),
    output:
        csv=f"{STUDY}/runs.csv",
        table=f"{STUDY}/runs.html",
        displacement=f"{STUDY}/displacement.csv",
    params:
        folded=PAIRS,
        growth_of=[simulation.growth_of for simulation in study.run_simulations],
    script:
        "../scripts/run_tables.py"


def exported_files():
    """Return the files of all brains that are exported, each once."""
    files = []
    for brain in study.exported:
        files.append(brain.report)
        for by_side in (
            brain.surfaces,
            brain.maps,
            brain.regions,
            brain.white,
            brain.white_maps,
            brain.template_maps,
        ):
            files += by_side.values()
        if brain.volume:
            files += [brain.volume["surface"], brain.volume["thickness"], brain.volume["labels"].path]
    return list(dict.fromkeys(files))


# a separate target
rule export:
    input:
        exported_files(),
        long=rules.metrics_tables.output.metrics_long,
    output:
        # a file, since Snakemake writes its own file into an output folder
        "results/export/dataset_description.json",
    log:
        f"{STUDY}/logs/export.log",
    params:
        brains=study.exported,
    script:
        "../scripts/export.py"


rule metrics:
    input:
        [f"{brain.folder}/metrics.csv" for brain in BRAINS.values()],
        rules.metrics_tables.output,
        rules.run_tables.output if study.run_simulations else [],
        rules.validate.input,
        [simulation.file(ENSEMBLE) for simulation in WITH_ENSEMBLE],
