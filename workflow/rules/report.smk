# The HTML report: Snakemake's own, of the figures and tables marked for it.
rule html_report:
    input:
        rules.figures.input,
        rules.metrics.input,
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
        mem_mb=2000,
        runtime=20,
    params:
        snakefile=f"{workflow.basedir}/Snakefile",
        config=CONFIG.model_dump(mode="json", exclude_defaults=True),
    script:
        "../scripts/html_report.py"


rule report:
    input:
        rules.html_report.output,
