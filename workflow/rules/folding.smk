# The folding simulation of each run from each brain that it folds, and its surfaces at the output weeks.
from gyriflow.io.files import read_json
from gyriflow.cli.cost import job_limits


rule parameters:
    input:
        surface=PIAL["report"],
        curves=of(PLAN.runs.curves),
        targets=of(PLAN.expecting.targets),
    output:
        PARAMETERS,
    wildcard_constraints:
        run=one_of([*CONFIG.runs, *CONFIG.study_runs]),
    params:
        settings=of(CONFIG.parameters),
        weeks=of(CONFIG.weeks),
        estimated_from=of(PLAN.runs.estimated_from),
    script:
        "../scripts/parameters.py"


rule parameter_maps:
    input:
        of(PLAN.runs.map_files),
        mesh=MESH["mesh"],
        data=MESH["data"],
        surface=PIAL["report"],
        targets=of(PLAN.expecting.targets),
    output:
        MAPS,
    wildcard_constraints:
        run=one_of(PLAN.runs.with_maps),
    resources:
        mem_mb=4000,
        runtime=15,
    params:
        **of_brain("affine_from"),
        maps=of(CONFIG.maps),
        bounds=of(PLAN.runs.map_bounds),
        # volumes of maps are read like those of the brain
    script:
        "../scripts/parameter_maps.py"


rule regions:
    input:
        mesh=MESH["mesh"],
        data=MESH["data"],
        params=PARAMETERS,
        maps=of(PLAN.runs.maps),
        # the hemispheres of the folded brain are those of the measured one
        sides=lambda wildcards: [
            PIAL[side] for side in CONFIG.brain(wildcards.brain).sides
        ],
    output:
        **REGIONS,
    resources:
        mem_mb=4000,
        runtime=15,
    script:
        "../scripts/regions.py"


SOLVED_FROM = {
    "mesh": MESH["mesh"],
    "data": MESH["data"],
    "params": PARAMETERS,
    "maps": of(PLAN.runs.maps),
    # that rule refuses impossible zones, before the ranks start
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


# what both rules of a folding ask of a cluster
LIMITED = {
    "mpi": "mpiexec",
    "tasks": of(PLAN.runs.ranks),
    "mem_mb": lambda wildcards: job_limits(wildcards.run, wildcards.brain, CONFIG)[0],
    "runtime": lambda wildcards: job_limits(wildcards.run, wildcards.brain, CONFIG)[1],
}


def solve_options(*more):
    """Returns the options of the folding program: the maps of a run where it has some, and `more`."""
    return lambda wildcards, input: [
        *(["--maps", input.maps] if input.maps else []),
        *more,
    ]


rule simulate:
    input:
        **SOLVED_FROM,
    output:
        **FOLDING,
    wildcard_constraints:
        run=one_of(CONFIG.runs),
    # the runs that all else is compared with, and the longest: members of studies fill the cores beside them
    priority: 1
    threads: of(PLAN.runs.ranks)
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
        run=one_of(PLAN.runs.members),
    threads: of(PLAN.runs.ranks)
    resources:
        **LIMITED,
    params:
        folder=subpath(output.steps, parent=True),
        options=solve_options("--may-diverge"),
        code=FOLDING_CODE,
    shell:
        SOLVE


def reaches(run, brain, week):
    """Returns whether a run from a brain has come to a week; runs of a study are solved before that is known."""
    if run in CONFIG.runs:
        return True
    summary = checkpoints.simulate_member.get(run=run, brain=brain).output.summary
    return week_tag(week) in map(week_tag, read_json(summary)["weeks"])


rule folded_surface:
    input:
        frames=FOLDING["frames"],
        regions=REGIONS["mesh"],
        data=REGIONS["data"],
    output:
        **folded_of(*SIDES),
    wildcard_constraints:
        brain=one_of(PLAN.brains.with_sides(*SIDES)),
    script:
        "../scripts/folded_surface.py"


# from hemispheres that are alone
use rule folded_surface as folded_left with:
    output:
        **folded_of("left"),
    wildcard_constraints:
        brain=one_of(PLAN.brains.with_sides("left")),


use rule folded_surface as folded_right with:
    output:
        **folded_of("right"),
    wildcard_constraints:
        brain=one_of(PLAN.brains.with_sides("right")),


rule folding:
    input:
        PLAN.runs.of(*FOLDING.values()),
        PLAN.measuring.folded_surfaces,
