# Inputs that the workflow makes: synthetic brains, simple shapes, labels of the user's own segmentation.
def shape_settings(wildcards):
    """Returns what a shape depends on; sizes of other kinds are no part of it."""
    shape = CONFIG.brain(wildcards.brain).shape
    return {
        "kind": shape.kind,
        "size_mm": list(shape.size_mm),
        "noise_mm": shape.noise_mm,
        "seed": shape.seed,
        "edge_length_mm": CONFIG.surface.edge_length_mm,
    }


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


rule segmentation:
    input:
        lambda wildcards: CONFIG.brain(wildcards.brain).image,
    output:
        "results/{brain}/surface/labels.nii.gz",
    log:
        "results/{brain}/logs/segmentation.log",
    benchmark:
        "results/{brain}/benchmarks/segmentation.tsv"
    wildcard_constraints:
        brain=one_of(brain.id for brain in CONFIG.brains if brain.segmentation),
    conda:
        ENVIRONMENT
    resources:
        mem_mb=16000,
        runtime=240,
    params:
        command=lambda wildcards: CONFIG.brain(wildcards.brain).segmentation.command,
        container=lambda wildcards: CONFIG.brain(wildcards.brain).segmentation.container,
        affine_from=lambda wildcards: CONFIG.brain(wildcards.brain).affine_from,
        scheme=lambda wildcards: CONFIG.scheme(CONFIG.brain(wildcards.brain)),
        code=code("surface"),
    script:
        "../scripts/segmentation.py"


rule shape:
    output:
        "results/{brain}/surface/shape.surf.gii",
    log:
        "results/{brain}/logs/shape.log",
    benchmark:
        "results/{brain}/benchmarks/shape.tsv"
    wildcard_constraints:
        brain=one_of(brain.id for brain in CONFIG.brains if brain.shape),
    conda:
        ENVIRONMENT
    resources:
        mem_mb=2000,
        runtime=10,
    params:
        shape=shape_settings,
        code=code("phantom"),
    script:
        "../scripts/shape.py"
