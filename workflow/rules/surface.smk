# Pial surfaces in RAS+ mm, from label volumes, hemisphere surfaces or closed surfaces.
from itertools import product

from gyriflow.running.cost import surface_memory_mib

# rules that make pial surfaces, by name: source of the brains, and their hemispheres
PIAL_RULES = {
    "pial_from_labels": ("labels", SIDES),
    "pial_from_hemispheres": ("hemispheres", SIDES),
    "pial_from_surface": ("pial", SIDES),
    "pial_from_shape": ("shape", SIDES),
    "pial_from_left_hemisphere": ("hemisphere", ("left",)),
    "pial_from_right_hemisphere": ("hemisphere", ("right",)),
}
# no limits on unequal or asymmetric hemispheres with `surface.asymmetric`
LIMITS = (
    dict.fromkeys(("max_hemisphere_ratio", "max_asymmetry"), float("inf")) if CONFIG.surface.asymmetric else {}
)


def surface_memory(wildcards):
    """Return the memory (MiB) that a brain's surface may need; for labels it is estimated from their header."""
    brain = brain_of(wildcards)
    return surface_memory_mib(brain.labels.path, brain.week) if brain.labels else 4000


def surface_settings(*names):
    """Return the surface settings for one kind of data."""
    return CONFIG.surface.model_dump(include=set(names))


def pial_settings(wildcards):
    """Return the surface settings for the data of a brain."""
    brain = brain_of(wildcards)
    if brain.config.source == "shape":
        return {}
    if not brain.labels:
        return surface_settings("edge_length_mm", "max_hole_mm")
    return surface_settings("edge_length_mm", "open_sulci")


# a simple shape instead of a brain
rule shape:
    output:
        SHAPE,
    log:
        f"{BRAIN}/logs/shape.log",
    benchmark:
        f"{BRAIN}/benchmarks/shape.tsv"
    wildcard_constraints:
        brain=brains_with(lambda brain: brain.config.source == "shape"),
    conda:
        ENVIRONMENT
    params:
        shape=lambda w: brain_of(w).config.shape.model_dump(mode="json") | surface_settings("edge_length_mm"),
    script:
        "../scripts/shape.py"


# with the cortical thickness, if there are labels of the cortex or white surfaces
for (name, (source, sides)), (suffix, thickness) in product(
    PIAL_RULES.items(), {"": {}, "_with_thickness": THICKNESS}.items()
):

    rule:
        name:
            f"{name}{suffix}"
        input:
            given=[SHAPE] if source == "shape" else lambda w: brain_of(w).config.files,
            white=lambda w: list(brain_of(w).config.white_files.values()),
        output:
            **pial_of(*sides),
            **thickness,
        log:
            f"{BRAIN}/logs/{name}{suffix}.log",
        benchmark:
            f"{BRAIN}/benchmarks/{name}{suffix}.tsv"
        wildcard_constraints:
            brain=brains_with(
                lambda brain: (brain.config.source, brain.sides, brain.has_thickness)
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
            coordinates=lambda w: brain_of(w).config.coordinates,
            labels=lambda w: brain_of(w).labels,
            # also parameters, since swapped input files do not trigger a rerun
            white=lambda w: brain_of(w).config.white_files,
            checksums=lambda w: brain_of(w).checksums,
            settings=pial_settings,
            limits=LIMITS if source == "hemispheres" else {},
        script:
            "../scripts/pial.py"


rule surface:
    input:
        study.surfaces,
