# Quality control before the solve: a page and a verdict for each brain, and the warnings of all steps.
REPORTING = PLAN.reporting(WHOLE_CONFIG)


rule quality_page:
    input:
        unpack(of(REPORTING.looked_at)),
    output:
        png=f"{BRAIN}/figures/quality.png",
        pdf=f"{BRAIN}/figures/quality.pdf",
        row=f"{BRAIN}/quality.json",
    params:
        **of_brain("week", "synthetic", "white_files", "affine_from"),
        labels=of(REPORTING.labels),
        scheme=of(PLAN.brains.scheme),
        logs=of(REPORTING.logs),
        dpi=CONFIG.report.dpi,
    script:
        "../scripts/quality_page.py"


rule quality_table:
    input:
        expand(rules.quality_page.output.row, brain=PLAN.brains.ids),
    output:
        f"{STUDY}/quality.csv",
    params:
        refused=REPORTING.refused(REFUSED),
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
    params:
        brains=[brain.id for brain in WHOLE_CONFIG.brains],
        folded=PLAN.runs.folded,
    script:
        "../scripts/study_warnings.py"


rule quality:
    input:
        expand(list(rules.quality_page.output), brain=PLAN.brains.ids),
        rules.quality_table.output,
