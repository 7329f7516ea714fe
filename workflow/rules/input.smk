# Inputs that the workflow makes: synthetic brains, simple shapes, labels from the user's own segmentation.
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


rule segmentation:
    input:
        lambda wildcards: CONFIG.brain(wildcards.brain).image,
    output:
        LABELS,
    wildcard_constraints:
        brain=one_of(PLAN.brains.from_source("segmentation")),
    resources:
        mem_mb=16000,
        runtime=240,
    params:
        **of_brain("affine_from"),
        command=lambda wildcards: CONFIG.brain(wildcards.brain).segmentation.command,
        scheme=of(PLAN.brains.scheme),
    script:
        "../scripts/segmentation.py"


rule shape:
    output:
        SHAPE,
    wildcard_constraints:
        brain=one_of(PLAN.brains.from_source("shape")),
    params:
        shape=of(PLAN.brains.shape),
    script:
        "../scripts/shape.py"
