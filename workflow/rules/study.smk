# What compares the runs of a study with each other and with the measured brains.
# the tables of a study, and the files that each is joined from
JOINED = {**study.tables, **study.validation_tables}


rule study_table:
    input:
        lambda w: JOINED[w.table],
    output:
        f"{STUDY}/{{table}}.csv",
    wildcard_constraints:
        table=one_of(JOINED),
    script:
        "../scripts/join_tables.py"


rule derived_tables:
    input:
        metrics=f"{STUDY}/metrics.csv",
        regions=f"{STUDY}/regions.csv" if study.tables["regions"] else [],
        spectra=f"{STUDY}/spectra.csv",
    output:
        **{
            name: f"{STUDY}/{name}.csv"
            for name in (
                *("metrics_long", "metrics_wide", "change", "asymmetry"),
                *("norms", "norm_curves", "centiles", "spectral_distance"),
            )
        },
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
            brain["volume"][file]
            for brain in EXPORTED
            if brain["volume"]
            for file in ("labels", "surface", "thickness")
        ],
        long=rules.derived_tables.output.metrics_long,
        wide=rules.derived_tables.output.metrics_wide,
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
        growth_of=[study.growth_of(one) for one in study.folded],
    script:
        "../scripts/study_runs.py"


rule metrics:
    input:
        [f"{brain.measured.folder}/metrics.csv" for brain in study.brains.values()],
        rules.study_runs.output if study.folded else [],
        expand(
            rules.study_table.output,
            table=[name for name, files in study.tables.items() if files],
        ),
        rules.derived_tables.output,
        rules.validate.input,
