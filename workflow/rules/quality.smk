# Figures of each measured brain, made before simulations: quality control with a verdict, maps and small pictures.
def quality_columns(name):
    """Return the columns of the quality table that come from the configuration, also of a refused brain."""
    given = CONFIG.brain(name)
    known = {key: getattr(given, key) for key in ("week", "population", "source")}
    page = f"{BRAIN}/figures/quality.png".format(brain=name)
    return {"subject": name, **known, "sides": " ".join(given.sides), "page": page}


rule brain_figures:
    input:
        surface=PIAL["whole"],
        report=PIAL["report"],
        labels=lambda w: BRAINS[w.brain].labels or [],
        image=lambda w: BRAINS[w.brain].image or [],
        white=lambda w: list(BRAINS[w.brain].white_files.values()),
        thickness=lambda w: BRAINS[w.brain].thickness or [],
        measured=lambda w: THICKNESS["summary"].format(brain=w.brain) if BRAINS[w.brain].thickness else [],
        hemispheres=lambda w: BRAINS[w.brain].hemispheres,
        maps=lambda w: BRAINS[w.brain].maps,
    output:
        quality=f"{BRAIN}/figures/quality.png",
        quality_pdf=f"{BRAIN}/figures/quality.pdf",
        depth=f"{BRAIN}/figures/depth.png",
        depth_pdf=f"{BRAIN}/figures/depth.pdf",
        maps=f"{BRAIN}/figures/shape_index.png",
        maps_pdf=f"{BRAIN}/figures/shape_index.pdf",
        small=f"{BRAIN}/figures/small.png",
        small_pdf=f"{BRAIN}/figures/small.pdf",
        row=f"{BRAIN}/quality.json",
    params:
        white_files=lambda w: BRAINS[w.brain].white_files,
        labels=lambda w: label_source(CONFIG, BRAINS[w.brain]),
        columns=lambda w: quality_columns(w.brain),
        sides=lambda w: BRAINS[w.brain].sides,
        log=lambda w: f"{BRAIN}/logs/pial.log".format(brain=w.brain),
    script:
        "../scripts/brain_figures.py"


# refused brains, and rows of a table that cannot be used
WITHOUT_SURFACE = [row for row in study.left_out.values() if row.why != "not folded"]


def left_out_row(row):
    """Return the row of the quality table of a brain that was left out, with the cause."""
    if row.why == "cannot be used":
        return {"subject": row.brain, "week": row.week, "cause": row.cause}
    return quality_columns(row.brain) | {"cause": row.cause, "page": None}


rule quality_table:
    input:
        expand(rules.brain_figures.output.row, brain=BRAINS),
    output:
        f"{STUDY}/quality.csv",
    params:
        left_out=list(map(left_out_row, WITHOUT_SURFACE)),
        # rows of a table that cannot be used come last
        order=[brain.id for brain in CONFIG.brains],
    script:
        "../scripts/quality_table.py"


rule quality:
    input:
        expand(rules.brain_figures.output.row, brain=BRAINS),
        rules.quality_table.output,
