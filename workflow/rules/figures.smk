# Figures of the study: PNG, marked for the report, and PDF.
FIGURES = "results/study/figures"
DRAWING = {"synthetic": SYNTHETIC, "dpi": CONFIG.report.dpi}


def shown_beside(run):
    """Returns, by week, the measured brain that a run's surface of that week is shown beside."""
    measured = {week_tag(brain.week): brain.id for brain in reversed(CONFIG.brains)}
    return {week: measured[week] for week in week_tags(run) if week in measured}


def folded(run, side="", weeks=None):
    """Returns a run's surface files of the given weeks, by default of all output weeks."""
    return [
        f"results/{START}/folding/{run}/surfaces/week-{week}.{side}pial.surf.gii"
        for week in (week_tags(run) if weeks is None else weeks)
    ]


# the last week of which every run has a surface
LAST_WEEK = max(set.intersection(*(set(week_tags(run)) for run in RUNS)))


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
        week=float(LAST_WEEK),
        code=code("report"),
    script:
        "../scripts/bands_figure.py"


rule displacement_figure:
    input:
        "results/study/displacement.csv",
    output:
        png=report(
            f"{FIGURES}/displacement.png",
            caption="../report/displacement.rst",
            category="Folding",
            labels={"figure": "displacement per week"},
        ),
        pdf=f"{FIGURES}/displacement.pdf",
        table=report(
            "results/study/displacement_table.html",
            caption="../report/displacement_table.rst",
            category="Folding",
            labels={"figure": "displacement per week, table"},
        ),
    log:
        "results/study/logs/displacement_figure.log",
    benchmark:
        "results/study/benchmarks/displacement_figure.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=1000,
        runtime=10,
    params:
        **DRAWING,
        code=code("report"),
    script:
        "../scripts/displacement_figure.py"


rule quality_figure:
    input:
        rules.tetrahedralise.output.quality,
    output:
        png=report(
            f"{FIGURES}/mesh_quality.png",
            caption="../report/mesh_quality.rst",
            category="Brains and growth",
            labels={"figure": "mesh quality"},
        ),
        pdf=f"{FIGURES}/mesh_quality.pdf",
    log:
        "results/study/logs/quality_figure.log",
    benchmark:
        "results/study/benchmarks/quality_figure.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=1000,
        runtime=10,
    params:
        **DRAWING,
        min_radius_ratio=CONFIG.mesh.min_radius_ratio,
        code=code("report"),
    script:
        "../scripts/quality_figure.py"


rule weekly_figure:
    input:
        simulated=lambda wildcards: folded(wildcards.run),
        real=lambda wildcards: [
            f"results/{brain}/surface/pial.surf.gii"
            for brain in shown_beside(wildcards.run).values()
        ],
    output:
        png=report(
            f"{FIGURES}/weekly.{{run}}.png",
            caption="../report/weekly.rst",
            category="Folding",
            labels={"figure": "simulated beside measured brains", "run": "{run}"},
        ),
        pdf=f"{FIGURES}/weekly.{{run}}.pdf",
    log:
        "results/study/logs/weekly_figure.{run}.log",
    benchmark:
        "results/study/benchmarks/weekly_figure.{run}.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=2000,
        runtime=10,
    params:
        **DRAWING,
        simulated_weeks=lambda wildcards: CONFIG.weeks(wildcards.run),
        real_weeks=lambda wildcards: [
            float(week) for week in shown_beside(wildcards.run)
        ],
        code=code("report"),
    script:
        "../scripts/weekly_figure.py"


rule displacement_maps:
    input:
        rules.simulate.output.frames,
    output:
        png=report(
            f"{FIGURES}/displacement_maps.{{run}}.png",
            caption="../report/displacement_maps.rst",
            category="Folding",
            labels={"figure": "displacement maps", "run": "{run}"},
        ),
        pdf=f"{FIGURES}/displacement_maps.{{run}}.pdf",
    log:
        "results/study/logs/displacement_maps.{run}.log",
    benchmark:
        "results/study/benchmarks/displacement_maps.{run}.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=2000,
        runtime=10,
    params:
        **DRAWING,
        code=code("report"),
    script:
        "../scripts/displacement_maps.py"


rule shape_maps:
    input:
        simulated=lambda wildcards: folded(wildcards.run, "left.")
        + folded(wildcards.run, "right."),
        simulated_maps=lambda wildcards: [
            f"results/{START}/metrics/{wildcards.run}/week-{week}/{side}.shape.gii"
            for side in ("left", "right")
            for week in week_tags(wildcards.run)
        ],
        real=lambda wildcards: [
            f"results/{brain}/surface/{side}.pial.surf.gii"
            for side in ("left", "right")
            for brain in shown_beside(wildcards.run).values()
        ],
        real_maps=lambda wildcards: [
            f"results/{brain}/metrics/real/{side}.shape.gii"
            for side in ("left", "right")
            for brain in shown_beside(wildcards.run).values()
        ],
    output:
        png=report(
            f"{FIGURES}/shape_index.{{run}}.png",
            caption="../report/shape_index.rst",
            category="Metrics",
            labels={"figure": "shape index maps", "run": "{run}"},
        ),
        pdf=f"{FIGURES}/shape_index.{{run}}.pdf",
    log:
        "results/study/logs/shape_maps.{run}.log",
    benchmark:
        "results/study/benchmarks/shape_maps.{run}.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=2000,
        runtime=10,
    params:
        **DRAWING,
        simulated_weeks=lambda wildcards: CONFIG.weeks(wildcards.run),
        real_weeks=lambda wildcards: [
            float(week) for week in shown_beside(wildcards.run)
        ],
        code=code("report"),
    script:
        "../scripts/shape_maps.py"


rule zones_figure:
    input:
        mesh=rules.tetrahedralise.output.mesh,
        data=rules.tetrahedralise.output.data,
        params=rules.parameters.output[0],
    output:
        png=report(
            f"{FIGURES}/zones.{{run}}.png",
            caption="../report/zones.rst",
            category="Folding",
            labels={"figure": "zones of the boundary", "run": "{run}"},
        ),
        pdf=f"{FIGURES}/zones.{{run}}.pdf",
    log:
        "results/study/logs/zones_figure.{run}.log",
    benchmark:
        "results/study/benchmarks/zones_figure.{run}.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=2000,
        runtime=10,
    params:
        **DRAWING,
        code=code("report", "folding"),
    script:
        "../scripts/zones_figure.py"


rule steps_figure:
    input:
        rules.simulate.output.steps,
    output:
        png=report(
            f"{FIGURES}/steps.{{run}}.png",
            caption="../report/steps.rst",
            category="Folding",
            labels={"figure": "steps of the solver", "run": "{run}"},
        ),
        pdf=f"{FIGURES}/steps.{{run}}.pdf",
    log:
        "results/study/logs/steps_figure.{run}.log",
    benchmark:
        "results/study/benchmarks/steps_figure.{run}.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=1000,
        runtime=10,
    params:
        **DRAWING,
        code=code("report"),
    script:
        "../scripts/steps_figure.py"


rule runs_figure:
    input:
        runs=[file for run in RUNS for file in folded(run, weeks=[LAST_WEEK])],
        real=[
            f"results/{brain}/surface/pial.surf.gii"
            for week, brain in shown_beside(RUNS[0]).items()
            if week == LAST_WEEK
        ],
    output:
        png=report(
            f"{FIGURES}/runs.png",
            caption="../report/runs.rst",
            category="Folding",
            labels={"figure": "runs side by side"},
        ),
        pdf=f"{FIGURES}/runs.pdf",
    log:
        "results/study/logs/runs_figure.log",
    benchmark:
        "results/study/benchmarks/runs_figure.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=2000,
        runtime=10,
    params:
        **DRAWING,
        runs=RUNS,
        week=float(LAST_WEEK),
        code=code("report"),
    script:
        "../scripts/runs_figure.py"


SINGLE_RUN_FIGURES = [
    rules.weekly_figure,
    rules.displacement_maps,
    rules.shape_maps,
    rules.zones_figure,
    rules.steps_figure,
]


rule figures:
    input:
        rules.metrics_figure.output,
        rules.spectra_figure.output,
        rules.bands_figure.output,
        rules.displacement_figure.output,
        rules.quality_figure.output,
        [expand(rule.output, run=RUNS) for rule in SINGLE_RUN_FIGURES],
        rules.runs_figure.output if len(RUNS) > 1 else [],
        rules.growth.input,


# the figures and tables of the paper that this study's data allow
rule paper:
    input:
        rules.growth.input,
        [
            expand(rule.output, run=RUNS)
            for rule in (
                rules.weekly_figure,
                rules.displacement_maps,
                rules.zones_figure,
            )
        ],
        rules.displacement_figure.output,
        rules.spectra_figure.output,
        rules.bands_figure.output,
        rules.runs_figure.output if len(RUNS) > 1 else [],
