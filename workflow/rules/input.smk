# Inputs that the workflow makes: synthetic brains, simple shapes.
rule phantom:
    output:
        LABELS,
    wildcard_constraints:
        brain=one_of(PLAN.brains.from_source("phantom")),
    params:
        **of_brain("week"),
        settings=of(PLAN.brains.phantom),
        pathology=lambda wildcards: CONFIG.brain(wildcards.brain).phantom.pathology,
    script:
        "../scripts/phantom.py"


rule shape:
    output:
        SHAPE,
    wildcard_constraints:
        brain=one_of(PLAN.brains.from_source("shape")),
    params:
        shape=of(PLAN.brains.shape),
    script:
        "../scripts/shape.py"
