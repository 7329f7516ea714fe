# Pial surfaces: from label volumes, hemisphere surfaces or closed surfaces to clean ones in RAS+ mm.
from itertools import product

from gyriflow.running.cost import surface_memory_mib

# the rules that make pial surfaces, by name: the source of the brains, and the hemispheres that they have
PIAL_RULES = {
    "pial_from_labels": ("labels", SIDES),
    "pial_from_hemispheres": ("hemispheres", SIDES),
    "pial_from_surface": ("pial", SIDES),
    "pial_from_shape": ("shape", SIDES),
    "pial_from_left_hemisphere": ("hemisphere", ("left",)),
    "pial_from_right_hemisphere": ("hemisphere", ("right",)),
}
# how unequal and how asymmetric hemispheres may be, besides what is usual
LIMITS = (
    dict.fromkeys(("max_hemisphere_ratio", "max_asymmetry"), float("inf")) if CONFIG.surface.asymmetric else {}
)


def surface_memory(wildcards):
    """Return the memory in MiB that a brain's surface may need, of labels foreseen from their header."""
    brain = brain_of(wildcards)
    return surface_memory_mib(brain.labels.path, brain.week) if brain.labels else 4000


def surface_settings(*names):
    """Return the surface settings that one kind of data needs."""
    return CONFIG.surface.model_dump(include=set(names))


def pial_settings(wildcards):
    """Return the surface settings that the data of a brain needs."""
    brain = brain_of(wildcards)
    if brain.given.source == "shape":
        return {}
    if not brain.labels:
        return surface_settings("edge_length_mm", "max_hole_mm")
    return surface_settings("edge_length_mm") | {"open_sulci": CONFIG.opens_sulci}


# a simple shape in the place of a brain
rule shape:
    output:
        SHAPE,
    log:
        f"{BRAIN}/logs/shape.log",
    benchmark:
        f"{BRAIN}/benchmarks/shape.tsv"
    wildcard_constraints:
        brain=brains_with(lambda brain: brain.given.source == "shape"),
    conda:
        ENVIRONMENT
    params:
        shape=lambda w: brain_of(w).given.shape.model_dump(mode="json") | surface_settings("edge_length_mm"),
    script:
        "../scripts/shape.py"


# with the thickness of the cortex, where labels of the cortex or white surfaces tell it
for (name, (source, sides)), (suffix, thickness) in product(
    PIAL_RULES.items(), {"": {}, "_with_thickness": THICKNESS}.items()
):

    rule:
        name:
            f"{name}{suffix}"
        input:
            given=[SHAPE] if source == "shape" else lambda w: brain_of(w).given.files,
            white=lambda w: list(brain_of(w).given.white_files.values()),
        output:
            **pial_of(*sides),
            **thickness,
        log:
            f"{BRAIN}/logs/{name}{suffix}.log",
        benchmark:
            f"{BRAIN}/benchmarks/{name}{suffix}.tsv"
        wildcard_constraints:
            brain=brains_with(
                lambda brain: (brain.given.source, brain.sides, brain.has_thickness)
                == (source, sides, bool(thickness))
            ),
        conda:
            ENVIRONMENT
        resources:
            mem_mb=surface_memory,
        params:
            source=source,
            week=lambda w: brain_of(w).week,
            side=sides[0] if len(sides) == 1 else None,
            coordinates=lambda w: brain_of(w).given.coordinates,
            labels=lambda w: brain_of(w).labels,
            # exchanged files are the same inputs to Snakemake
            white=lambda w: brain_of(w).given.white_files,
            checksums=lambda w: brain_of(w).checksums,
            settings=pial_settings,
            limits=LIMITS if source == "hemispheres" else {},
        script:
            "../scripts/pial.py"


rule surface:
    input:
        study.surfaces,
