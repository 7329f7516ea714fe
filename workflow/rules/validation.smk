# What simulations are worth: each simulated brain beside the real one of its week, with the scaled start as baseline.
def compared_with(run, brain):
    """Returns, by week after the start, the real brain that a run is compared with; none where the start is synthetic."""
    if CONFIG.brain(brain).synthetic:
        return {}
    real = {
        week: [name for name in brains if not CONFIG.brain(name).synthetic]
        for week, brains in measured_after_start(run, brain).items()
    }
    return {week: brains[0] for week, brains in real.items() if brains}


def week_before(brain, week):
    """Returns the real brain of the latest week before one that a start brain may be compared with."""
    known = {
        other.week: other.id
        for other in reversed(comparable(brain))
        if other.week < float(week) and not other.synthetic
    }
    return known[max(known)]


VALIDATED = [pair for pair in FOLDED if compared_with(*pair)]


rule validation:
    input:
        simulated=lambda wildcards: [
            f"{RUN}/surfaces/week-{week}/pial.surf.gii"
            for week in compared_with(wildcards.run, wildcards.brain)
        ],
        real=lambda wildcards: [
            PIAL["whole"].format(brain=brain)
            for brain in compared_with(wildcards.run, wildcards.brain).values()
        ],
        adjacent=lambda wildcards: [
            PIAL["whole"].format(brain=week_before(wildcards.brain, week))
            for week in compared_with(wildcards.run, wildcards.brain)
        ],
        start=PIAL["whole"],
        params=rules.parameters.output[0],
        # what the errors of runs that follow no curve are errors against
        curves=lambda wildcards: (
            rules.growth_curves.output.curves
            if CONFIG.estimated_from(wildcards.brain)
            else []
        ),
    output:
        f"{RUN}/metrics/validation.csv",
    log:
        f"{RUN}/logs/validation.log",
    benchmark:
        f"{RUN}/benchmarks/validation.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=4000,
        runtime=60,
    params:
        weeks=lambda wildcards: [
            float(week) for week in compared_with(wildcards.run, wildcards.brain)
        ],
        start_week=lambda wildcards: CONFIG.brain(wildcards.brain).week,
        series=lambda wildcards: CONFIG.estimated_from(wildcards.brain),
        # growth taken from the brains that are compared explains them; it predicts nothing
        kind=lambda wildcards: (
            "explained"
            if curves_of_run(wildcards) or rates_of_run(wildcards)
            else "predicted"
        ),
        curvature_radius_mm=CONFIG.metrics.curvature_radius_mm,
    script:
        "../scripts/validation.py"


rule displacement_agreement:
    input:
        frames=rules.simulate.output.frames,
        carried=rules.carried_mesh.output[0],
    output:
        f"{RUN}/metrics/displacement_agreement.csv",
    log:
        f"{RUN}/logs/displacement_agreement.log",
    benchmark:
        f"{RUN}/benchmarks/displacement_agreement.tsv"
    wildcard_constraints:
        brain=one_of(CARRIED),
    conda:
        ENVIRONMENT
    params:
        labels=lambda wildcards: {
            "run": wildcards.run,
            "start_week": CONFIG.brain(wildcards.brain).week,
            "seed": 0,
        },
    script:
        "../scripts/displacement_agreement.py"


rule validation_table:
    input:
        [
            f"results/runs/{run}/{brain}/metrics/validation.csv"
            for run, brain in VALIDATED
        ],
    output:
        f"{STUDY}/validation.csv",
    log:
        f"{STUDY}/logs/validation_table.log",
    benchmark:
        f"{STUDY}/benchmarks/validation_table.tsv"
    conda:
        ENVIRONMENT
    script:
        "../scripts/join_tables.py"


rule displacement_agreement_table:
    input:
        [
            f"results/runs/{run}/{brain}/metrics/displacement_agreement.csv"
            for run, brain in VALIDATED
            if brain in CARRIED
        ],
    output:
        f"{STUDY}/displacement_agreement.csv",
    log:
        f"{STUDY}/logs/displacement_agreement_table.log",
    benchmark:
        f"{STUDY}/benchmarks/displacement_agreement_table.tsv"
    conda:
        ENVIRONMENT
    script:
        "../scripts/join_tables.py"


rule validate:
    input:
        rules.validation_table.output if VALIDATED else [],
        (
            rules.displacement_agreement_table.output
            if any(brain in CARRIED for _, brain in VALIDATED)
            else []
        ),
