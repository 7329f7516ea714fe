# Simple shapes in the place of brains.
rule shape:
    output:
        SHAPE,
    wildcard_constraints:
        brain=one_of(PLAN.brains.from_source("shape")),
    params:
        shape=of(PLAN.brains.shape),
    script:
        "../scripts/shape.py"
