# Pial surfaces: from label volumes, hemisphere surfaces or closed surfaces to clean ones in RAS+ mm.
from gyriflow.surface.labels import label_scheme

SURFACE_SETTINGS = {
    "labels": (
        "smoothing_voxels",
        "edge_length_mm",
        "smoothing_iterations",
        "fissure_mm",
    ),
    "hemispheres": ("gap_mm", "edge_length_mm", "smoothing_iterations", "max_hole_mm"),
    "hemisphere": ("edge_length_mm", "smoothing_iterations", "max_hole_mm"),
    "hemisphere labels": ("smoothing_voxels", "edge_length_mm", "smoothing_iterations"),
    "pial": ("edge_length_mm", "smoothing_iterations", "max_hole_mm"),
    # made with the edge length that they keep
    "shape": (),
}
MADE_INPUTS = {
    "phantom": "labels.nii.gz",
    "segmentation": "labels.nii.gz",
    "shape": "shape.surf.gii",
}
# brains of which labels of the cortex give its thickness
WITH_CORTEX = [
    brain.id
    for brain in CONFIG.brains
    if brain.source in ("labels", "segmentation", "phantom")
    and label_scheme(**CONFIG.scheme(brain)).cortex
    or brain.source in ("hemispheres", "pial")
    and brain.white_files
]
# brains of one hemisphere, by its side
ONE_SIDED = {
    side: [b.id for b in CONFIG.brains if b.hemisphere and b.hemisphere.side == side]
    for side in ("left", "right")
}
WITHOUT_CORTEX = [
    brain
    for brain in BRAINS
    if brain not in (*WITH_CORTEX, *ONE_SIDED["left"], *ONE_SIDED["right"])
]
# hemispheres whose pose is to be found, for all of a study at once
TO_POSE = [
    brain
    for brain in CONFIG.brains
    if brain.source == "hemispheres" and brain.coordinates == "auto"
]


LIMITS = CONFIG.surface.model_dump(include={"max_hemisphere_ratio", "max_asymmetry"})


def surface_files(wildcards):
    brain = CONFIG.brain(wildcards.brain)
    return brain.files or [f"results/{brain.id}/surface/{MADE_INPUTS[brain.source]}"]


def surface_source(wildcards):
    """Returns what the surface is made from; phantoms and segmentations are label volumes."""
    source = CONFIG.brain(wildcards.brain).source
    return "labels" if source in ("phantom", "segmentation") else source


def surface_settings(wildcards):
    """Returns the settings that matter for the brain's kind of data."""
    kind = surface_source(wildcards)
    labels = " labels" if kind == "hemisphere" and surface_scheme(wildcards) else ""
    chosen = SURFACE_SETTINGS[kind + labels]
    return CONFIG.surface.model_dump(include=set(chosen))


def surface_reading(wildcards):
    """Returns how the brain's files are to be understood."""
    brain = CONFIG.brain(wildcards.brain)
    match surface_source(wildcards):
        case "labels":
            return {"affine_from": brain.affine_from}
        case "shape":
            return {}
        case "hemisphere" if brain.scheme:
            return {"affine_from": brain.affine_from}
        case _:
            return {"coordinates": brain.coordinates}


def surface_scheme(wildcards):
    """Returns what the labels of the brain's volume mean; None where it is given by surfaces."""
    brain = CONFIG.brain(wildcards.brain)
    from_volume = surface_source(wildcards) == "labels" or brain.scheme
    return CONFIG.scheme(brain) if from_volume else None


def surface_side(wildcards):
    """Returns the side of a brain that has one hemisphere; None for others."""
    one = CONFIG.brain(wildcards.brain).hemisphere
    return one.side if one else None


def poses_of(wildcards):
    """Returns the file with the pose of a brain, where it has to be found."""
    if wildcards.brain in [brain.id for brain in TO_POSE]:
        return f"results/{wildcards.brain}/surface/pose.json"
    return []


rule poses:
    input:
        [path for brain in TO_POSE for path in brain.files],
    output:
        [f"results/{brain.id}/surface/pose.json" for brain in TO_POSE],
    log:
        "results/study/logs/poses.log",
    benchmark:
        "results/study/benchmarks/poses.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=2000,
        runtime=30,
    params:
        # exchanged files are the same inputs to Snakemake
        order=[path for brain in TO_POSE for path in brain.files],
        max_hole_mm=CONFIG.surface.max_hole_mm,
        limits=LIMITS,
        code=code("surface"),
    script:
        "../scripts/poses.py"


rule pial_surface:
    input:
        brain=surface_files,
        pose=poses_of,
        white=lambda wildcards: list(CONFIG.brain(wildcards.brain).white_files.values()),
    output:
        whole="results/{brain}/surface/pial.surf.gii",
        left="results/{brain}/surface/left.pial.surf.gii",
        right="results/{brain}/surface/right.pial.surf.gii",
        stl="results/{brain}/surface/pial.stl",
        report="results/{brain}/surface/surface.json",
        thickness="results/{brain}/surface/thickness.shape.gii",
    log:
        "results/{brain}/logs/pial_surface.log",
    benchmark:
        "results/{brain}/benchmarks/pial_surface.tsv"
    wildcard_constraints:
        brain=one_of(WITH_CORTEX),
    conda:
        ENVIRONMENT
    resources:
        mem_mb=4000,
        runtime=30,
    params:
        order=surface_files,
        source=surface_source,
        week=lambda wildcards: CONFIG.brain(wildcards.brain).week,
        reading=surface_reading,
        scheme=surface_scheme,
        settings=surface_settings,
        side=surface_side,
        white=lambda wildcards: CONFIG.brain(wildcards.brain).white_files,
        limits=lambda wildcards: (
            LIMITS if surface_source(wildcards) == "hemispheres" else None
        ),
        code=code("surface"),
    script:
        "../scripts/pial_surface.py"


use rule pial_surface as pial_surface_alone with:
    output:
        whole="results/{brain}/surface/pial.surf.gii",
        left="results/{brain}/surface/left.pial.surf.gii",
        right="results/{brain}/surface/right.pial.surf.gii",
        stl="results/{brain}/surface/pial.stl",
        report="results/{brain}/surface/surface.json",
    benchmark:
        "results/{brain}/benchmarks/pial_surface_alone.tsv"
    wildcard_constraints:
        brain=one_of(WITHOUT_CORTEX),


use rule pial_surface as pial_surface_of_left with:
    output:
        whole="results/{brain}/surface/pial.surf.gii",
        left="results/{brain}/surface/left.pial.surf.gii",
        stl="results/{brain}/surface/pial.stl",
        report="results/{brain}/surface/surface.json",
    benchmark:
        "results/{brain}/benchmarks/pial_surface_of_left.tsv"
    wildcard_constraints:
        brain=one_of(ONE_SIDED["left"]),


use rule pial_surface as pial_surface_of_right with:
    output:
        whole="results/{brain}/surface/pial.surf.gii",
        right="results/{brain}/surface/right.pial.surf.gii",
        stl="results/{brain}/surface/pial.stl",
        report="results/{brain}/surface/surface.json",
    benchmark:
        "results/{brain}/benchmarks/pial_surface_of_right.tsv"
    wildcard_constraints:
        brain=one_of(ONE_SIDED["right"]),


rule surface:
    input:
        expand(rules.pial_surface.output, brain=WITH_CORTEX),
        expand(rules.pial_surface_alone.output, brain=WITHOUT_CORTEX),
        expand(rules.pial_surface_of_left.output, brain=ONE_SIDED["left"]),
        expand(rules.pial_surface_of_right.output, brain=ONE_SIDED["right"]),
