# What compares the runs of a study with each other and with the measured brains.
COMPARED = comparisons()
# the tables of a study, and the files that each is joined from
JOINED = {
    "metrics": [f"results/{where}/metrics.csv" for where in MEASURED + SIMULATED],
    "spectra": [f"results/{where}/spectra.csv" for where in MEASURED + SIMULATED],
    "regions": [f"results/{where}/regions.csv" for where in WITH_REGIONS],
    "volumes": expand(rules.label_volumes.output.volumes, brain=WITH_VOLUMES),
    "published_centiles": expand(rules.label_volumes.output.scores, brain=WITH_VOLUMES),
    "displacement": of_runs(rules.displacement.output),
    "similarity": [
        f"results/runs/{run}/{brain}/metrics/week-{week}/similarity.{measured}.csv"
        for run, brain, week, measured in COMPARED
    ],
}


rule study_table:
    input:
        lambda wildcards: JOINED[wildcards.table],
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


rule folding_agreement:
    input:
        metrics=f"{STUDY}/metrics.csv",
        spectra=f"{STUDY}/spectra.csv",
    output:
        f"{STUDY}/folding_agreement.csv",
    log:
        f"{STUDY}/logs/folding_agreement.log",
    benchmark:
        f"{STUDY}/benchmarks/folding_agreement.tsv"
    conda:
        ENVIRONMENT
    params:
        pairs=[
            (run, brain, float(week), real)
            for run, brain in VALIDATED
            for week, real in compared_with(run, brain).items()
        ],
    script:
        "../scripts/folding_agreement.py"


rule spectral_distance:
    input:
        f"{STUDY}/spectra.csv",
    output:
        f"{STUDY}/spectral_distance.csv",
    log:
        f"{STUDY}/logs/spectral_distance.log",
    benchmark:
        f"{STUDY}/benchmarks/spectral_distance.tsv"
    conda:
        ENVIRONMENT
    script:
        "../scripts/spectral_distance.py"


rule age_profile:
    input:
        metrics=f"{STUDY}/metrics.csv",
        spectra=f"{STUDY}/spectra.csv",
    output:
        profile=f"{STUDY}/age_profile.csv",
        check=f"{STUDY}/age_profile_check.csv",
        similarity=f"{STUDY}/week_similarity.csv",
    log:
        f"{STUDY}/logs/age_profile.log",
    benchmark:
        f"{STUDY}/benchmarks/age_profile.tsv"
    conda:
        ENVIRONMENT
    params:
        reference=CONFIG.age_reference,
        followed={run: CONFIG.followed(run) for run in CONFIG.runs},
    script:
        "../scripts/age_profile.py"


# the tables that hold metrics, of whole hemispheres and of regions
METRIC_TABLES = [
    f"{STUDY}/metrics.csv",
    *([f"{STUDY}/regions.csv"] if WITH_REGIONS else []),
]


rule asymmetry:
    input:
        metrics=f"{STUDY}/metrics.csv",
        regions=METRIC_TABLES[1:],
    output:
        f"{STUDY}/asymmetry.csv",
    log:
        f"{STUDY}/logs/asymmetry.log",
    benchmark:
        f"{STUDY}/benchmarks/asymmetry.tsv"
    conda:
        ENVIRONMENT
    script:
        "../scripts/asymmetry.py"


rule centiles:
    input:
        metrics=f"{STUDY}/metrics.csv",
    output:
        norms=f"{STUDY}/norms.csv",
        curves=f"{STUDY}/norm_curves.csv",
        centiles=f"{STUDY}/centiles.csv",
    log:
        f"{STUDY}/logs/centiles.log",
    benchmark:
        f"{STUDY}/benchmarks/centiles.tsv"
    conda:
        ENVIRONMENT
    params:
        reference=CONFIG.norm_reference,
    script:
        "../scripts/centiles.py"


rule group_tables:
    input:
        METRIC_TABLES,
    output:
        long=f"{STUDY}/metrics_long.csv",
        wide=f"{STUDY}/metrics_wide.csv",
        change=f"{STUDY}/change.csv",
    log:
        f"{STUDY}/logs/group_tables.log",
    benchmark:
        f"{STUDY}/benchmarks/group_tables.tsv"
    conda:
        ENVIRONMENT
    params:
        scans=CONFIG.scans,
    script:
        "../scripts/group_tables.py"


def exported(where):
    """Returns what the export needs to know of what is measured in a folder: names, and files by side."""
    labels, folder = brain_labels(where), f"results/{surface_folder(where)}"
    brain = CONFIG.brain(labels["subject"])
    regions = (
        region_files(f"results/{regions_in(where)}") if where in WITH_REGIONS else {}
    )
    return {
        "brain": brain.id,
        "run": labels["run"],
        "week": labels["week"],
        "subject": brain.subject or brain.id,
        "surfaces": {side: surfaces_in(folder)[side] for side in brain.sides},
        "maps": {side: f"results/{where}/{side}.shape.gii" for side in brain.sides},
        "regions": dict(zip(SIDES, regions.values())),
    }


EXPORTED = [exported(where) for where in MEASURED + SIMULATED]


# a target of its own: what a study is handed on as
rule export:
    input:
        [
            list(brain[kind].values())
            for brain in EXPORTED
            for kind in ("surfaces", "maps", "regions")
        ],
        long=rules.group_tables.output.long,
        wide=rules.group_tables.output.wide,
    output:
        directory("results/export"),
    log:
        f"{STUDY}/logs/export.log",
    benchmark:
        f"{STUDY}/benchmarks/export.tsv"
    conda:
        ENVIRONMENT
    params:
        brains=EXPORTED,
        names=CONFIG.metrics.export,
    script:
        "../scripts/export.py"


rule study_runs:
    input:
        params=of_runs(rules.parameters.output),
        summaries=of_runs(rules.simulate.output.summary),
        zones=of_runs(rules.simulate.output.zones),
        steps=of_runs(rules.simulate.output.steps),
    output:
        csv=f"{STUDY}/runs.csv",
        table=report(
            f"{STUDY}/runs.html",
            caption="../report/runs_table.rst",
            category="Folding",
            labels={"figure": "parameters and summaries of the runs"},
        ),
    log:
        f"{STUDY}/logs/study_runs.log",
    benchmark:
        f"{STUDY}/benchmarks/study_runs.tsv"
    conda:
        ENVIRONMENT
    params:
        folded=FOLDED,
    script:
        "../scripts/study_runs.py"


rule metrics:
    input:
        [f"results/{where}/metrics.csv" for where in MEASURED],
        rules.study_runs.output,
        expand(
            rules.study_table.output,
            table=[name for name, files in JOINED.items() if files],
        ),
        rules.spectral_distance.output,
        rules.asymmetry.output,
        rules.centiles.output,
        rules.group_tables.output,
        rules.validate.input,
        rules.folding_agreement.output if VALIDATED else [],
        # with brains of too few weeks no apparent age can be estimated
        rules.age_profile.output if CONFIG.age_reference else [],
