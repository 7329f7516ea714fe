# The folding simulation of each run from each brain that it folds, and its surfaces at the output weeks.
from gyriflow.io.files import read_json
from gyriflow.running.cost import job_limits
from gyriflow.settings.varying import files_of


def map_sources(wildcards):
    """Return the user's files of each parameter that has a map, under "map" and "surface"."""
    mapped = simulation_of(wildcards).mapped
    return {
        name: {"map": files_of(value.map), "surface": files_of(value.surface)} for name, value in mapped.items()
    }


# Runs of a calibration have their parameters from its rounds, and their maps from its base.
for suffix, maps in (("", {}), ("_with_maps", {"maps": MAPS})):

    rule:
        name:
            f"prepare{suffix}"
        input:
            lambda w: [file for files in map_sources(w).values() for kind in files.values() for file in kind],
            mesh=MESH["mesh"],
            data=MESH["data"],
            surface=PIAL["report"],
            curves=lambda w: simulation_of(w).curves,
            targets=lambda w: simulation_of(w).targets,
            # the hemispheres of the folded brain are those of the measured one
            sides=lambda w: [PIAL[side].format(brain=w.brain) for side in brain_of(w).sides],
        output:
            **maps,
            params=PARAMETERS,
            regions=REGIONS["mesh"],
            data=REGIONS["data"],
        log:
            f"{RUN}/logs/prepare{suffix}.log",
        benchmark:
            f"{RUN}/benchmarks/prepare{suffix}.tsv"
        wildcard_constraints:
            run=one_of(
                one.run
                for one in study.simulations.values()
                if one.base == one.run and bool(one.maps) == bool(maps)
            ),
        conda:
            ENVIRONMENT
        params:
            settings=lambda w: simulation_of(w).parameters,
            weeks=lambda w: simulation_of(w).weeks,
            series=lambda w: simulation_of(w).followed_series,
            # volumes of maps are read like those of the brain
            affine_from=lambda w: brain_of(w).given.affine_from,
            maps=map_sources,
        script:
            "../scripts/prepare.py"


SOLVED_FROM = {
    "mesh": MESH["mesh"],
    "data": MESH["data"],
    "params": PARAMETERS,
    "maps": lambda w: simulation_of(w).maps,
    # impossible zones are refused with them, before the ranks start
    "regions": REGIONS["mesh"],
}
SOLVE = (
    # one BLAS thread per rank: Snakemake gives every process as many as the rule has threads
    "export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1; "
    'log={log:q}; progress=${{log%.log}}.jsonl; rm -f "$progress"; '
    # on this machine no more ranks than cores; a cluster's profile sets no launcher for a single rank
    "launch='{resources.mpi}'; ranks={resources.tasks}; "
    '[ "$launch" != mpiexec ] || ranks={threads}; '
    "${{launch:+$launch -n $ranks}}"
    " python -m gyriflow.folding {input.mesh:q} --params {input.params:q}"
    ' {params.options:q} --out {params.folder:q} --progress "$progress" 2>&1'
    " | tee -i {log:q} || python -m gyriflow.step ${{PIPESTATUS[0]}} {log:q}"
)
FOLDING_CODE = code_hash(Path(SOURCE, "gyriflow", "folding", "__main__.py"))


# what both rules of a folding ask of a cluster: ranks, memory in MiB and minutes
LIMITED = {
    "mpi": "mpiexec",
    "tasks": lambda w: simulation_of(w).settings.ranks,
    "mem_mb": lambda w: job_limits(simulation_of(w), CONFIG.mesh)[0],
    "runtime": lambda w: job_limits(simulation_of(w), CONFIG.mesh)[1],
}


def solve_options(*more):
    """Return the options of the folding program: the maps of a run where it has some, and `more`."""
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
    benchmark:
        f"{RUN}/benchmarks/simulate.tsv"
    wildcard_constraints:
        run=one_of(CONFIG.runs),
    # the runs that all else is compared with, and the longest: members of studies fill the cores beside them
    priority: 1
    conda:
        ENVIRONMENT
    threads: lambda w: simulation_of(w).settings.ranks
    resources:
        **LIMITED,
    params:
        folder=subpath(output.steps, parent=True),
        options=solve_options(),
        code=FOLDING_CODE,
    shell:
        SOLVE


# A run of a study or a calibration may diverge: it then ends well with the weeks that it has reached, and only what
# needs those is made of it. What is needed is known once the summary is there.
checkpoint simulate_member:
    input:
        **SOLVED_FROM,
    output:
        **FOLDING,
    log:
        f"{RUN}/logs/simulate.log",
    benchmark:
        f"{RUN}/benchmarks/simulate.tsv"
    wildcard_constraints:
        run=one_of(study.may_diverge),
    conda:
        ENVIRONMENT
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
    """Return whether a run from a brain has come to a week; runs of a study are solved before that is known."""
    if run in CONFIG.runs:
        return True
    summary = checkpoints.simulate_member.get(run=run, brain=brain).output.summary
    return week in read_json(summary)["weeks"]


rule folding:
    input:
        study.files(*FOLDING.values()),
        study.folded_surfaces,
