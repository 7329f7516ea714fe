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


# what all runs from a start brain are compared with in a week: surfaces that are ready, with their curvature
READY = {
    f"{name}{suffix}": f"{STUDY}/validation/{{brain}}/week-{{week}}/{name}{ending}.gii"
    for name in ("real", "start", "adjacent")
    for suffix, ending in (("", ".surf"), ("_maps", ".shape"))
}
COMPARED_IN = {
    (brain, week): real
    for run, brain in VALIDATED
    for week, real in compared_with(run, brain).items()
}


def of_compared_weeks(pattern):
    """Returns an input function: the files of a pattern for every week that a run is compared in."""
    return lambda wildcards: [
        pattern.format(run=wildcards.run, brain=wildcards.brain, week=week)
        for week in compared_with(wildcards.run, wildcards.brain)
    ]


def kinds(run, brain):
    """Returns by compared week whether growth taken from the brains of that week explains it, or the run predicts it."""
    follow = CONFIG.run(run).follow
    measured = regional(run) or (
        follow is not None and "measured" in (follow.area_cm2, follow.volume_ml)
    )
    explains = measured or "estimated" in CONFIG.parameters(run).values()
    until = None if follow is None else follow.known_until_gw
    return {
        float(week): (
            "explained"
            if explains and (until is None or float(week) <= until)
            else "predicted"
        )
        for week in compared_with(run, brain)
    }


def seed_of(run):
    """Returns the seed of the randomness in a run's growth, 0 where there is none."""
    follow = CONFIG.run(run).follow
    return 0 if follow is None else follow.seed


rule ready_surfaces:
    input:
        real=lambda wildcards: PIAL["whole"].format(
            brain=COMPARED_IN[wildcards.brain, wildcards.week]
        ),
        adjacent=lambda wildcards: PIAL["whole"].format(
            brain=week_before(wildcards.brain, wildcards.week)
        ),
        start=PIAL["whole"],
    output:
        **READY,
    log:
        f"{STUDY}/validation/logs/{{brain}}.week-{{week}}.log",
    benchmark:
        f"{STUDY}/validation/benchmarks/{{brain}}.week-{{week}}.tsv"
    wildcard_constraints:
        brain=one_of({brain for brain, _ in COMPARED_IN}),
    conda:
        ENVIRONMENT
    resources:
        mem_mb=4000,
        runtime=30,
    params:
        curvature_radius_mm=CONFIG.metrics.curvature_radius_mm,
    script:
        "../scripts/ready_surfaces.py"


rule validation:
    input:
        **{name: of_compared_weeks(pattern) for name, pattern in READY.items()},
        simulated=of_compared_weeks(f"{RUN}/surfaces/week-{{week}}/pial.surf.gii"),
        whole=lambda wildcards: [
            PIAL["whole"].format(brain=brain)
            for brain in compared_with(wildcards.run, wildcards.brain).values()
        ],
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
        start_week=lambda wildcards: CONFIG.brain(wildcards.brain).week,
        series=lambda wildcards: CONFIG.estimated_from(wildcards.brain),
        kinds=lambda wildcards: kinds(wildcards.run, wildcards.brain),
        seed=lambda wildcards: seed_of(wildcards.run),
        curvature_radius_mm=CONFIG.metrics.curvature_radius_mm,
    script:
        "../scripts/validation.py"


def carried_weeks(brain):
    """Returns the compared weeks, as in file names, of the real brains that a start brain's mesh is carried to."""
    later = [CONFIG.brain(name) for name in later_brains(brain)[1:]]
    return (
        {week_tag(other.week): other.id for other in later} if brain in CARRIED else {}
    )


rule registration_ceiling:
    input:
        **{
            name: lambda wildcards, pattern=pattern: [
                pattern.format(brain=wildcards.brain, week=week)
                for week in carried_weeks(wildcards.brain)
                if (wildcards.brain, week) in COMPARED_IN
            ]
            for name, pattern in READY.items()
        },
        whole=lambda wildcards: [
            PIAL["whole"].format(brain=COMPARED_IN[wildcards.brain, week])
            for week in carried_weeks(wildcards.brain)
            if (wildcards.brain, week) in COMPARED_IN
        ],
        mesh=rules.tetrahedralise.output.mesh,
        data=rules.tetrahedralise.output.data,
        report=PIAL["report"],
        carried=rules.carried_mesh.output[0],
    output:
        f"{STUDY}/validation/{{brain}}/registration.csv",
    log:
        f"{STUDY}/validation/logs/{{brain}}.registration.log",
    benchmark:
        f"{STUDY}/validation/benchmarks/{{brain}}.registration.tsv"
    wildcard_constraints:
        brain=one_of(CARRIED),
    conda:
        ENVIRONMENT
    resources:
        mem_mb=4000,
        runtime=60,
    params:
        start_week=lambda wildcards: CONFIG.brain(wildcards.brain).week,
        weeks=lambda wildcards: [
            float(week)
            for week in carried_weeks(wildcards.brain)
            if (wildcards.brain, week) in COMPARED_IN
        ],
        curvature_radius_mm=CONFIG.metrics.curvature_radius_mm,
    script:
        "../scripts/registration_ceiling.py"


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
            "seed": seed_of(wildcards.run),
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


rule registration_ceiling_table:
    input:
        [
            f"{STUDY}/validation/{brain}/registration.csv"
            for brain in CARRIED
            if any(start == brain for start, _ in COMPARED_IN)
        ],
    output:
        f"{STUDY}/registration_ceiling.csv",
    log:
        f"{STUDY}/logs/registration_ceiling_table.log",
    benchmark:
        f"{STUDY}/benchmarks/registration_ceiling_table.tsv"
    conda:
        ENVIRONMENT
    script:
        "../scripts/join_tables.py"
