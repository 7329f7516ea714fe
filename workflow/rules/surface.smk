# Pial surfaces in RAS+ mm, from label volumes, hemisphere surfaces or closed surfaces.
from gyriflow.running.cost import surface_memory_mib

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


def pial_source(wildcards):
    """Return the files that a brain's pial surface is made from, and the surface settings for such data."""
    brain = brain_of(wildcards)
    if brain.source == "shape":
        return [SHAPE.format(brain=brain.id)], {}
    if brain.labels:
        return [brain.labels.path], surface_settings("edge_length_mm", "open_sulci")
    return brain.config.files, surface_settings("edge_length_mm", "max_hole_mm")


# a simple shape instead of a brain
rule shape:
    output:
        SHAPE,
    wildcard_constraints:
        brain=brains_with(source="shape"),
    params:
        shape=lambda w: brain_of(w).config.shape.model_dump(mode="json") | surface_settings("edge_length_mm"),
    script:
        "../scripts/shape.py"


rule pial:
    input:
        given=lambda w: pial_source(w)[0],
        white=lambda w: list(brain_of(w).config.white_files.values()),
    output:
        **pial_of(*SIDES),
    log:
        f"{BRAIN}/logs/pial.log",
    wildcard_constraints:
        brain=brains_with(*SIDES, has_thickness=False),
    # before measuring: simulations wait for surfaces, and brains that cannot be read are known early
    priority: 1
    resources:
        mem_mb=surface_memory,
    params:
        source=lambda w: brain_of(w).source,
        week=lambda w: brain_of(w).week,
        side=lambda w: brain_of(w).sides[0] if len(brain_of(w).sides) == 1 else None,
        coordinates=lambda w: brain_of(w).config.coordinates,
        labels=lambda w: brain_of(w).labels,
        white=lambda w: brain_of(w).config.white_files,
        checksums=lambda w: brain_of(w).checksums,
        settings=lambda w: pial_source(w)[1],
        limits=lambda w: LIMITS if brain_of(w).source == "hemispheres" else {},
    script:
        "../scripts/pial.py"


use rule pial as pial_left with:
    output:
        **pial_of("left"),
    wildcard_constraints:
        brain=brains_with("left", has_thickness=False),


use rule pial as pial_right with:
    output:
        **pial_of("right"),
    wildcard_constraints:
        brain=brains_with("right", has_thickness=False),


# with the cortical thickness, if there are labels of the cortex or white surfaces
use rule pial as pial_with_thickness with:
    output:
        **pial_of(*SIDES),
        **THICKNESS,
    wildcard_constraints:
        brain=brains_with(*SIDES, has_thickness=True),


use rule pial as pial_left_with_thickness with:
    output:
        **pial_of("left"),
        **THICKNESS,
    wildcard_constraints:
        brain=brains_with("left", has_thickness=True),


use rule pial as pial_right_with_thickness with:
    output:
        **pial_of("right"),
        **THICKNESS,
    wildcard_constraints:
        brain=brains_with("right", has_thickness=True),


rule surface:
    input:
        study.surfaces,
