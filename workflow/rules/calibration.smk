# Calibration: rounds of runs, each round's parameters chosen from the scores of the earlier ones.
#
# How many runs there are is known beforehand, their parameters are not: those of a round stand in a table that its runs
# read. What is there is not made again, so that an interrupted calibration goes on.
CALIBRATION = f"{STUDY}/calibration"


def calibrated_brains():
    """Returns the brains that the runs of the calibration fold."""
    return CONFIG.starts(CONFIG.calibrate.base)


def scores_before(number):
    """Returns the scores of all runs of the rounds before one."""
    return [
        f"{CALIBRATION}/scores/{run}.csv"
        for run, own in CALIBRATED.items()
        if own < number
    ]


rule calibration_design:
    input:
        scores=lambda wildcards: scores_before(int(wildcards.round)),
    output:
        f"{CALIBRATION}/round-{{round}}.csv",
    log:
        f"{CALIBRATION}/logs/calibration_design.{{round}}.log",
    benchmark:
        f"{CALIBRATION}/benchmarks/calibration_design.{{round}}.tsv"
    wildcard_constraints:
        round=r"\d+",
    conda:
        ENVIRONMENT
    params:
        bounds=lambda wildcards: CONFIG.calibrate.parameters,
        seed=lambda wildcards: CONFIG.calibrate.seed,
        runs=lambda wildcards: [
            run for run, own in CALIBRATED.items() if own == int(wildcards.round)
        ],
    script:
        "../scripts/calibration_design.py"


rule calibration_parameters:
    input:
        design=lambda wildcards: f"{CALIBRATION}/round-{CALIBRATED[wildcards.run]}.csv",
        base=lambda wildcards: rules.parameters.output[0].format(
            run=CONFIG.calibrate.base, brain=wildcards.brain
        ),
    output:
        f"{RUN}/params.yaml",
    log:
        f"{RUN}/logs/calibration_parameters.log",
    benchmark:
        f"{RUN}/benchmarks/calibration_parameters.tsv"
    wildcard_constraints:
        run=one_of(CALIBRATED),
    conda:
        ENVIRONMENT
    params:
        week=lambda wildcards: CONFIG.calibrate.compare_week,
    script:
        "../scripts/calibration_parameters.py"


def calibrated_surfaces(wildcards):
    """Returns the surfaces of a run of the calibration, those of the brains where it has come to the week."""
    week = CONFIG.calibrate.compare_week
    return [
        f"results/runs/{wildcards.run}/{brain}/surfaces/week-{week_tag(week)}/pial.surf.gii"
        for brain in calibrated_brains()
        if reaches(wildcards.run, brain, week)
    ]


rule calibration_score:
    input:
        simulated=calibrated_surfaces,
        real=lambda wildcards: [
            PIAL["whole"].format(brain=real)
            for brain in calibrated_brains()
            for real in CONFIG.compared_with(CONFIG.calibrate, brain)
        ],
        summaries=lambda wildcards: [
            rules.simulate.output.summary.format(run=wildcards.run, brain=brain)
            for brain in calibrated_brains()
        ],
        design=lambda wildcards: f"{CALIBRATION}/round-{CALIBRATED[wildcards.run]}.csv",
    output:
        f"{CALIBRATION}/scores/{{run}}.csv",
    log:
        f"{CALIBRATION}/logs/calibration_score.{{run}}.log",
    benchmark:
        f"{CALIBRATION}/benchmarks/calibration_score.{{run}}.tsv"
    wildcard_constraints:
        run=one_of(CALIBRATED),
    conda:
        ENVIRONMENT
    resources:
        mem_mb=4000,
        runtime=30,
    params:
        # how many of the real brains belong to each of the simulated ones
        compared=lambda wildcards: [
            len(CONFIG.compared_with(CONFIG.calibrate, brain))
            for brain in calibrated_brains()
        ],
        weights=lambda wildcards: CONFIG.calibrate.score,
        round=lambda wildcards: CALIBRATED[wildcards.run],
        curvature_radius_mm=CONFIG.metrics.curvature_radius_mm,
    script:
        "../scripts/calibration_score.py"


rule calibration_tables:
    input:
        scores=scores_before(len(CALIBRATED) + 1),
    output:
        **{
            f"{name}_{kind}": path
            for name in ("runs", "optimum", "sensitivities")
            for kind, path in printed(f"{CALIBRATION}/{name}").items()
        },
        profiles=f"{CALIBRATION}/profiles.csv",
    log:
        f"{CALIBRATION}/logs/calibration_tables.log",
    benchmark:
        f"{CALIBRATION}/benchmarks/calibration_tables.tsv"
    conda:
        ENVIRONMENT
    params:
        bounds=lambda wildcards: CONFIG.calibrate.parameters,
        seed=lambda wildcards: CONFIG.calibrate.seed,
    script:
        "../scripts/calibration_tables.py"


rule calibration_figure:
    input:
        runs=rules.calibration_tables.output.runs_csv,
        optimum=rules.calibration_tables.output.optimum_csv,
        sensitivities=rules.calibration_tables.output.sensitivities_csv,
        profiles=rules.calibration_tables.output.profiles,
    output:
        **figure(
            f"{CALIBRATION}/calibration",
            "calibration",
            "calibration.rst",
            "Folding",
        ),
    log:
        f"{CALIBRATION}/logs/calibration_figure.log",
    benchmark:
        f"{CALIBRATION}/benchmarks/calibration_figure.tsv"
    conda:
        ENVIRONMENT
    params:
        **drawing(*CONFIG.start_brains),
        score=lambda wildcards: CONFIG.calibrate.score,
    script:
        "../scripts/calibration_figure.py"


rule calibrate:
    input:
        rules.calibration_tables.output if CALIBRATED else [],
        rules.calibration_figure.output if CALIBRATED else [],
