# The folding simulation of each run, and its surfaces at the output weeks.
rule parameters:
    input:
        f"results/{START}/surface/surface.json",
    output:
        f"results/{START}/folding/{{run}}/params.yaml",
    log:
        f"results/{START}/logs/parameters.{{run}}.log",
    benchmark:
        f"results/{START}/benchmarks/parameters.{{run}}.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=500,
        runtime=5,
    params:
        # the result does not depend on the number of ranks
        settings=lambda wildcards: CONFIG.runs[wildcards.run].model_dump(
            mode="json", exclude={"ranks"}
        ),
        weeks=lambda wildcards: CONFIG.weeks(wildcards.run),
    script:
        "../scripts/parameters.py"


rule regions:
    input:
        mesh=f"results/{START}/mesh/brain.xdmf",
        data=f"results/{START}/mesh/brain.h5",
        params=f"results/{START}/folding/{{run}}/params.yaml",
    output:
        mesh=f"results/{START}/folding/{{run}}/regions.xdmf",
        data=f"results/{START}/folding/{{run}}/regions.h5",
    log:
        f"results/{START}/logs/regions.{{run}}.log",
    benchmark:
        f"results/{START}/benchmarks/regions.{{run}}.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=4000,
        runtime=15,
    params:
        code=code("folding"),
    script:
        "../scripts/regions.py"


rule simulate:
    input:
        mesh=f"results/{START}/mesh/brain.xdmf",
        data=f"results/{START}/mesh/brain.h5",
        params=f"results/{START}/folding/{{run}}/params.yaml",
        # impossible zones are refused there, before the ranks start
        regions=f"results/{START}/folding/{{run}}/regions.xdmf",
    output:
        steps=f"results/{START}/folding/{{run}}/steps.csv",
        frames=f"results/{START}/folding/{{run}}/frames.h5",
        series=f"results/{START}/folding/{{run}}/frames.xdmf",
        zones=f"results/{START}/folding/{{run}}/zones.json",
        summary=f"results/{START}/folding/{{run}}/summary.json",
    log:
        f"results/{START}/logs/simulate.{{run}}.log",
    benchmark:
        f"results/{START}/benchmarks/simulate.{{run}}.tsv"
    conda:
        ENVIRONMENT
    # on one machine the ranks are its threads; a cluster's profile sets threads to 1 and counts tasks
    threads: lambda wildcards: CONFIG.runs[wildcards.run].ranks
    resources:
        mpi="mpiexec",
        tasks=lambda wildcards: CONFIG.runs[wildcards.run].ranks,
        mem_mb=8000,
        runtime=1440,
    params:
        folder=subpath(output.steps, parent=True),
        code=code("folding", "mechanics"),
    shell:
        # one BLAS thread per rank: Snakemake gives every process as many as the rule has threads
        "export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1; "
        "{resources.mpi} -n {resources.tasks} python -m gyriflow.folding {input.mesh:q} --params {input.params:q}"
        " --out {params.folder:q} 2>&1 | tee -i {log:q} || python -m gyriflow.step ${{PIPESTATUS[0]}} {log:q}"


rule folded_surface:
    input:
        frames=rules.simulate.output.frames,
        params=rules.parameters.output[0],
    output:
        whole=f"results/{START}/folding/{{run}}/surfaces/week-{{week}}.pial.surf.gii",
        left=f"results/{START}/folding/{{run}}/surfaces/week-{{week}}.left.pial.surf.gii",
        right=f"results/{START}/folding/{{run}}/surfaces/week-{{week}}.right.pial.surf.gii",
    log:
        f"results/{START}/logs/folded_surface.{{run}}.week-{{week}}.log",
    benchmark:
        f"results/{START}/benchmarks/folded_surface.{{run}}.week-{{week}}.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=2000,
        runtime=10,
    params:
        code=code(),
    script:
        "../scripts/folded_surface.py"


FOLDED_SURFACES = [
    file
    for run in RUNS
    for file in expand(rules.folded_surface.output, run=run, week=week_tags(run))
]


rule folding:
    input:
        expand(rules.simulate.output, run=RUNS),
        FOLDED_SURFACES,
