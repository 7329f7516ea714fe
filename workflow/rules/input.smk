# Inputs that the workflow makes itself: synthetic brains.
rule phantom:
    output:
        "results/{brain}/surface/labels.nii.gz",
    log:
        "results/{brain}/logs/phantom.log",
    benchmark:
        "results/{brain}/benchmarks/phantom.tsv"
    wildcard_constraints:
        brain=one_of(brain.id for brain in CONFIG.brains if brain.phantom),
    conda:
        ENVIRONMENT
    resources:
        mem_mb=2000,
        runtime=10,
    params:
        week=lambda wildcards: CONFIG.brain(wildcards.brain).week,
        settings=lambda wildcards: CONFIG.brain(wildcards.brain).phantom.model_dump(),
        code=code("phantom"),
    script:
        "../scripts/phantom.py"
