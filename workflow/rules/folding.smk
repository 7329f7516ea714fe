# The folding simulation of each run from each brain that it folds, and its surfaces at the output weeks.
RUNS_WITH_MAPS = [run for run in CONFIG.runs if CONFIG.maps(run) or regional(run)]


def maps_of_run(wildcards):
    """Returns the file with the maps of a run, if it has any."""
    return rules.parameter_maps.output[0] if wildcards.run in RUNS_WITH_MAPS else []


def rates_of_run(wildcards):
    """Returns the table of growth rates if the run uses one of them."""
    settings = CONFIG.parameters(wildcards.run)
    return rules.growth_rates.output.rates if "estimated" in settings.values() else []


def curves_of_run(wildcards):
    """Returns the table of the measured curves where the run follows one of them."""
    follow = CONFIG.run(wildcards.run).follow
    measured = follow is not None and "measured" in (
        follow.area_cm2,
        follow.volume_ml,
        follow.thickness_mm,
    )
    return rules.growth_curves.output.curves if measured else []


def carried_of_run(wildcards):
    """Returns the mesh carried through real brains where the run's growth differs between regions."""
    return rules.carried_mesh.output[0] if regional(wildcards.run) else []


rule parameters:
    input:
        surface=PIAL["report"],
        rates=rates_of_run,
        curves=curves_of_run,
    output:
        f"{RUN}/params.yaml",
    log:
        f"{RUN}/logs/parameters.log",
    benchmark:
        f"{RUN}/benchmarks/parameters.tsv"
    conda:
        ENVIRONMENT
    params:
        settings=lambda wildcards: CONFIG.parameters(wildcards.run),
        weeks=lambda wildcards: CONFIG.weeks(wildcards.run, wildcards.brain),
        estimated_from=lambda wildcards: (
            CONFIG.estimated_from(wildcards.brain)
            if rates_of_run(wildcards) or curves_of_run(wildcards)
            else None
        ),
        regional_weeks=lambda wildcards: (
            weeks_of_chain(wildcards.brain) if regional(wildcards.run) else []
        ),
    script:
        "../scripts/parameters.py"


rule parameter_maps:
    input:
        lambda wildcards: [
            file
            for files in CONFIG.maps(wildcards.run).values()
            for file in (*files["map"], *files["surface"])
        ],
        mesh=rules.tetrahedralise.output.mesh,
        data=rules.tetrahedralise.output.data,
        surface=PIAL["report"],
        carried=carried_of_run,
    output:
        f"{RUN}/folding/maps.h5",
    log:
        f"{RUN}/logs/parameter_maps.log",
    benchmark:
        f"{RUN}/benchmarks/parameter_maps.tsv"
    wildcard_constraints:
        run=one_of(RUNS_WITH_MAPS),
    conda:
        ENVIRONMENT
    resources:
        mem_mb=4000,
        runtime=15,
    params:
        maps=lambda wildcards: CONFIG.maps(wildcards.run),
        follow=lambda wildcards: (
            CONFIG.run(wildcards.run).follow.model_dump()
            if regional(wildcards.run)
            else None
        ),
        bounds=lambda wildcards: {
            name: CONFIG.bounds(name) for name in CONFIG.maps(wildcards.run)
        },
        # files of maps are read like those of the brain
        reading=lambda wildcards: CONFIG.brain(wildcards.brain).model_dump(
            include={"coordinates", "affine_from"}
        ),
    script:
        "../scripts/parameter_maps.py"


rule regions:
    input:
        mesh=rules.tetrahedralise.output.mesh,
        data=rules.tetrahedralise.output.data,
        params=rules.parameters.output[0],
        maps=maps_of_run,
        # the hemispheres of the folded brain are those of the measured one
        left=PIAL["left"],
        right=PIAL["right"],
    output:
        mesh=f"{RUN}/folding/regions.xdmf",
        data=f"{RUN}/folding/regions.h5",
    log:
        f"{RUN}/logs/regions.log",
    benchmark:
        f"{RUN}/benchmarks/regions.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=4000,
        runtime=15,
    script:
        "../scripts/regions.py"


rule simulate:
    input:
        mesh=rules.tetrahedralise.output.mesh,
        data=rules.tetrahedralise.output.data,
        params=rules.parameters.output[0],
        maps=maps_of_run,
        # that rule refuses impossible zones, before the ranks start
        regions=rules.regions.output.mesh,
    output:
        steps=f"{RUN}/folding/steps.csv",
        frames=f"{RUN}/folding/frames.h5",
        series=f"{RUN}/folding/frames.xdmf",
        zones=f"{RUN}/folding/zones.json",
        summary=f"{RUN}/folding/summary.json",
    log:
        f"{RUN}/logs/simulate.log",
    benchmark:
        f"{RUN}/benchmarks/simulate.tsv"
    conda:
        ENVIRONMENT
    # on one machine the ranks are its threads; a cluster's profile sets threads to 1 and counts tasks
    threads: lambda wildcards: CONFIG.run(wildcards.run).ranks
    resources:
        mpi="mpiexec",
        tasks=lambda wildcards: CONFIG.run(wildcards.run).ranks,
        mem_mb=8000,
        runtime=1440,
    params:
        folder=subpath(output.steps, parent=True),
        maps=lambda wildcards, input: ["--maps", input.maps] if input.maps else [],
        code=code_hash(Path(SOURCE, "gyriflow", "folding", "__main__.py")),
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
        **surfaces_in(f"{RUN}/surfaces/week-{{week}}"),
        thickness=f"{RUN}/surfaces/week-{{week}}/thickness.shape.gii",
    log:
        f"{RUN}/logs/folded_surface.week-{{week}}.log",
    benchmark:
        f"{RUN}/benchmarks/folded_surface.week-{{week}}.tsv"
    conda:
        ENVIRONMENT
    script:
        "../scripts/folded_surface.py"


rule folding:
    input:
        of_runs(rules.simulate.output),
        of_weeks(rules.folded_surface.output),
