# Simple shapes in the place of brains.
def shape_settings(wildcards):
    """Return what a simple shape depends on."""
    shape = study.brains[wildcards.brain].given.shape
    return {
        "semi_axes_mm": list(shape.semi_axes_mm),
        "noise_mm": shape.noise_mm,
        "seed": shape.seed,
        "edge_length_mm": CONFIG.surface.edge_length_mm,
    }


rule shape:
    output:
        SHAPE,
    wildcard_constraints:
        brain=brains_with(lambda brain: brain.given.source == "shape"),
    params:
        shape=shape_settings,
    script:
        "../scripts/shape.py"
