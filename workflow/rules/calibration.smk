# Calibration: rounds of runs, each round's parameters chosen from the scores of the earlier ones.
#
# How many runs there are is known beforehand, their parameters are not: those of a round stand in a table that its runs
# read. What is there is not made again, so that an interrupted calibration goes on.
rule calibration_design:
    input:
        scores=lambda wildcards: PLAN.calibrating.scores_before(int(wildcards.round)),
    output:
        f"{CALIBRATION}/round-{{round}}.csv",
    wildcard_constraints:
        round=r"\d+",
    params:
        bounds=lambda wildcards: CONFIG.calibrate.parameters,
        seed=lambda wildcards: CONFIG.calibrate.seed,
        runs=lambda wildcards: PLAN.calibrating.of_round(int(wildcards.round)),
    script:
        "../scripts/calibration_design.py"


rule calibration_parameters:
    input:
        design=of(PLAN.calibrating.design),
        base=of(PLAN.calibrating.base_parameters),
    output:
        PARAMETERS,
    wildcard_constraints:
        run=one_of(PLAN.runs.calibrated),
    params:
        week=lambda wildcards: CONFIG.calibrate.compare_week,
    script:
        "../scripts/calibration_parameters.py"


def calibrated_surfaces(wildcards):
    """Returns the surfaces of a run of the calibration, those of the brains where it has come to the week."""
    week = CONFIG.calibrate.compare_week
    return [
        folded_of()["whole"].format(run=wildcards.run, brain=brain, week=week_tag(week))
        for brain in PLAN.calibrating.brains
        if reaches(wildcards.run, brain, week)
    ]


rule calibration_score:
    input:
        simulated=calibrated_surfaces,
        real=lambda wildcards: sum(PLAN.calibrating.real.values(), []),
        summaries=of(PLAN.calibrating.summaries),
        design=of(PLAN.calibrating.design),
    output:
        f"{CALIBRATION}/scores/{{run}}.csv",
    wildcard_constraints:
        run=one_of(PLAN.runs.calibrated),
    resources:
        mem_mb=4000,
        runtime=30,
    params:
        # how many of the real brains belong to each of the simulated ones
        compared=lambda wildcards: list(map(len, PLAN.calibrating.real.values())),
        weights=lambda wildcards: CONFIG.calibrate.score,
        round=lambda wildcards: PLAN.runs.calibrated[wildcards.run],
        curvature_radius_mm=CONFIG.metrics.curvature_radius_mm,
    script:
        "../scripts/calibration_score.py"


rule calibration_tables:
    input:
        scores=PLAN.calibrating.scores_before(len(PLAN.runs.calibrated) + 1),
    output:
        runs=f"{CALIBRATION}/runs.csv",
        optimum=f"{CALIBRATION}/optimum.csv",
    params:
        bounds=lambda wildcards: CONFIG.calibrate.parameters,
        seed=lambda wildcards: CONFIG.calibrate.seed,
    script:
        "../scripts/calibration_tables.py"


rule calibrate:
    input:
        rules.calibration_tables.output if CONFIG.calibrate else [],
        PLAN.figures.target("calibrate"),
