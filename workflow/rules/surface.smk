# Pial surfaces: from label volumes, hemisphere surfaces or closed surfaces to clean ones in RAS+ mm.
SURFACE_SETTINGS = {
    "labels": (
        "smoothing_voxels",
        "edge_length_mm",
        "smoothing_iterations",
        "fissure_mm",
    ),
    "hemispheres": ("gap_mm", "edge_length_mm", "smoothing_iterations", "max_hole_mm"),
    "pial": ("edge_length_mm", "smoothing_iterations", "max_hole_mm"),
    # made with the edge length that they keep
    "shape": (),
}
MADE_INPUTS = {"phantom": "labels.nii.gz", "shape": "shape.surf.gii"}


def surface_files(wildcards):
    brain = CONFIG.brain(wildcards.brain)
    return brain.files or [f"results/{brain.id}/surface/{MADE_INPUTS[brain.source]}"]


def surface_source(wildcards):
    """Returns what the surface is made from; a phantom is a label volume."""
    source = CONFIG.brain(wildcards.brain).source
    return "labels" if source == "phantom" else source


def surface_settings(wildcards):
    """Returns the settings that matter for the brain's kind of data."""
    chosen = SURFACE_SETTINGS[surface_source(wildcards)]
    return CONFIG.surface.model_dump(include=set(chosen))


def surface_reading(wildcards):
    """Returns how the brain's files are to be understood."""
    brain = CONFIG.brain(wildcards.brain)
    match surface_source(wildcards):
        case "labels":
            return {
                "scheme": brain.scheme or "spina-bifida-atlas",
                "affine_from": brain.affine_from,
            }
        case "shape":
            return {}
        case _:
            return {"coordinates": brain.coordinates}


rule pial_surface:
    input:
        surface_files,
    output:
        whole="results/{brain}/surface/pial.surf.gii",
        left="results/{brain}/surface/left.pial.surf.gii",
        right="results/{brain}/surface/right.pial.surf.gii",
        stl="results/{brain}/surface/pial.stl",
        report="results/{brain}/surface/surface.json",
    log:
        "results/{brain}/logs/pial_surface.log",
    benchmark:
        "results/{brain}/benchmarks/pial_surface.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=4000,
        runtime=30,
    params:
        source=surface_source,
        week=lambda wildcards: CONFIG.brain(wildcards.brain).week,
        reading=surface_reading,
        settings=surface_settings,
        code=code("surface"),
    script:
        "../scripts/pial_surface.py"


rule surface:
    input:
        expand(rules.pial_surface.output, brain=BRAINS),
