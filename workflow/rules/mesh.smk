# Tetrahedral meshes of start brains.
rule tetrahedralise:
    input:
        PIAL["whole"],
    output:
        **MESH,
    log:
        f"{BRAIN}/logs/tetrahedralise.log",
    priority: 1
    resources:
        mem_mb=6000,
    params:
        settings=CONFIG.mesh.model_dump(exclude={"max_surface_distance_mm"}),
        gates=CONFIG.mesh.gates,
        # not an output, so that it stays if the rule fails
        refused=f"{BRAIN}/mesh/refused",
    script:
        "../scripts/tetrahedralise.py"


rule mesh:
    input:
        expand(list(MESH.values()), brain=[start.id for start in study.starts]),
