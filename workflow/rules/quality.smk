# Quality control before the solve: a page and a verdict for each brain.
rule quality_page:
    input:
        unpack(from_brain("quality_files")),
    output:
        png=f"{BRAIN}/figures/quality.png",
        pdf=f"{BRAIN}/figures/quality.pdf",
        row=f"{BRAIN}/quality.json",
    log:
        f"{BRAIN}/logs/quality_page.log",
    benchmark:
        f"{BRAIN}/benchmarks/quality_page.tsv"
    conda:
        ENVIRONMENT
    params:
        white_files=from_brain("given.white_files"),
        affine_from=from_brain("given.affine_from"),
        labels=lambda w: study.quality_labels(w.brain),
        scheme=from_brain("scheme"),
        logs=from_brain("surface_logs"),
    script:
        "../scripts/quality_page.py"


rule quality_table:
    input:
        expand(rules.quality_page.output.row, brain=study.brains),
    output:
        f"{STUDY}/quality.csv",
    log:
        f"{STUDY}/logs/quality_table.log",
    benchmark:
        f"{STUDY}/benchmarks/quality_table.tsv"
    conda:
        ENVIRONMENT
    params:
        refused=study.refused_rows(REFUSED),
        order=[*(brain.id for brain in CONFIG.brains), *CONFIG.left_out],
    script:
        "../scripts/quality_table.py"


rule quality:
    input:
        expand(list(rules.quality_page.output), brain=study.brains),
        rules.quality_table.output,
