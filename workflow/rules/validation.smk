# What simulations are worth: each simulated brain beside the real one of its week, with the scaled start as baseline.
rule ready_surfaces:
    input:
        real=of(PLAN.validating.real_surface),
        adjacent=of(PLAN.validating.adjacent_surface),
        start=PIAL["whole"],
    output:
        **READY,
    wildcard_constraints:
        brain=one_of(PLAN.validating.starts),
    resources:
        mem_mb=4000,
        runtime=30,
    params:
        curvature_radius_mm=CONFIG.metrics.curvature_radius_mm,
    script:
        "../scripts/ready_surfaces.py"


rule validation:
    input:
        unpack(of(PLAN.validating.validated)),
        params=PARAMETERS,
        # what the errors of runs that follow no curve are errors against
        curves=of(PLAN.validating.curves),
    output:
        VALIDATION,
    resources:
        mem_mb=4000,
        runtime=60,
    params:
        start_week=of(PLAN.brains.week),
        series=of(CONFIG.estimated_from),
        kinds=of(PLAN.validating.kinds),
        curvature_radius_mm=CONFIG.metrics.curvature_radius_mm,
        mirrored_patches=CONFIG.metrics.mirrored_patches,
    script:
        "../scripts/validation.py"


rule prediction:
    input:
        unpack(of(PLAN.validating.prediction)),
        mesh=MESH["mesh"],
        data=MESH["data"],
        targets=TARGETS.format(brain="{brain}", whose="atlas"),
    output:
        PREDICTION,
    resources:
        mem_mb=4000,
        runtime=60,
    params:
        start_week=of(PLAN.brains.week),
        weeks=lambda wildcards: list(PLAN.validating.compared(**wildcards)),
        atlas_weeks=lambda wildcards: PLAN.expecting.weeks(wildcards.brain, "atlas"),
        of_atlas=of(PLAN.validating.predicts),
        curvature_radius_mm=CONFIG.metrics.curvature_radius_mm,
    script:
        "../scripts/prediction.py"


rule deviation:
    input:
        unpack(of(PLAN.validating.deviation)),
    output:
        **DEVIATION,
    resources:
        mem_mb=4000,
        runtime=30,
    params:
        **of_brain("sides"),
        labels=of(PLAN.validating.deviating),
    script:
        "../scripts/deviation.py"


rule deviation_scores:
    input:
        f"{STUDY}/deviation.csv",
    output:
        f"{STUDY}/deviation_centiles.csv",
    script:
        "../scripts/deviation_scores.py"


rule registration_ceiling:
    input:
        unpack(of(PLAN.validating.ceiling)),
        mesh=MESH["mesh"],
        data=MESH["data"],
        report=PIAL["report"],
        carried=CARRIED_MESH,
    output:
        CEILING,
    wildcard_constraints:
        brain=one_of(PLAN.chains.carried),
    resources:
        mem_mb=4000,
        runtime=60,
    params:
        start_week=of(PLAN.brains.week),
        weeks=of(PLAN.validating.ceiling_weeks),
        curvature_radius_mm=CONFIG.metrics.curvature_radius_mm,
        mirrored_patches=CONFIG.metrics.mirrored_patches,
    script:
        "../scripts/registration_ceiling.py"


rule displacement_agreement:
    input:
        frames=FOLDING["frames"],
        carried=CARRIED_MESH,
    output:
        AGREEMENT,
    wildcard_constraints:
        brain=one_of(PLAN.chains.carried),
    params:
        labels=lambda wildcards: {
            "run": wildcards.run,
            "start_week": CONFIG.brain(wildcards.brain).week,
        },
        registered=of(PLAN.validating.registered),
    script:
        "../scripts/displacement_agreement.py"


# the weeks in which sulci begin, in a simulated brain and in the real ones that follow its start
rule onset:
    input:
        unpack(of(PLAN.validating.onset)),
    output:
        ONSET,
    wildcard_constraints:
        brain=one_of(PLAN.chains.carried),
    params:
        **of_brain("sides"),
        radius_mm=CONFIG.metrics.curvature_radius_mm,
        run=lambda wildcards: wildcards.run,
        subject=lambda wildcards: wildcards.brain,
        run_weeks=of(CONFIG.weeks),
        real_weeks=of(PLAN.chains.later_weeks),
    script:
        "../scripts/onset.py"


rule folding_agreement:
    input:
        metrics=f"{STUDY}/metrics.csv",
        spectra=f"{STUDY}/spectra.csv",
    output:
        f"{STUDY}/folding_agreement.csv",
    params:
        pairs=PLAN.validating.week_pairs,
    script:
        "../scripts/folding_agreement.py"


rule validate:
    input:
        [
            f"{STUDY}/{name}.csv"
            for name, files in PLAN.validating.tables.items()
            if files
        ],
        rules.deviation_scores.output if PLAN.validating.expected else [],
        PLAN.figures.target("validate"),
