# What compares the runs of a study with each other and with the measured brains.
COMPARED = comparisons()
# the tables of a study, and the files that each is joined from
JOINED = {
    "metrics": [f"results/{where}/metrics.csv" for where in MEASURED + SIMULATED],
    "spectra": [f"results/{where}/spectra.csv" for where in MEASURED + SIMULATED],
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
    log:
        f"{STUDY}/logs/age_profile.log",
    benchmark:
        f"{STUDY}/benchmarks/age_profile.tsv"
    conda:
        ENVIRONMENT
    params:
        reference=CONFIG.age_reference,
    script:
        "../scripts/age_profile.py"


rule study_runs:
    input:
        params=of_runs(rules.parameters.output),
        summaries=of_runs(rules.simulate.output.summary),
        zones=of_runs(rules.simulate.output.zones),
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
        rules.validate.input,
        rules.folding_agreement.output if VALIDATED else [],
        # with brains of too few weeks no apparent age can be estimated
        rules.age_profile.output if CONFIG.age_reference else [],
