# The folding simulation of each run from each brain that it folds, and its surfaces at the output weeks.
from functools import cache

from gyriflow.cost import MEASURED as MEASURED_COSTS
from gyriflow.cost.prediction import folding_needs
from gyriflow.folding.predicted_memory import predicted_memory_mib
from gyriflow.io.files import read_json


def with_ventricles(run):
    """Returns whether the ventricles of a run grow by a rate of their own."""
    follow = CONFIG.run(run).follow
    return follow is not None and follow.ventricles_ml is not None


RUNS_WITH_MAPS = [
    run
    for run in [*CONFIG.runs, *CONFIG.study_runs]
    if CONFIG.maps(run) or regional(run) or with_ventricles(run)
]


def maps_of_run(wildcards):
    """Returns the file with the maps of a run, if it has any; runs of the calibration have those of its base."""
    run = CONFIG.calibrate.base if wildcards.run in CALIBRATED else wildcards.run
    if run not in RUNS_WITH_MAPS:
        return []
    return rules.parameter_maps.output[0].format(run=run, brain=wildcards.brain)


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
        follow.ventricles_ml,
    )
    return rules.growth_curves.output.curves if measured else []


def ventricle_labels(wildcards):
    """Returns the labels of the start brain where the run's ventricles grow by a rate of their own."""
    return label_volume_of(wildcards.brain) if with_ventricles(wildcards.run) else []


def carried_of_run(wildcards):
    """Returns the mesh carried through real brains where the run's growth differs between regions."""
    # where no brains tell of local growth, the run's parameters say why
    known = regional(wildcards.run) and wildcards.brain in WITH_CHAIN
    return rules.carried_mesh.output[0] if known else []


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
    wildcard_constraints:
        run=one_of([*CONFIG.runs, *CONFIG.study_runs]),
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
        unmatched=lambda wildcards: UNMATCHED.get(
            CONFIG.estimated_from(wildcards.brain)
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
        labels=ventricle_labels,
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
        ventricles=lambda wildcards: (
            CONFIG.scheme(CONFIG.brain(wildcards.brain))["ventricles"]
            if ventricle_labels(wildcards)
            else []
        ),
        # volumes of maps are read like those of the brain
        affine_from=lambda wildcards: CONFIG.brain(wildcards.brain).affine_from,
    script:
        "../scripts/parameter_maps.py"


rule regions:
    input:
        mesh=rules.tetrahedralise.output.mesh,
        data=rules.tetrahedralise.output.data,
        params=rules.parameters.output[0],
        maps=maps_of_run,
        # the hemispheres of the folded brain are those of the measured one
        sides=lambda wildcards: [PIAL[side] for side in sides_of(wildcards.brain)],
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


SOLVED_FROM = {
    "mesh": rules.tetrahedralise.output.mesh,
    "data": rules.tetrahedralise.output.data,
    "params": rules.parameters.output[0],
    "maps": maps_of_run,
    # that rule refuses impossible zones, before the ranks start
    "regions": rules.regions.output.mesh,
}
FOLDING = {
    "steps": f"{RUN}/folding/steps.csv",
    "frames": f"{RUN}/folding/frames.h5",
    "series": f"{RUN}/folding/frames.xdmf",
    "zones": f"{RUN}/folding/zones.json",
    "summary": f"{RUN}/folding/summary.json",
}
SOLVE = (
    # one BLAS thread per rank: Snakemake gives every process as many as the rule has threads
    "export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1; "
    # a cluster's profile sets no launcher for a single rank
    "launch='{resources.mpi}'; ${{launch:+$launch -n {resources.tasks}}}"
    " python -m gyriflow.folding {input.mesh:q} --params {input.params:q}"
    " {params.options:q} --out {params.folder:q} 2>&1"
    " | tee -i {log:q} || python -m gyriflow.step ${{PIPESTATUS[0]}} {log:q}"
)
FOLDING_CODE = code_hash(Path(SOURCE, "gyriflow", "folding", "__main__.py"))


def ranks(wildcards):
    """Returns the MPI ranks of a run: on one machine its threads; a cluster's profile gives each task one CPU."""
    run = CONFIG.calibrate.base if wildcards.run in CALIBRATED else wildcards.run
    return CONFIG.run(run).ranks


@cache
def folding_limits(run, brain):
    """Returns the memory in MiB and the minutes of a run's job on a cluster, predicted from measured runs."""
    return folding_needs(
        run, brain, CONFIG, read_json(MEASURED_COSTS), predicted_memory_mib
    )


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
    threads: ranks
    resources:
        mpi="mpiexec",
        tasks=ranks,
        mem_mb=lambda wildcards: folding_limits(wildcards.run, wildcards.brain)[0],
        runtime=lambda wildcards: folding_limits(wildcards.run, wildcards.brain)[1],
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
        run=one_of([*CONFIG.study_runs, *CALIBRATED]),
    conda:
        ENVIRONMENT
    threads: ranks
    resources:
        mpi="mpiexec",
        tasks=ranks,
        mem_mb=lambda wildcards: folding_limits(wildcards.run, wildcards.brain)[0],
        runtime=lambda wildcards: folding_limits(wildcards.run, wildcards.brain)[1],
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


def folded_of(*sides):
    """Returns the surfaces of a simulated brain at a week with some hemispheres, and its thickness."""
    folder = f"{RUN}/surfaces/week-{{week}}"
    return {
        **surfaces_in(folder, sides),
        "thickness": f"{folder}/thickness.shape.gii",
    }


rule folded_surface:
    input:
        frames=rules.simulate.output.frames,
        regions=rules.regions.output.mesh,
        data=rules.regions.output.data,
    output:
        **folded_of(*SIDES),
    log:
        f"{RUN}/logs/folded_surface.week-{{week}}.log",
    benchmark:
        f"{RUN}/benchmarks/folded_surface.week-{{week}}.tsv"
    wildcard_constraints:
        brain=one_of(with_sides(*SIDES)),
    conda:
        ENVIRONMENT
    script:
        "../scripts/folded_surface.py"


# from hemispheres that are alone
use rule folded_surface as folded_left with:
    output:
        **folded_of("left"),
    wildcard_constraints:
        brain=one_of(with_sides("left")),


use rule folded_surface as folded_right with:
    output:
        **folded_of("right"),
    wildcard_constraints:
        brain=one_of(with_sides("right")),


rule folding:
    input:
        of_runs(rules.simulate.output),
        [
            expand(
                list(folded_of(*sides_of(brain)).values()),
                run=run,
                brain=brain,
                week=week_tags(run, brain),
            )
            for run, brain in FOLDED
        ],
