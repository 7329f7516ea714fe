# Pial surfaces: from label volumes, hemisphere surfaces or closed surfaces to clean ones in RAS+ mm.
from gyriflow.cli.cost import surface_memory_mib

# how unequal and how asymmetric hemispheres may be
LIMITS = CONFIG.surface.model_dump(include={"max_hemisphere_ratio", "max_asymmetry"})


def surface_memory(wildcards):
    """Returns the memory in MiB that the labels of a brain may need, foreseen from their header."""
    brain = study.brains[wildcards.brain]
    return surface_memory_mib(brain.label_volume, brain.week)


def surface_settings(*names):
    """Returns the surface settings that one kind of data needs."""
    return CONFIG.surface.model_dump(include=set(names))


rule pial_from_labels:
    input:
        labels=from_brain("label_volume"),
    output:
        **PIAL,
    wildcard_constraints:
        brain=brains_with(lambda brain: brain.given.source == "labels"),
    resources:
        mem_mb=surface_memory,
        runtime=30,
    params:
        week=from_brain("week"),
        affine_from=from_brain("given.affine_from"),
        known=from_brain("checksums"),
        scheme=from_brain("scheme"),
        settings=surface_settings(
            "smoothing_voxels", "edge_length_mm", "smoothing_iterations", "fissure_mm"
        ),
    script:
        "../scripts/pial_from_labels.py"


rule cortical_thickness:
    input:
        labels=from_brain("label_volume"),
        surface=PIAL["whole"],
        report=PIAL["report"],
    output:
        **THICKNESS,
    wildcard_constraints:
        brain=brains_with(lambda brain: brain.thickness_from == "labels"),
    resources:
        mem_mb=surface_memory,
        runtime=30,
    params:
        affine_from=from_brain("given.affine_from"),
        scheme=from_brain("scheme"),
        settings=surface_settings("smoothing_voxels"),
    script:
        "../scripts/cortical_thickness.py"


POSED = [brain for brain in study.brains.values() if brain.to_pose]


rule poses:
    input:
        [path for brain in POSED for path in brain.given.files],
    output:
        [brain.pose for brain in POSED],
    resources:
        runtime=30,
    params:
        max_hole_mm=CONFIG.surface.max_hole_mm,
        limits=LIMITS,
    script:
        "../scripts/poses.py"


rule pial_from_hemispheres:
    input:
        left=from_brain("given.hemispheres.left"),
        right=from_brain("given.hemispheres.right"),
        pose=from_brain("pose"),
    output:
        **PIAL,
    wildcard_constraints:
        brain=brains_with(lambda brain: brain.given.source == "hemispheres"),
    resources:
        mem_mb=4000,
        runtime=30,
    params:
        week=from_brain("week"),
        coordinates=from_brain("given.coordinates"),
        known=from_brain("checksums"),
        settings=surface_settings(
            "edge_length_mm", "smoothing_iterations", "max_hole_mm"
        ),
        limits=LIMITS,
    script:
        "../scripts/pial_from_hemispheres.py"


rule pial_from_surface:
    input:
        from_brain("given.pial"),
    output:
        **PIAL,
    wildcard_constraints:
        brain=brains_with(lambda brain: brain.given.source == "pial"),
    resources:
        mem_mb=4000,
        runtime=30,
    params:
        week=from_brain("week"),
        coordinates=from_brain("given.coordinates"),
        known=from_brain("checksums"),
        settings=surface_settings(
            "edge_length_mm", "smoothing_iterations", "max_hole_mm"
        ),
    script:
        "../scripts/pial_from_surface.py"


# of a hemisphere that is alone, from its surface or its labels
for side in SIDES:

    rule:
        name:
            f"pial_from_{side}_hemisphere"
        input:
            from_brain("given.hemisphere.file"),
        output:
            **pial_of(side),
        wildcard_constraints:
            brain=brains_with(lambda brain: brain.sides == (side,)),
        resources:
            mem_mb=4000,
            runtime=30,
        params:
            week=from_brain("week"),
            coordinates=from_brain("given.coordinates"),
            affine_from=from_brain("given.affine_from"),
            side=side,
            scheme=from_brain("scheme"),
            settings=surface_settings("edge_length_mm", "smoothing_iterations"),
            of_labels=surface_settings("smoothing_voxels"),
            of_surfaces=surface_settings("max_hole_mm"),
        script:
            "../scripts/pial_from_hemisphere.py"


rule thickness_from_white:
    input:
        unpack(from_brain("given.white_files")),
        surface=PIAL["whole"],
        report=PIAL["report"],
    output:
        **THICKNESS,
    wildcard_constraints:
        brain=brains_with(lambda brain: brain.thickness_from == "white"),
    resources:
        mem_mb=4000,
        runtime=30,
    params:
        white=from_brain("given.white_files"),
    script:
        "../scripts/thickness_from_white.py"


rule pial_from_shape:
    input:
        SHAPE,
    output:
        **PIAL,
    wildcard_constraints:
        brain=brains_with(lambda brain: brain.given.source == "shape"),
    params:
        week=from_brain("week"),
    script:
        "../scripts/pial_from_shape.py"


rule surface:
    input:
        study.surfaces,
