# Metrics of measured and simulated brains, by the same code with the same settings.


def folded_surfaces(side):
    """Returns the surfaces of a hemisphere of all runs at all output weeks."""
    return [
        file
        for run in RUNS
        for file in expand(
            rules.folded_surface.output[side], run=run, week=week_tags(run)
        )
    ]


# Only a common number of modes ties brains to each other: measured ones then wait for all simulations.
rule weyl_numbers:
    input:
        left=expand("results/{brain}/surface/left.pial.surf.gii", brain=BRAINS)
        + folded_surfaces("left"),
        right=expand("results/{brain}/surface/right.pial.surf.gii", brain=BRAINS)
        + folded_surfaces("right"),
    output:
        "results/study/weyl_numbers.csv",
    log:
        "results/study/logs/weyl_numbers.log",
    benchmark:
        "results/study/benchmarks/weyl_numbers.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=2000,
        runtime=20,
    params:
        labels=[
            {"subject": brain.id, "run": "real", "week": brain.week}
            for brain in CONFIG.brains
        ]
        + [
            {"subject": START, "run": run, "week": week}
            for run in RUNS
            for week in CONFIG.weeks(run)
        ],
        formula=CONFIG.metrics.spangy_wavelength,
        code=code("metrics"),
    script:
        "../scripts/weyl_numbers.py"


MODE_NUMBERS = (
    rules.weyl_numbers.output[0] if CONFIG.metrics.spangy_modes == "common" else []
)


rule measure_real:
    input:
        whole="results/{brain}/surface/pial.surf.gii",
        left="results/{brain}/surface/left.pial.surf.gii",
        right="results/{brain}/surface/right.pial.surf.gii",
        mode_numbers=MODE_NUMBERS,
    output:
        metrics="results/{brain}/metrics/real/metrics.csv",
        spectra="results/{brain}/metrics/real/spectra.csv",
        coefficients="results/{brain}/metrics/real/coefficients.csv",
        left="results/{brain}/metrics/real/left.shape.gii",
        right="results/{brain}/metrics/real/right.shape.gii",
    log:
        "results/{brain}/logs/measure_real.log",
    benchmark:
        "results/{brain}/benchmarks/measure_real.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=4000,
        runtime=60,
    params:
        labels=lambda wildcards: {
            "subject": wildcards.brain,
            "run": "real",
            "week": CONFIG.brain(wildcards.brain).week,
        },
        settings=CONFIG.metrics.model_dump(exclude={"age_reference"}),
        code=code("metrics"),
    script:
        "../scripts/measure.py"


rule measure_simulated:
    input:
        whole=rules.folded_surface.output.whole,
        left=rules.folded_surface.output.left,
        right=rules.folded_surface.output.right,
        mode_numbers=MODE_NUMBERS,
    output:
        metrics=f"results/{START}/metrics/{{run}}/week-{{week}}/metrics.csv",
        spectra=f"results/{START}/metrics/{{run}}/week-{{week}}/spectra.csv",
        coefficients=f"results/{START}/metrics/{{run}}/week-{{week}}/coefficients.csv",
        left=f"results/{START}/metrics/{{run}}/week-{{week}}/left.shape.gii",
        right=f"results/{START}/metrics/{{run}}/week-{{week}}/right.shape.gii",
    log:
        f"results/{START}/logs/measure_simulated.{{run}}.week-{{week}}.log",
    benchmark:
        f"results/{START}/benchmarks/measure_simulated.{{run}}.week-{{week}}.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=4000,
        runtime=60,
    params:
        labels=lambda wildcards: {
            "subject": START,
            "run": wildcards.run,
            "week": float(wildcards.week),
        },
        settings=CONFIG.metrics.model_dump(exclude={"age_reference"}),
        code=code("metrics"),
    script:
        "../scripts/measure.py"


rule displacement:
    input:
        rules.simulate.output.frames,
    output:
        f"results/{START}/metrics/{{run}}/displacement.csv",
    log:
        f"results/{START}/logs/displacement.{{run}}.log",
    benchmark:
        f"results/{START}/benchmarks/displacement.{{run}}.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=2000,
        runtime=10,
    params:
        labels=lambda wildcards: {"subject": START, "run": wildcards.run},
        code=code("metrics"),
    script:
        "../scripts/displacement.py"


rule run_metrics:
    input:
        lambda wildcards: expand(
            f"results/{START}/metrics/{wildcards.run}/week-{{week}}/{wildcards.table}.csv",
            week=week_tags(wildcards.run),
        ),
    output:
        f"results/{START}/metrics/{{run}}/{{table}}.csv",
    log:
        f"results/{START}/logs/run_metrics.{{run}}.{{table}}.log",
    benchmark:
        f"results/{START}/benchmarks/run_metrics.{{run}}.{{table}}.tsv"
    wildcard_constraints:
        table="metrics|spectra",
    conda:
        ENVIRONMENT
    resources:
        mem_mb=500,
        runtime=5,
    params:
        code=code(),
    script:
        "../scripts/join_tables.py"
