# Pial surfaces: from label volumes, hemisphere surfaces or closed surfaces to clean ones in RAS+ mm.
from gyriflow.cli.cost import surface_memory_mib

# how unequal and how asymmetric hemispheres may be
LIMITS = CONFIG.surface.model_dump(include={"max_hemisphere_ratio", "max_asymmetry"})


def surface_memory(wildcards):
    """Returns the memory in MiB that the labels of a brain may need, foreseen from their header."""
    brain = wildcards.brain
    return surface_memory_mib(PLAN.brains.label_volume(brain), PLAN.brains.week(brain))


def surface_settings(*names):
    """Returns the surface settings that one kind of data needs."""
    return CONFIG.surface.model_dump(include=set(names))


rule pial_from_labels:
    input:
        labels=of(PLAN.brains.label_volume),
    output:
        **PIAL,
    wildcard_constraints:
        brain=one_of(PLAN.brains.from_source("labels")),
    resources:
        mem_mb=surface_memory,
        runtime=30,
    params:
        **of_brain("week", "affine_from"),
        known=of(PLAN.brains.known_files),
        scheme=of(PLAN.brains.scheme),
        settings=surface_settings(
            "smoothing_voxels", "edge_length_mm", "smoothing_iterations", "fissure_mm"
        ),
    script:
        "../scripts/pial_from_labels.py"


rule cortical_thickness:
    input:
        labels=of(PLAN.brains.label_volume),
        surface=PIAL["whole"],
        report=PIAL["report"],
    output:
        **THICKNESS,
    wildcard_constraints:
        brain=one_of(PLAN.brains.with_cortex),
    resources:
        mem_mb=surface_memory,
        runtime=30,
    params:
        **of_brain("affine_from"),
        scheme=of(PLAN.brains.scheme),
        settings=surface_settings("smoothing_voxels"),
    script:
        "../scripts/cortical_thickness.py"


rule poses:
    input:
        [path for brain in PLAN.brains.to_pose for path in brain.files],
    output:
        [POSE.format(brain=brain.id) for brain in PLAN.brains.to_pose],
    resources:
        runtime=30,
    params:
        max_hole_mm=CONFIG.surface.max_hole_mm,
        limits=LIMITS,
    script:
        "../scripts/poses.py"


rule pial_from_hemispheres:
    input:
        left=lambda wildcards: CONFIG.brain(wildcards.brain).hemispheres.left,
        right=lambda wildcards: CONFIG.brain(wildcards.brain).hemispheres.right,
        pose=of(PLAN.brains.pose),
    output:
        **PIAL,
    wildcard_constraints:
        brain=one_of(PLAN.brains.from_source("hemispheres")),
    resources:
        mem_mb=4000,
        runtime=30,
    params:
        **of_brain("week", "coordinates"),
        known=of(PLAN.brains.known_files),
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
    wildcard_constraints:
        brain=one_of(PLAN.brains.from_source("pial")),
    resources:
        mem_mb=4000,
        runtime=30,
    params:
        **of_brain("week", "coordinates"),
        known=of(PLAN.brains.known_files),
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
    wildcard_constraints:
        brain=one_of(PLAN.brains.with_sides("left")),
    resources:
        mem_mb=4000,
        runtime=30,
    params:
        **of_brain("week", "coordinates", "affine_from"),
        side=lambda wildcards: CONFIG.brain(wildcards.brain).sides[0],
        scheme=of(PLAN.brains.scheme),
        settings=surface_settings("edge_length_mm", "smoothing_iterations"),
        of_labels=surface_settings("smoothing_voxels"),
        of_surfaces=surface_settings("max_hole_mm"),
    script:
        "../scripts/pial_from_hemisphere.py"


use rule pial_from_left_hemisphere as pial_from_right_hemisphere with:
    output:
        **pial_of("right"),
    wildcard_constraints:
        brain=one_of(PLAN.brains.with_sides("right")),


rule thickness_from_white:
    input:
        unpack(lambda wildcards: CONFIG.brain(wildcards.brain).white_files),
        surface=PIAL["whole"],
        report=PIAL["report"],
    output:
        **THICKNESS,
    wildcard_constraints:
        brain=one_of(PLAN.brains.with_white),
    resources:
        mem_mb=4000,
        runtime=30,
    params:
        white=lambda wildcards: CONFIG.brain(wildcards.brain).white_files,
    script:
        "../scripts/thickness_from_white.py"


rule pial_from_shape:
    input:
        SHAPE,
    output:
        **PIAL,
    wildcard_constraints:
        brain=one_of(PLAN.brains.from_source("shape")),
    params:
        **of_brain("week"),
    script:
        "../scripts/pial_from_shape.py"


rule surface:
    input:
        PLAN.brains.surfaces,
