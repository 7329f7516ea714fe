# Pial surfaces: from label volumes, hemisphere surfaces or closed surfaces to clean ones in RAS+ mm.
from gyriflow.running.cost import surface_memory_mib

# how unequal and how asymmetric hemispheres may be, besides what is usual
LIMITS = (
    dict.fromkeys(("max_hemisphere_ratio", "max_asymmetry"), float("inf")) if CONFIG.surface.asymmetric else {}
)


def surface_memory(wildcards):
    """Return the memory in MiB that a brain's surface may need, of labels foreseen from their header."""
    brain = study.brains[wildcards.brain]
    return surface_memory_mib(brain.given.label_volume, brain.week) if brain.given.has_labels else 4000


def surface_settings(*names):
    """Return the surface settings that one kind of data needs."""
    return CONFIG.surface.model_dump(include=set(names))


def pial_settings(wildcards):
    """Return the surface settings that the data of a brain needs."""
    brain = study.brains[wildcards.brain]
    if brain.given.source == "shape":
        return {}
    if not brain.given.has_labels:
        return surface_settings("edge_length_mm", "max_hole_mm")
    return surface_settings("edge_length_mm") | {"open_sulci": CONFIG.opens_sulci}


# a simple shape in the place of a brain
rule shape:
    output:
        SHAPE,
    wildcard_constraints:
        brain=brains_with(lambda brain: brain.given.source == "shape"),
    params:
        shape=lambda w: study.brains[w.brain].given.shape.model_dump(mode="json")
        | surface_settings("edge_length_mm"),
    script:
        "../scripts/shape.py"


for name, (source, sides) in PIAL_RULES.items():

    rule:
        name:
            name
        input:
            SHAPE if source == "shape" else from_brain("given.files"),
        output:
            **pial_of(*sides),
        wildcard_constraints:
            brain=brains_with(lambda brain: brain.given.source == source and brain.sides == sides),
        resources:
            mem_mb=surface_memory,
        params:
            source=source,
            week=from_brain("week"),
            side=sides[0] if len(sides) == 1 else None,
            coordinates=from_brain("given.coordinates"),
            affine_from=from_brain("given.affine_from"),
            scheme=from_brain("scheme"),
            checksums=from_brain("checksums"),
            settings=pial_settings,
            limits=LIMITS if source == "hemispheres" else {},
        script:
            "../scripts/pial.py"


rule cortical_thickness:
    input:
        given=lambda w: list(study.brains[w.brain].thickness_from.values()),
        surface=PIAL["whole"],
        report=PIAL["report"],
    output:
        **THICKNESS,
    wildcard_constraints:
        brain=brains_with(lambda brain: brain.thickness_from),
    resources:
        mem_mb=surface_memory,
    params:
        # exchanged files are the same inputs to Snakemake
        given=from_brain("thickness_from"),
        affine_from=from_brain("given.affine_from"),
        scheme=from_brain("scheme"),
    script:
        "../scripts/thickness.py"


rule surface:
    input:
        study.surfaces,
