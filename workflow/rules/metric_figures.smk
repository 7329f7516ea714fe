# Figures of the metrics of all runs and brains.
rule metrics_figure:
    input:
        "results/study/metrics.csv",
    output:
        png=report(
            f"{FIGURES}/metrics.png",
            caption="../report/metrics.rst",
            category="Metrics",
            labels={"figure": "metrics over the weeks"},
        ),
        pdf=f"{FIGURES}/metrics.pdf",
        table=report(
            "results/study/metrics_table.html",
            caption="../report/metrics_table.rst",
            category="Metrics",
            labels={"figure": "metrics, table"},
        ),
    log:
        "results/study/logs/metrics_figure.log",
    benchmark:
        "results/study/benchmarks/metrics_figure.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=1000,
        runtime=10,
    params:
        **DRAWING,
        measured=CONFIG.measured_name(BRAINS),
        code=code("report"),
    script:
        "../scripts/metrics_figure.py"


rule spectra_figure:
    input:
        "results/study/spectra.csv",
    output:
        png=report(
            f"{FIGURES}/spectra.png",
            caption="../report/spectra.rst",
            category="Metrics",
            labels={"figure": "SpAnGy bands B4-B6 over the weeks"},
        ),
        pdf=f"{FIGURES}/spectra.pdf",
    log:
        "results/study/logs/spectra_figure.log",
    benchmark:
        "results/study/benchmarks/spectra_figure.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=1000,
        runtime=10,
    params:
        **DRAWING,
        measured=CONFIG.measured_name(BRAINS),
        code=code("report"),
    script:
        "../scripts/spectra_figure.py"


rule bands_figure:
    input:
        "results/study/spectra.csv",
    output:
        png=report(
            f"{FIGURES}/bands.png",
            caption="../report/bands.rst",
            category="Metrics",
            labels={"figure": "all SpAnGy bands at the last week"},
        ),
        pdf=f"{FIGURES}/bands.pdf",
    log:
        "results/study/logs/bands_figure.log",
    benchmark:
        "results/study/benchmarks/bands_figure.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=1000,
        runtime=10,
    params:
        **DRAWING,
        measured=CONFIG.measured_name(BRAINS),
        week=float(LAST_WEEK),
        code=code("report"),
    script:
        "../scripts/bands_figure.py"


rule age_profile_figure:
    input:
        profile=rules.age_profile.output.profile,
        check=rules.age_profile.output.check,
    output:
        png=report(
            f"{FIGURES}/age_profile.png",
            caption="../report/age_profile.rst",
            category="Metrics",
            labels={"figure": "weeks that simulated brains look like"},
        ),
        pdf=f"{FIGURES}/age_profile.pdf",
    log:
        "results/study/logs/age_profile_figure.log",
    benchmark:
        "results/study/benchmarks/age_profile_figure.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=1000,
        runtime=10,
    params:
        **DRAWING,
        measured=CONFIG.measured_name(CONFIG.age_reference),
        code=code("report"),
    script:
        "../scripts/age_profile_figure.py"
