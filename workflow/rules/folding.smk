# Simulations: each run from each of its start brains.
from gyriflow.io.files import read_json
from gyriflow.running.cost import job_limits
from gyriflow.settings.folding import mapped_parameters, plain_settings
from gyriflow.settings.varying import files_of, mean_of_curve


def map_sources(wildcards):
    """Return, for each parameter with a map, the user's files as "map" and "surface", and its mean "curve"."""
    return {
        name: {"map": files_of(value.map), "surface": files_of(value.surface), "curve": mean_of_curve(value)}
        for name, value in mapped_parameters(simulation_of(wildcards).settings).items()
    }


def prepared_runs(*, with_maps):
    """Return a regular expression for the runs with or without maps.

    Runs of a calibration have the parameters of its rounds and the maps of its base run.
    """
    return one_of(
        simulation.run
        for simulation in study.simulations.values()
        if simulation.base == simulation.run and bool(simulation.maps) == with_maps
    )


rule prepare:
    input:
        lambda w: [
            file for files in map_sources(w).values() for kind in ("map", "surface") for file in files[kind]
        ],
        **START_MESH,
        surface=PIAL["report"],
        curves=lambda w: simulation_of(w).curves or [],
        targets=lambda w: simulation_of(w).targets or [],
        # the simulated brain has the hemispheres of its start brain
        sides=lambda w: [PIAL[side].format(brain=w.brain) for side in BRAINS[w.brain].sides],
    output:
        **START_REGIONS,
        params=PARAMETERS,
    log:
        f"{RUN}/logs/prepare.log",
    wildcard_constraints:
        run=prepared_runs(with_maps=False),
    params:
        settings=lambda w: plain_settings(simulation_of(w).settings),
        weeks=lambda w: simulation_of(w).weeks,
        series=lambda w: simulation_of(w).series if simulation_of(w).curves else None,
        # volumes of maps are read like label volumes
        affine_from=lambda w: BRAINS[w.brain].affine_from,
        maps=map_sources,
    script:
        "../scripts/prepare.py"


use rule prepare as prepare_with_maps with:
    output:
        **START_REGIONS,
        maps=MAPS,
        params=PARAMETERS,
    wildcard_constraints:
        run=prepared_runs(with_maps=True),


SOLVED_FROM = {
    "mesh": MESH["mesh"],
    "data": MESH["data"],
    "params": PARAMETERS,
    "maps": lambda w: simulation_of(w).maps or [],
    # made before the ranks start, so that impossible zones are refused early
    "regions": MESH_REGIONS["mesh"],
}
SOLVE = (
    # one BLAS thread per rank; Snakemake would give each rank all threads of the rule
    "export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1; "
    # messages of an earlier try
    "log={log:q}; rm -f ${{log%.log}}.jsonl; "
    # no more ranks than cores on this machine; a cluster's profile sets no launcher for a single rank
    "launch='{resources.mpi}'; ranks={resources.tasks}; "
    '[ "$launch" != mpiexec ] || ranks={threads}; '
    "${{launch:+$launch -n $ranks}}"
    " python -m gyriflow.folding {input.mesh:q} --params {input.params:q}"
    " {params.options:q} --out {params.folder:q} --log {log:q} 2>&1"
    " | tee -i {log:q} || python -m gyriflow.step ${{PIPESTATUS[0]}} {log:q}"
)
FOLDING_CODE = code_hash(Path(SOURCE, "gyriflow", "folding", "__main__.py"))


# resources of both rules on a cluster: ranks, memory (MiB) and minutes
LIMITED = {
    "mpi": "mpiexec",
    "tasks": lambda w: simulation_of(w).settings.ranks,
    "mem_mb": lambda w: job_limits(simulation_of(w), CONFIG.mesh)[0],
    "runtime": lambda w: job_limits(simulation_of(w), CONFIG.mesh)[1],
}


def solve_options(*more):
    """Return an input function: options of the folding program, with the maps of a run if it has any, and `more`."""
    return lambda wildcards, input: [
        *(["--maps", input.maps] if input.maps else []),
        *more,
    ]


rule simulate:
    input:
        **SOLVED_FROM,
    output:
        **FOLDING,
    log:
        f"{RUN}/logs/simulate.log",
    wildcard_constraints:
        run=one_of(CONFIG.runs),
    # these are the longest and start first; runs of sweeps use the remaining cores
    priority: 1
    threads: lambda w: simulation_of(w).settings.ranks
    resources:
        **LIMITED,
    params:
        folder=subpath(output.steps, parent=True),
        options=solve_options(),
        code=FOLDING_CODE,
    shell:
        SOLVE


# A run of a sweep or a calibration may diverge. The job then succeeds with the weeks that were reached, and only
# results of these weeks are made. They are known once the summary exists.
checkpoint simulate_member:
    input:
        **SOLVED_FROM,
    output:
        **FOLDING,
    log:
        f"{RUN}/logs/simulate.log",
    wildcard_constraints:
        run=one_of(MAY_DIVERGE),
    threads: lambda w: simulation_of(w).settings.ranks
    resources:
        **LIMITED,
    params:
        folder=subpath(output.steps, parent=True),
        options=solve_options("--may-diverge"),
        code=FOLDING_CODE,
    shell:
        SOLVE


def reaches(run, brain, week):
    """Return whether a simulation has reached a week; runs of sweeps are solved first."""
    if run in CONFIG.runs:
        return True
    summary = checkpoints.simulate_member.get(run=run, brain=brain).output.summary
    return week in read_json(summary)["weeks"]


rule growth_maps:
    input:
        frames=FOLDING["frames"],
        params=PARAMETERS,
    output:
        GROWTH_MAPS,
    script:
        "../scripts/growth_maps.py"


rule folding:
    input:
        study.files(*FOLDING.values()),
        [
            simulation.file(file, week=week)
            for simulation in study.run_simulations
            for file in folded_of(*BRAINS[simulation.brain].sides).values()
            for week in simulation.weeks
        ],
        [simulation.file(GROWTH_MAPS) for simulation in study.run_simulations if simulation.has_growth_maps],
