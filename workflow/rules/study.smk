# What compares the runs of a study with each other and with the measured brains.

# the surfaces of a brain, by what stands before "pial" in their names
SURFACE_PARTS = {"whole": "", "left": "left.", "right": "right."}


rule similarity:
    input:
        simulated=[
            f"results/{START}/folding/{{run}}/surfaces/week-{{week}}.{side}pial.surf.gii"
            for side in SURFACE_PARTS.values()
        ],
        real=[
            f"results/{{brain}}/surface/{side}pial.surf.gii"
            for side in SURFACE_PARTS.values()
        ],
    output:
        f"results/{START}/metrics/{{run}}/week-{{week}}/similarity.{{brain}}.csv",
    log:
        f"results/{START}/logs/similarity.{{run}}.week-{{week}}.{{brain}}.log",
    benchmark:
        f"results/{START}/benchmarks/similarity.{{run}}.week-{{week}}.{{brain}}.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=2000,
        runtime=20,
    params:
        labels=lambda wildcards: {
            "subject": START,
            "run": wildcards.run,
            "week": float(wildcards.week),
            "real": wildcards.brain,
        },
        parts=list(SURFACE_PARTS),
        code=code("metrics"),
    script:
        "../scripts/similarity.py"


def tables_to_join(wildcards):
    run_tables = [
        f"results/{START}/metrics/{run}/{wildcards.table}.csv" for run in RUNS
    ]
    match wildcards.table:
        case "displacement":
            return run_tables
        case "similarity":
            return [
                f"results/{START}/metrics/{run}/week-{week}/similarity.{brain}.csv"
                for run, week, brain in comparisons()
            ]
        case _:
            return [
                f"results/{brain}/metrics/real/{wildcards.table}.csv"
                for brain in BRAINS
            ] + run_tables


rule study_table:
    input:
        tables_to_join,
    output:
        "results/study/{table}.csv",
    log:
        "results/study/logs/study_table.{table}.log",
    benchmark:
        "results/study/benchmarks/study_table.{table}.tsv"
    wildcard_constraints:
        table="metrics|spectra|displacement|similarity",
    conda:
        ENVIRONMENT
    resources:
        mem_mb=500,
        runtime=5,
    params:
        code=code(),
    script:
        "../scripts/join_tables.py"


rule spectral_distance:
    input:
        "results/study/spectra.csv",
    output:
        "results/study/spectral_distance.csv",
    log:
        "results/study/logs/spectral_distance.log",
    benchmark:
        "results/study/benchmarks/spectral_distance.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=500,
        runtime=5,
    params:
        code=code("metrics"),
    script:
        "../scripts/spectral_distance.py"


rule age_profile:
    input:
        metrics="results/study/metrics.csv",
        spectra="results/study/spectra.csv",
    output:
        profile="results/study/age_profile.csv",
        check="results/study/age_profile_check.csv",
    log:
        "results/study/logs/age_profile.log",
    benchmark:
        "results/study/benchmarks/age_profile.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=500,
        runtime=10,
    params:
        reference=CONFIG.age_reference,
        code=code("metrics"),
    script:
        "../scripts/age_profile.py"


rule study_runs:
    input:
        params=expand(rules.parameters.output, run=RUNS),
        summaries=expand(rules.simulate.output.summary, run=RUNS),
        zones=expand(rules.simulate.output.zones, run=RUNS),
    output:
        csv="results/study/runs.csv",
        table=report(
            "results/study/runs.html",
            caption="../report/runs_table.rst",
            category="Folding",
            labels={"figure": "parameters and summaries of the runs"},
        ),
    log:
        "results/study/logs/study_runs.log",
    benchmark:
        "results/study/benchmarks/study_runs.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=500,
        runtime=5,
    params:
        runs=RUNS,
        code=code("report"),
    script:
        "../scripts/study_runs.py"


STUDY_TABLES = expand(
    "results/study/{table}.csv",
    table=[
        "metrics",
        "spectra",
        "displacement",
        *(["similarity"] if comparisons() else []),
    ],
)


rule metrics:
    input:
        expand(rules.measure_real.output, brain=BRAINS),
        expand(rules.run_metrics.output, run=RUNS, table=["metrics", "spectra"]),
        expand(rules.displacement.output, run=RUNS),
        rules.study_runs.output,
        STUDY_TABLES,
        rules.spectral_distance.output,
        # with brains of too few weeks there is nothing to tell ages from
        rules.age_profile.output if CONFIG.age_reference else [],
