# What compares the runs of a study with each other and with the measured brains.
# the tables of a study, and the files that each is joined from
JOINED = {**study.tables, **study.validation_tables}
# the tables that hold metrics, of whole hemispheres and of regions
METRIC_TABLES = [f"{STUDY}/{table}.csv" for table in ("metrics", "regions") if JOINED[table]]


rule study_table:
    input:
        lambda w: JOINED[w.table],
    output:
        f"{STUDY}/{{table}}.csv",
    wildcard_constraints:
        table=one_of(JOINED),
    script:
        "../scripts/join_tables.py"


rule spectral_distance:
    input:
        f"{STUDY}/spectra.csv",
    output:
        f"{STUDY}/spectral_distance.csv",
    script:
        "../scripts/spectral_distance.py"


rule asymmetry:
    input:
        metrics=METRIC_TABLES[0],
        regions=METRIC_TABLES[1:],
    output:
        f"{STUDY}/asymmetry.csv",
    script:
        "../scripts/asymmetry.py"


rule centiles:
    input:
        metrics=f"{STUDY}/metrics.csv",
    output:
        norms=f"{STUDY}/norms.csv",
        curves=f"{STUDY}/norm_curves.csv",
        centiles=f"{STUDY}/centiles.csv",
    params:
        reference=study.norm_reference,
    script:
        "../scripts/centiles.py"


rule group_tables:
    input:
        METRIC_TABLES,
    output:
        long=f"{STUDY}/metrics_long.csv",
        wide=f"{STUDY}/metrics_wide.csv",
        change=f"{STUDY}/change.csv",
    params:
        scans=study.scans,
        covariates={brain.id: brain.given.covariates for brain in study.brains.values()},
    script:
        "../scripts/group_tables.py"


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
            brain["volume"][file]
            for brain in EXPORTED
            if brain["volume"]
            for file in ("labels", "surface", "thickness")
        ],
        long=rules.group_tables.output.long,
        wide=rules.group_tables.output.wide,
    output:
        # a folder would hold a file of Snakemake's
        "results/export/dataset_description.json",
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
    params:
        folded=study.pairs,
    script:
        "../scripts/study_runs.py"


rule metrics:
    input:
        [f"{brain.measured.folder}/metrics.csv" for brain in study.brains.values()],
        rules.study_runs.output,
        expand(
            rules.study_table.output,
            table=[name for name, files in study.tables.items() if files],
        ),
        rules.spectral_distance.output,
        rules.asymmetry.output,
        rules.centiles.output,
        rules.group_tables.output,
        rules.validate.input,
