# Figures of the whole study: PNG, marked for the report, and PDF.
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
        gates=MESH_GATES,
        code=code("report"),
    script:
        "../scripts/quality_figure.py"


# of a mesh that did not pass the gates; made when asked for
use rule quality_figure as refused_quality_figure with:
    input:
        f"results/{START}/mesh/refused/quality.json",
    output:
        png=f"results/{START}/mesh/refused/quality.png",
        pdf=f"results/{START}/mesh/refused/quality.pdf",
    log:
        f"results/{START}/logs/refused_quality_figure.log",
    benchmark:
        f"results/{START}/benchmarks/refused_quality_figure.tsv"


# brains with an image that their surface can be compared with
OVERLAID = [brain.id for brain in CONFIG.brains if brain.image]


rule overlay_figure:
    input:
        image=lambda wildcards: CONFIG.brain(wildcards.brain).image,
        surface="results/{brain}/surface/pial.surf.gii",
        report="results/{brain}/surface/surface.json",
    output:
        png=report(
            f"{FIGURES}/overlay.{{brain}}.png",
            caption="../report/overlay.rst",
            category="Brains and growth",
            labels={"figure": "surface over the image", "brain": "{brain}"},
        ),
        pdf=f"{FIGURES}/overlay.{{brain}}.pdf",
    log:
        "results/study/logs/overlay_figure.{brain}.log",
    benchmark:
        "results/study/benchmarks/overlay_figure.{brain}.tsv"
    wildcard_constraints:
        brain=one_of(OVERLAID),
    conda:
        ENVIRONMENT
    resources:
        mem_mb=2000,
        runtime=10,
    params:
        dpi=CONFIG.report.dpi,
        affine_from=lambda wildcards: CONFIG.brain(wildcards.brain).affine_from,
        title=lambda wildcards: f"{wildcards.brain}, {CONFIG.brain(wildcards.brain).week:g} GW",
        code=code("report"),
    script:
        "../scripts/overlay_figure.py"


rule runs_figure:
    input:
        runs=[file for run in RUNS for file in folded(run, weeks=[LAST_WEEK])],
        real=expand("results/{brain}/surface/pial.surf.gii", brain=LAST_BRAINS),
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
        measured=CONFIG.measured_name(LAST_BRAINS),
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
    rules.regions_figure,
    rules.steps_figure,
]
# runs that write the pressure between their folds
PRESSED = [
    run
    for run in RUNS
    if "contact_pressure" in CONFIG.runs[run].fields
    and CONFIG.runs[run].contact.kind == "global"
]
SHAPE_MEASURES = ["shape_index", "curvedness", "sulcal_depth_mm"]


rule figures:
    input:
        rules.metrics_figure.output,
        rules.spectra_figure.output,
        rules.bands_figure.output,
        rules.displacement_figure.output,
        rules.age_profile_figure.output if CONFIG.age_reference else [],
        rules.quality_figure.output,
        expand(rules.overlay_figure.output, brain=OVERLAID),
        [
            expand(rule.output, run=RUNS, measure=SHAPE_MEASURES)
            for rule in SINGLE_RUN_FIGURES
        ],
        expand(rules.contact_maps.output, run=PRESSED),
        rules.runs_figure.output if len(RUNS) > 1 else [],
        rules.growth.input,


# the figures and tables of the paper that this study's data allow
rule paper:
    input:
        rules.growth.input,
        [
            expand(rule.output, run=RUNS, measure=SHAPE_MEASURES)
            for rule in (
                rules.weekly_figure,
                rules.displacement_maps,
                rules.shape_maps,
                rules.zones_figure,
                rules.regions_figure,
            )
        ],
        rules.displacement_figure.output,
        rules.spectra_figure.output,
        rules.bands_figure.output,
        rules.runs_figure.output if len(RUNS) > 1 else [],
