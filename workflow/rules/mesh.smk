# The brains that runs start from as tetrahedral meshes.
MESH_GATES = PLAN.figures.gates


rule tetrahedralise:
    input:
        PIAL["whole"],
    output:
        **MESH,
    resources:
        mem_mb=6000,
        runtime=60,
    params:
        settings=CONFIG.mesh.model_dump(exclude={*MESH_GATES}),
        gates=MESH_GATES,
        # not an output, so that it stays if the rule fails
        refused=f"{BRAIN}/mesh/refused",
    script:
        "../scripts/tetrahedralise.py"


rule mesh:
    input:
        expand(list(MESH.values()), brain=CONFIG.start_brains),
