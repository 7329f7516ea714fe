# What the jobs took, and the HTML report: Snakemake's own, of the figures and tables marked for it.
# by rule, what the paths of its benchmark files look like; files of earlier configurations do not match
BENCHMARKS = {
    job.name: job.benchmark.regex().pattern for job in workflow.rules if job.benchmark
}
# the brains of the atlas are among the brains by now
USED_CONFIG = CONFIG.model_dump(mode="json", exclude_defaults=True, exclude={"atlas"})


rule study_resources:
    input:
        # the files of benchmarks are no inputs: a lost one would have its stage run again
        rules.figures.input,
        rules.metrics.input,
        summaries=of_runs(rules.simulate.output.summary),
        steps=of_runs(rules.simulate.output.steps),
    output:
        csv=f"{STUDY}/resources.csv",
        table=report(
            f"{STUDY}/resources.html",
            caption="../report/resources_table.rst",
            category="Resources",
            labels={"figure": "time, memory, energy and emissions"},
        ),
    log:
        f"{STUDY}/logs/study_resources.log",
    benchmark:
        f"{STUDY}/benchmarks/study_resources.tsv"
    conda:
        ENVIRONMENT
    params:
        benchmarks=BENCHMARKS,
        power=CONFIG.report.energy.model_dump(),
        folded=FOLDED,
    script:
        "../scripts/study_resources.py"


rule provenance:
    input:
        rules.figures.input,
        rules.metrics.input,
    output:
        study=f"{STUDY}/provenance.json",
        brains=expand(f"{BRAIN}/provenance.json", brain=BRAINS),
        runs=of_runs(f"{RUN}/provenance.json"),
    log:
        f"{STUDY}/logs/provenance.log",
    benchmark:
        f"{STUDY}/benchmarks/provenance.tsv"
    conda:
        ENVIRONMENT
    params:
        config=USED_CONFIG,
        brains=[
            brain.model_dump(mode="json", exclude_defaults=True)
            for brain in CONFIG.brains
        ],
        folded=FOLDED,
    script:
        "../scripts/provenance.py"


rule html_report:
    input:
        rules.figures.input,
        rules.metrics.input,
        rules.study_resources.output,
    output:
        html="results/report/report.html",
        config="results/report/config.yaml",
    log:
        "results/report/logs/html_report.log",
    benchmark:
        "results/report/benchmarks/html_report.tsv"
    conda:
        ENVIRONMENT
    resources:
        runtime=20,
    params:
        snakefile=f"{workflow.basedir}/Snakefile",
        config=USED_CONFIG,
    script:
        "../scripts/html_report.py"


rule report:
    input:
        rules.html_report.output,
        rules.provenance.output,
