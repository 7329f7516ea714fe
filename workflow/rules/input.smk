# Inputs that the workflow makes: synthetic brains, simple shapes, labels from the user's own segmentation.
def shape_settings(wildcards):
    """Returns what a shape depends on, without the sizes of other kinds."""
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
        f"{BRAIN}/surface/labels.nii.gz",
    log:
        f"{BRAIN}/logs/phantom.log",
    benchmark:
        f"{BRAIN}/benchmarks/phantom.tsv"
    wildcard_constraints:
        brain=from_source("phantom"),
    conda:
        ENVIRONMENT
    params:
        week=lambda wildcards: CONFIG.brain(wildcards.brain).week,
        settings=lambda wildcards: CONFIG.brain(wildcards.brain).phantom.model_dump(
            exclude={"pathology"}
        ),
        pathology=lambda wildcards: CONFIG.brain(wildcards.brain).phantom.pathology,
    script:
        "../scripts/phantom.py"


rule segmentation:
    input:
        lambda wildcards: CONFIG.brain(wildcards.brain).image,
    output:
        f"{BRAIN}/surface/labels.nii.gz",
    log:
        f"{BRAIN}/logs/segmentation.log",
    benchmark:
        f"{BRAIN}/benchmarks/segmentation.tsv"
    wildcard_constraints:
        brain=from_source("segmentation"),
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
    script:
        "../scripts/segmentation.py"


rule shape:
    output:
        f"{BRAIN}/surface/shape.surf.gii",
    log:
        f"{BRAIN}/logs/shape.log",
    benchmark:
        f"{BRAIN}/benchmarks/shape.tsv"
    wildcard_constraints:
        brain=from_source("shape"),
    conda:
        ENVIRONMENT
    params:
        shape=shape_settings,
    script:
        "../scripts/shape.py"
