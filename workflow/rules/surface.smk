# Pial surfaces in RAS+ mm, from label volumes, hemisphere surfaces or closed surfaces.
from gyriflow.running.cost import surface_memory_mib

# no limits on unequal or asymmetric hemispheres with `surface.asymmetric`
LIMITS = (
    dict.fromkeys(("max_hemisphere_ratio", "max_asymmetry"), float("inf")) if CONFIG.surface.asymmetric else {}
)


def surface_memory(wildcards):
    """Return the memory (MiB) that a brain's surface may need; for labels it is estimated from their header."""
    brain = BRAINS[wildcards.brain]
    return surface_memory_mib(brain.labels, brain.week) if brain.labels else 4000


# settings that matter for a brain, by its source
LABEL_SETTINGS = CONFIG.surface.model_dump(include={"edge_length_mm", "open_sulci"})
EDGE_LENGTH = {"edge_length_mm": CONFIG.surface.edge_length_mm}


def pial_settings(brain):
    """Return the surface settings for the source of a brain; a shape has none."""
    if brain.shape:
        return {}
    return LABEL_SETTINGS if brain.labels else EDGE_LENGTH


# a simple shape instead of a brain
rule shape:
    output:
        SHAPE,
    wildcard_constraints:
        brain=brains_where(lambda brain: brain.shape),
    params:
        shape=lambda w: BRAINS[w.brain].shape.model_dump(mode="json") | EDGE_LENGTH,
    script:
        "../scripts/shape.py"


# one rule for each of six kinds of brains, by hemispheres and thickness, as outputs differ. given: the file that
# params.labels reads, or surfaces
rule pial:
    input:
        given=lambda w: BRAINS[w.brain].files or [SHAPE.format(brain=w.brain)],
        white=lambda w: list(BRAINS[w.brain].white_files.values()),
    output:
        **pial_of(*SIDES),
    log:
        f"{BRAIN}/logs/pial.log",
    wildcard_constraints:
        brain=brains_where(lambda brain: brain.sides == SIDES and not brain.thickness),
    # before measuring: simulations wait for surfaces, and brains that cannot be read are known early
    priority: 1
    resources:
        mem_mb=surface_memory,
    params:
        source=lambda w: BRAINS[w.brain].source,
        week=lambda w: BRAINS[w.brain].week,
        side=lambda w: BRAINS[w.brain].sides[0] if len(BRAINS[w.brain].sides) == 1 else None,
        coordinates=lambda w: BRAINS[w.brain].coordinates,
        labels=lambda w: label_source(CONFIG, BRAINS[w.brain]),
        white=lambda w: BRAINS[w.brain].white_files,
        checksums=lambda w: BRAINS[w.brain].checksums,
        settings=lambda w: pial_settings(BRAINS[w.brain]),
        limits=lambda w: LIMITS if BRAINS[w.brain].source == "hemispheres" else {},
    script:
        "../scripts/pial.py"


use rule pial as pial_left with:
    output:
        **pial_of("left"),
    wildcard_constraints:
        brain=brains_where(lambda brain: brain.sides == ("left",) and not brain.thickness),


use rule pial as pial_right with:
    output:
        **pial_of("right"),
    wildcard_constraints:
        brain=brains_where(lambda brain: brain.sides == ("right",) and not brain.thickness),


# with the cortical thickness, if there are labels of the cortex or white surfaces
use rule pial as pial_with_thickness with:
    output:
        **pial_of(*SIDES),
        **THICKNESS,
    wildcard_constraints:
        brain=brains_where(lambda brain: brain.sides == SIDES and brain.thickness),


use rule pial as pial_left_with_thickness with:
    output:
        **pial_of("left"),
        **THICKNESS,
    wildcard_constraints:
        brain=brains_where(lambda brain: brain.sides == ("left",) and brain.thickness),


use rule pial as pial_right_with_thickness with:
    output:
        **pial_of("right"),
        **THICKNESS,
    wildcard_constraints:
        brain=brains_where(lambda brain: brain.sides == ("right",) and brain.thickness),


rule surface:
    input:
        [brain.pial for brain in BRAINS.values()],
