# The start brain as a tetrahedral mesh.
MESH_GATES = {
    key: value
    for key, value in CONFIG.mesh.model_dump().items()
    if key.startswith(("min_", "max_"))
}


rule tetrahedralise:
    input:
        f"results/{START}/surface/pial.surf.gii",
    output:
        mesh=f"results/{START}/mesh/brain.xdmf",
        data=f"results/{START}/mesh/brain.h5",
        surface=f"results/{START}/mesh/pial.stl",
        quality=f"results/{START}/mesh/quality.json",
    log:
        f"results/{START}/logs/tetrahedralise.log",
    benchmark:
        f"results/{START}/benchmarks/tetrahedralise.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=6000,
        runtime=60,
    params:
        settings=CONFIG.mesh.model_dump(exclude=set(MESH_GATES)),
        gates=MESH_GATES,
        # no output: it stays where the rule fails
        refused=f"results/{START}/mesh/refused",
        code=code("mesh"),
    script:
        "../scripts/tetrahedralise.py"


rule mesh:
    input:
        rules.tetrahedralise.output,
