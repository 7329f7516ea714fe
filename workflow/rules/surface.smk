# Pial surfaces: from label volumes, hemisphere surfaces or closed surfaces to clean ones in RAS+ mm.
from gyriflow.parameters.schemes import LabelScheme


def pial_of(*sides):
    """Returns the files that are made for every brain with some hemispheres, whatever its source."""
    return {
        **surfaces_in(f"{BRAIN}/surface", sides),
        "stl": f"{BRAIN}/surface/pial.stl",
        "report": f"{BRAIN}/surface/surface.json",
    }


PIAL = pial_of(*SIDES)
THICKNESS = {
    "thickness": f"{BRAIN}/surface/thickness.shape.gii",
    # not a number where it could not be measured
    "measured": f"{BRAIN}/surface/measured_thickness.shape.gii",
    "report": f"{BRAIN}/surface/thickness.json",
}
# brains whose labels give the cortical thickness
WITH_CORTEX = [
    brain.id
    for brain in CONFIG.brains
    if brain.has_labels and LabelScheme(**CONFIG.scheme(brain)).cortex
]
# brains of which white surfaces are given
WITH_WHITE = [brain.id for brain in CONFIG.brains if brain.white_files]
# how unequal and how asymmetric hemispheres may be
LIMITS = CONFIG.surface.model_dump(include={"max_hemisphere_ratio", "max_asymmetry"})
# hemispheres whose pose has to be found, for the whole study at once
TO_POSE = [
    brain
    for brain in CONFIG.brains
    if brain.source == "hemispheres" and brain.coordinates == "auto"
]


def surface_settings(*names):
    """Returns the surface settings that one kind of data needs."""
    return CONFIG.surface.model_dump(include=set(names))


def label_volume_of(brain):
    """Returns the label volume of a brain: the user's, or the one that the workflow makes."""
    own = CONFIG.brain(brain).label_volume
    return own or f"results/brains/{brain}/surface/labels.nii.gz"


def label_volume(wildcards):
    return label_volume_of(wildcards.brain)


def coordinates_of(wildcards):
    """Returns the axes of the coordinates in a brain's surface files."""
    return CONFIG.brain(wildcards.brain).coordinates


def pose_of(wildcards):
    """Returns the file with the pose of a brain's hemispheres, where it has to be found."""
    if wildcards.brain in [brain.id for brain in TO_POSE]:
        return f"results/brains/{wildcards.brain}/surface/pose.json"
    return []


rule pial_from_labels:
    input:
        labels=label_volume,
    output:
        **PIAL,
    log:
        f"{BRAIN}/logs/pial_from_labels.log",
    benchmark:
        f"{BRAIN}/benchmarks/pial_from_labels.tsv"
    wildcard_constraints:
        brain=from_source("labels", "segmentation", "phantom"),
    conda:
        ENVIRONMENT
    resources:
        mem_mb=4000,
        runtime=30,
    params:
        week=lambda wildcards: CONFIG.brain(wildcards.brain).week,
        affine_from=lambda wildcards: CONFIG.brain(wildcards.brain).affine_from,
        scheme=lambda wildcards: CONFIG.scheme(CONFIG.brain(wildcards.brain)),
        settings=surface_settings(
            "smoothing_voxels", "edge_length_mm", "smoothing_iterations", "fissure_mm"
        ),
    script:
        "../scripts/pial_from_labels.py"


rule cortical_thickness:
    input:
        labels=label_volume,
        surface=PIAL["whole"],
        report=PIAL["report"],
    output:
        **THICKNESS,
    log:
        f"{BRAIN}/logs/cortical_thickness.log",
    benchmark:
        f"{BRAIN}/benchmarks/cortical_thickness.tsv"
    wildcard_constraints:
        brain=one_of(WITH_CORTEX),
    conda:
        ENVIRONMENT
    resources:
        mem_mb=4000,
        runtime=30,
    params:
        affine_from=lambda wildcards: CONFIG.brain(wildcards.brain).affine_from,
        scheme=lambda wildcards: CONFIG.scheme(CONFIG.brain(wildcards.brain)),
        settings=surface_settings("smoothing_voxels"),
    script:
        "../scripts/cortical_thickness.py"


rule poses:
    input:
        [path for brain in TO_POSE for path in brain.files],
    output:
        [f"results/brains/{brain.id}/surface/pose.json" for brain in TO_POSE],
    log:
        f"{STUDY}/logs/poses.log",
    benchmark:
        f"{STUDY}/benchmarks/poses.tsv"
    conda:
        ENVIRONMENT
    resources:
        runtime=30,
    params:
        # exchanged files are the same inputs to Snakemake
        order=[path for brain in TO_POSE for path in brain.files],
        max_hole_mm=CONFIG.surface.max_hole_mm,
        limits=LIMITS,
    script:
        "../scripts/poses.py"


rule pial_from_hemispheres:
    input:
        left=lambda wildcards: CONFIG.brain(wildcards.brain).hemispheres.left,
        right=lambda wildcards: CONFIG.brain(wildcards.brain).hemispheres.right,
        pose=pose_of,
    output:
        **PIAL,
    log:
        f"{BRAIN}/logs/pial_from_hemispheres.log",
    benchmark:
        f"{BRAIN}/benchmarks/pial_from_hemispheres.tsv"
    wildcard_constraints:
        brain=from_source("hemispheres"),
    conda:
        ENVIRONMENT
    resources:
        mem_mb=4000,
        runtime=30,
    params:
        # exchanged files are the same inputs to Snakemake
        order=lambda wildcards: CONFIG.brain(wildcards.brain).files,
        week=lambda wildcards: CONFIG.brain(wildcards.brain).week,
        coordinates=coordinates_of,
        settings=surface_settings(
            "gap_mm", "edge_length_mm", "smoothing_iterations", "max_hole_mm"
        ),
        limits=LIMITS,
    script:
        "../scripts/pial_from_hemispheres.py"


rule pial_from_surface:
    input:
        lambda wildcards: CONFIG.brain(wildcards.brain).pial,
    output:
        **PIAL,
    log:
        f"{BRAIN}/logs/pial_from_surface.log",
    benchmark:
        f"{BRAIN}/benchmarks/pial_from_surface.tsv"
    wildcard_constraints:
        brain=from_source("pial"),
    conda:
        ENVIRONMENT
    resources:
        mem_mb=4000,
        runtime=30,
    params:
        week=lambda wildcards: CONFIG.brain(wildcards.brain).week,
        coordinates=coordinates_of,
        settings=surface_settings(
            "edge_length_mm", "smoothing_iterations", "max_hole_mm"
        ),
    script:
        "../scripts/pial_from_surface.py"


# of a hemisphere that is alone, from its surface or its labels
rule pial_from_left_hemisphere:
    input:
        lambda wildcards: CONFIG.brain(wildcards.brain).hemisphere.file,
    output:
        **pial_of("left"),
    log:
        f"{BRAIN}/logs/pial_from_hemisphere.log",
    benchmark:
        f"{BRAIN}/benchmarks/pial_from_left_hemisphere.tsv"
    wildcard_constraints:
        brain=one_of(with_sides("left")),
    conda:
        ENVIRONMENT
    resources:
        mem_mb=4000,
        runtime=30,
    params:
        side=lambda wildcards: sides_of(wildcards.brain)[0],
        week=lambda wildcards: CONFIG.brain(wildcards.brain).week,
        coordinates=coordinates_of,
        affine_from=lambda wildcards: CONFIG.brain(wildcards.brain).affine_from,
        scheme=lambda wildcards: (
            CONFIG.scheme(CONFIG.brain(wildcards.brain))
            if CONFIG.brain(wildcards.brain).has_labels
            else None
        ),
        settings=surface_settings("edge_length_mm", "smoothing_iterations"),
        of_labels=surface_settings("smoothing_voxels"),
        of_surfaces=surface_settings("max_hole_mm"),
    script:
        "../scripts/pial_from_hemisphere.py"


use rule pial_from_left_hemisphere as pial_from_right_hemisphere with:
    output:
        **pial_of("right"),
    benchmark:
        f"{BRAIN}/benchmarks/pial_from_right_hemisphere.tsv"
    wildcard_constraints:
        brain=one_of(with_sides("right")),


rule thickness_from_white:
    input:
        unpack(lambda wildcards: CONFIG.brain(wildcards.brain).white_files),
        surface=PIAL["whole"],
        report=PIAL["report"],
    output:
        **THICKNESS,
    log:
        f"{BRAIN}/logs/thickness_from_white.log",
    benchmark:
        f"{BRAIN}/benchmarks/thickness_from_white.tsv"
    wildcard_constraints:
        brain=one_of(WITH_WHITE),
    conda:
        ENVIRONMENT
    resources:
        mem_mb=4000,
        runtime=30,
    params:
        # exchanged files are the same inputs to Snakemake
        white=lambda wildcards: CONFIG.brain(wildcards.brain).white_files,
    script:
        "../scripts/thickness_from_white.py"


rule pial_from_shape:
    input:
        rules.shape.output[0],
    output:
        **PIAL,
    log:
        f"{BRAIN}/logs/pial_from_shape.log",
    benchmark:
        f"{BRAIN}/benchmarks/pial_from_shape.tsv"
    wildcard_constraints:
        brain=from_source("shape"),
    conda:
        ENVIRONMENT
    params:
        week=lambda wildcards: CONFIG.brain(wildcards.brain).week,
    script:
        "../scripts/pial_from_shape.py"


# brains with an image to compare the surface with
OVERLAID = [brain.id for brain in CONFIG.brains if brain.image]


rule overlay_figure:
    input:
        image=lambda wildcards: CONFIG.brain(wildcards.brain).image,
        surface=PIAL["whole"],
        report=PIAL["report"],
    output:
        **figure(
            f"{BRAIN}/figures/overlay",
            "surface over the image",
            "figure.rst",
            "Brains and growth",
            brain="{brain}",
        ),
    log:
        f"{BRAIN}/logs/overlay_figure.log",
    benchmark:
        f"{BRAIN}/benchmarks/overlay_figure.tsv"
    wildcard_constraints:
        brain=one_of(OVERLAID),
    conda:
        ENVIRONMENT
    params:
        caption=(
            "Outline of the pial surface of *{brain}* over the image that its labels belong to, in a "
            "coronal and an axial plane through the middle and a sagittal plane through one "
            "hemisphere."
        ),
        dpi=CONFIG.report.dpi,
        affine_from=lambda wildcards: CONFIG.brain(wildcards.brain).affine_from,
    script:
        "../scripts/overlay_figure.py"


rule surface:
    input:
        [
            expand(list(pial_of(*sides_of(brain)).values()), brain=brain)
            for brain in BRAINS
        ],
        expand(list(THICKNESS.values()), brain=[*WITH_CORTEX, *WITH_WHITE]),
