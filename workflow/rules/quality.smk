# Quality control before the solve: a page and a verdict for each brain, and the warnings of all steps.
# the step that makes the surface, by the source of a brain, as its log is called
PIAL_STEPS = {
    **dict.fromkeys(("labels", "segmentation", "phantom"), "pial_from_labels"),
    "hemispheres": "pial_from_hemispheres",
    "hemisphere": "pial_from_hemisphere",
    "pial": "pial_from_surface",
    "shape": "pial_from_shape",
}


def quality_labels(brain):
    """Returns what the table of quality says of a brain before it is looked at."""
    settings = WHOLE_CONFIG.brain(brain)
    return {
        "subject": brain,
        "week": settings.week,
        "population": settings.population,
        "source": settings.source,
        "sides": " ".join(settings.sides),
        "page": f"results/brains/{brain}/figures/quality.png",
    }


def thickness_files(name):
    """Returns an input function: a file of the cortical thickness, where it is known."""
    return lambda wildcards: (
        THICKNESS[name] if wildcards.brain in (*WITH_CORTEX, *WITH_WHITE) else []
    )


rule quality_page:
    input:
        surface=PIAL["whole"],
        report=PIAL["report"],
        labels=lambda wildcards: (
            label_volume(wildcards) if CONFIG.brain(wildcards.brain).has_labels else []
        ),
        image=lambda wildcards: CONFIG.brain(wildcards.brain).image or [],
        white=lambda wildcards: list(CONFIG.brain(wildcards.brain).white_files.values()),
        thickness=thickness_files("measured"),
        measured=thickness_files("report"),
    output:
        **figure(
            f"{BRAIN}/figures/quality",
            "quality of the brain",
            "figure.rst",
            "Quality of the brains",
            brain="{brain}",
        ),
        row=f"{BRAIN}/quality.json",
    log:
        f"{BRAIN}/logs/quality_page.log",
    benchmark:
        f"{BRAIN}/benchmarks/quality_page.tsv"
    conda:
        ENVIRONMENT
    params:
        **drawing(),
        caption=(
            "Quality of *{brain}* before the solve: (a) the pial surface and the inner border of the cortex over the "
            "image or the labels, (b) the surface from several sides, (c) cortical thickness where it is known, else "
            "further sides, and what the steps have warned of."
        ),
        title=lambda wildcards: (
            f"{wildcards.brain}, {CONFIG.brain(wildcards.brain).week:g} GW"
        ),
        labels=lambda wildcards: quality_labels(wildcards.brain),
        white=lambda wildcards: CONFIG.brain(wildcards.brain).white_files,
        affine_from=lambda wildcards: CONFIG.brain(wildcards.brain).affine_from,
        scheme=lambda wildcards: (
            CONFIG.scheme(CONFIG.brain(wildcards.brain))
            if CONFIG.brain(wildcards.brain).has_labels
            else None
        ),
        logs=lambda wildcards: [
            f"results/brains/{wildcards.brain}/logs/{name}.log"
            for name in (
                PIAL_STEPS[CONFIG.brain(wildcards.brain).source],
                "cortical_thickness",
                "thickness_from_white",
            )
        ],
    script:
        "../scripts/quality_page.py"


rule quality_table:
    input:
        expand(rules.quality_page.output.row, brain=BRAINS),
    output:
        csv=f"{STUDY}/quality.csv",
        table=report(
            f"{STUDY}/quality.html",
            caption="../report/quality_table.rst",
            category="Quality of the brains",
            labels={"figure": "verdicts"},
        ),
    log:
        f"{STUDY}/logs/quality_table.log",
    benchmark:
        f"{STUDY}/benchmarks/quality_table.tsv"
    conda:
        ENVIRONMENT
    params:
        refused=[
            quality_labels(brain) | {"cause": cause, "page": None}
            for brain, cause in REFUSED.items()
        ]
        + [{"subject": row, **said} for row, said in WHOLE_CONFIG.left_out.items()],
        order=[*(brain.id for brain in WHOLE_CONFIG.brains), *WHOLE_CONFIG.left_out],
    script:
        "../scripts/quality_table.py"


# logs are no inputs: what has warned is known once all is done
rule study_warnings:
    input:
        rules.figures.input,
        rules.metrics.input,
        rules.quality_table.output,
    output:
        f"{STUDY}/warnings.csv",
    log:
        f"{STUDY}/logs/study_warnings.log",
    benchmark:
        f"{STUDY}/benchmarks/study_warnings.tsv"
    conda:
        ENVIRONMENT
    params:
        brains=[brain.id for brain in WHOLE_CONFIG.brains],
        folded=FOLDED,
    script:
        "../scripts/study_warnings.py"


rule quality:
    input:
        expand(rules.quality_page.output, brain=BRAINS),
        rules.quality_table.output,
