# What compares the runs of a study with each other and with the measured brains.
PLACES = list(study.measured.values())
LABELLED = [brain.id for brain in study.brains.values() if brain.labels]

# the tables of metrics, and the files that each is joined from
METRICS_TABLES = {
    "metrics": [
        *(f"{row.folder}/metrics.csv" for row in PLACES),
        *expand(white_of()["metrics"], brain=[brain.id for brain in study.brains.values() if brain.has_white]),
    ],
    "spectra": [f"{row.folder}/spectra.csv" for row in PLACES],
    "regions": [f"{row.folder}/regions.csv" for row in PLACES if row.regions],
    "volumes": expand(VOLUMES["volumes"], brain=LABELLED),
    "published_centiles": expand(VOLUMES["scores"], brain=LABELLED),
    "displacement": study.files(DISPLACEMENT),
}
JOINED = {**METRICS_TABLES, **VALIDATION_TABLES}


rule study_table:
    input:
        lambda w: JOINED[w.table],
    output:
        f"{STUDY}/{{table}}.csv",
    log:
        f"{STUDY}/logs/study_table.{{table}}.log",
    benchmark:
        f"{STUDY}/benchmarks/study_table.{{table}}.tsv"
    wildcard_constraints:
        table=one_of(JOINED),
    conda:
        ENVIRONMENT
    script:
        "../scripts/join_tables.py"


rule derived_tables:
    input:
        metrics=f"{STUDY}/metrics.csv",
        regions=f"{STUDY}/regions.csv" if METRICS_TABLES["regions"] else [],
        spectra=f"{STUDY}/spectra.csv",
    output:
        **{
            name: f"{STUDY}/{name}.csv"
            for name in (
                *("metrics_long", "metrics_wide", "change", "asymmetry"),
                *("norms", "norm_curves", "centiles", "spectral_distance"),
            )
        },
    log:
        f"{STUDY}/logs/derived_tables.log",
    benchmark:
        f"{STUDY}/benchmarks/derived_tables.tsv"
    conda:
        ENVIRONMENT
    params:
        scans=study.scans,
        covariates={brain.id: brain.given.covariates for brain in study.brains.values()},
        reference=study.norm_reference,
        individuals=study.individuals(study.norm_reference),
        subjects={brain.id: brain.subject for brain in study.brains.values()},
    script:
        "../scripts/derived_tables.py"


EXPORTED = study.exported


# a target of its own: what a study is handed on as
rule export:
    input:
        [
            list(brain[kind].values())
            for brain in EXPORTED
            for kind in (
                *("surfaces", "maps", "regions"),
                *("white", "white_maps", "template_maps"),
            )
        ],
        [brain["report"] for brain in EXPORTED],
        [
            path
            for brain in EXPORTED
            if (volume := brain["volume"])
            for path in (volume["labels"].path, volume["surface"], volume["thickness"])
        ],
        long=rules.derived_tables.output.metrics_long,
        wide=rules.derived_tables.output.metrics_wide,
    output:
        # a folder would hold a file of Snakemake's
        "results/export/dataset_description.json",
    log:
        f"{STUDY}/logs/export.log",
    benchmark:
        f"{STUDY}/benchmarks/export.tsv"
    conda:
        ENVIRONMENT
    params:
        brains=EXPORTED,
    script:
        "../scripts/export.py"


rule study_runs:
    input:
        params=study.files(PARAMETERS),
        summaries=study.files(FOLDING["summary"]),
        zones=study.files(FOLDING["zones"]),
        steps=study.files(FOLDING["steps"]),
    output:
        csv=f"{STUDY}/runs.csv",
        table=f"{STUDY}/runs.html",
    log:
        f"{STUDY}/logs/study_runs.log",
    benchmark:
        f"{STUDY}/benchmarks/study_runs.tsv"
    conda:
        ENVIRONMENT
    params:
        folded=study.pairs,
        growth_of=[study.growth_of(one) for one in study.folded],
    script:
        "../scripts/study_runs.py"


rule metrics:
    input:
        [f"{brain.measured.folder}/metrics.csv" for brain in study.brains.values()],
        rules.study_runs.output if study.folded else [],
        expand(
            rules.study_table.output,
            table=[name for name, files in METRICS_TABLES.items() if files],
        ),
        rules.derived_tables.output,
        rules.validate.input,
