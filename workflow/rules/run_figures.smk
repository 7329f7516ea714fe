# Figures of each run: PNG, marked for the report, and PDF.
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
LAST_BRAINS = [
    brain for week, brain in shown_beside(RUNS[0]).items() if week == LAST_WEEK
]


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
        measured=lambda wildcards: CONFIG.measured_name(
            shown_beside(wildcards.run).values()
        ),
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


rule contact_maps:
    input:
        rules.simulate.output.frames,
    output:
        png=report(
            f"{FIGURES}/contact_maps.{{run}}.png",
            caption="../report/contact_maps.rst",
            category="Folding",
            labels={"figure": "contact pressure", "run": "{run}"},
        ),
        pdf=f"{FIGURES}/contact_maps.{{run}}.pdf",
    log:
        "results/study/logs/contact_maps.{run}.log",
    benchmark:
        "results/study/benchmarks/contact_maps.{run}.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=2000,
        runtime=10,
    params:
        **DRAWING,
        code=code("report"),
    script:
        "../scripts/contact_maps.py"


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
            f"{FIGURES}/{{measure}}.{{run}}.png",
            caption="../report/shape_maps.rst",
            category="Metrics",
            labels=lambda wildcards: {
                "figure": f"{wildcards.measure.removesuffix('_mm').replace('_', ' ')} maps",
                "run": wildcards.run,
            },
        ),
        pdf=f"{FIGURES}/{{measure}}.{{run}}.pdf",
    log:
        "results/study/logs/shape_maps.{measure}.{run}.log",
    benchmark:
        "results/study/benchmarks/shape_maps.{measure}.{run}.tsv"
    wildcard_constraints:
        measure="shape_index|curvedness|sulcal_depth_mm",
    conda:
        ENVIRONMENT
    resources:
        mem_mb=2000,
        runtime=10,
    params:
        **DRAWING,
        measured=lambda wildcards: CONFIG.measured_name(
            shown_beside(wildcards.run).values()
        ),
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


rule regions_figure:
    input:
        mesh=rules.regions.output.mesh,
        data=rules.regions.output.data,
        params=rules.parameters.output[0],
    output:
        png=report(
            f"{FIGURES}/growth_zone.{{run}}.png",
            caption="../report/growth_zone.rst",
            category="Folding",
            labels={"figure": "growth on the surface", "run": "{run}"},
        ),
        pdf=f"{FIGURES}/growth_zone.{{run}}.pdf",
        section_png=report(
            f"{FIGURES}/layers.{{run}}.png",
            caption="../report/layers.rst",
            category="Folding",
            labels={"figure": "regions and growth in sections", "run": "{run}"},
        ),
        section_pdf=f"{FIGURES}/layers.{{run}}.pdf",
        normals_png=report(
            f"{FIGURES}/normals.{{run}}.png",
            caption="../report/normals.rst",
            category="Folding",
            labels={"figure": "pial normals in sections", "run": "{run}"},
        ),
        normals_pdf=f"{FIGURES}/normals.{{run}}.pdf",
    log:
        "results/study/logs/regions_figure.{run}.log",
    benchmark:
        "results/study/benchmarks/regions_figure.{run}.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=2000,
        runtime=10,
    params:
        **DRAWING,
        code=code("report", "folding"),
    script:
        "../scripts/regions_figure.py"


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
