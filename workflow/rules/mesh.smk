# The start brain as a tetrahedral mesh.
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
        settings=CONFIG.mesh.model_dump(),
        code=code("mesh"),
    script:
        "../scripts/tetrahedralise.py"


rule mesh:
    input:
        rules.tetrahedralise.output,
