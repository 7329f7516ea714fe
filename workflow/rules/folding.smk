# The folding simulation of each run, and its surfaces at the output weeks.
RUNS_WITH_MAPS = [run for run in RUNS if CONFIG.maps(run)]


def maps_of_run(wildcards):
    """Returns the file with the maps of a run, where it has any."""
    return rules.parameter_maps.output[0] if wildcards.run in RUNS_WITH_MAPS else []


def rates_of_run(wildcards):
    """Returns the table of the growth rates where the run takes one of them."""
    settings = CONFIG.parameters(wildcards.run)
    return rules.growth_rates.output.rates if "estimated" in settings.values() else []


rule parameters:
    input:
        surface=f"results/{START}/surface/surface.json",
        rates=rates_of_run,
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
        settings=lambda wildcards: CONFIG.parameters(wildcards.run),
        weeks=lambda wildcards: CONFIG.weeks(wildcards.run),
        estimated_from=lambda wildcards: (
            CONFIG.estimated_from if rates_of_run(wildcards) else None
        ),
        code=lambda wildcards: code("growth") if rates_of_run(wildcards) else None,
    script:
        "../scripts/parameters.py"


rule parameter_maps:
    input:
        lambda wildcards: [
            file
            for files in CONFIG.maps(wildcards.run).values()
            for file in (*files["map"], *files["surface"])
        ],
        mesh=f"results/{START}/mesh/brain.xdmf",
        data=f"results/{START}/mesh/brain.h5",
        surface=f"results/{START}/surface/surface.json",
    output:
        f"results/{START}/folding/{{run}}/maps.h5",
    log:
        f"results/{START}/logs/parameter_maps.{{run}}.log",
    benchmark:
        f"results/{START}/benchmarks/parameter_maps.{{run}}.tsv"
    wildcard_constraints:
        run=one_of(RUNS_WITH_MAPS),
    conda:
        ENVIRONMENT
    resources:
        mem_mb=4000,
        runtime=15,
    params:
        maps=lambda wildcards: CONFIG.maps(wildcards.run),
        bounds=lambda wildcards: {
            name: CONFIG.bounds(name) for name in CONFIG.maps(wildcards.run)
        },
        # files of maps are understood as those of the brain
        reading=CONFIG.brain(START).model_dump(include={"coordinates", "affine_from"}),
        code=code("mesh", "surface"),
    script:
        "../scripts/parameter_maps.py"


rule regions:
    input:
        mesh=f"results/{START}/mesh/brain.xdmf",
        data=f"results/{START}/mesh/brain.h5",
        params=f"results/{START}/folding/{{run}}/params.yaml",
        maps=maps_of_run,
        # the hemispheres of the folded brain are those of the measured one
        left=f"results/{START}/surface/left.pial.surf.gii",
        right=f"results/{START}/surface/right.pial.surf.gii",
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
        code=code("folding", "mechanics", "surface"),
    script:
        "../scripts/regions.py"


rule simulate:
    input:
        mesh=f"results/{START}/mesh/brain.xdmf",
        data=f"results/{START}/mesh/brain.h5",
        params=f"results/{START}/folding/{{run}}/params.yaml",
        maps=maps_of_run,
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
        maps=lambda wildcards, input: ["--maps", input.maps] if input.maps else [],
        code=code("folding", "mechanics"),
    shell:
        # one BLAS thread per rank: Snakemake gives every process as many as the rule has threads
        "export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1; "
        "{resources.mpi} -n {resources.tasks} python -m gyriflow.folding {input.mesh:q} --params {input.params:q}"
        " {params.maps:q} --out {params.folder:q} 2>&1"
        " | tee -i {log:q} || python -m gyriflow.step ${{PIPESTATUS[0]}} {log:q}"


rule folded_surface:
    input:
        frames=rules.simulate.output.frames,
        regions=rules.regions.output.mesh,
        data=rules.regions.output.data,
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
        code=code("folding", "metrics"),
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
