# What simulations are worth: each simulated brain beside the real one of its week, with the scaled start as baseline.
rule ready_surfaces:
    input:
        real=lambda wildcards: study.references[wildcards.brain, wildcards.week][0].pial,
        adjacent=lambda wildcards: study.references[wildcards.brain, wildcards.week][
            1
        ].pial,
        start=PIAL["whole"],
    output:
        **READY,
    wildcard_constraints:
        brain=one_of({one.start.id for one in study.validated}),
    params:
        curvature_radius_mm=CONFIG.metrics.curvature_radius_mm,
    script:
        "../scripts/ready_surfaces.py"


rule validation:
    input:
        unpack(from_simulation("validation_files")),
        params=PARAMETERS,
        # what the errors of runs that follow no curve are errors against
        curves=lambda wildcards: (
            CURVES["curves"]
            if study.simulations[wildcards.run, wildcards.brain].series
            else []
        ),
    output:
        VALIDATION,
    params:
        start_week=from_brain("week"),
        series=from_simulation("series"),
        weeks=from_simulation("real_weeks"),
        kind=from_simulation("kind"),
        curvature_radius_mm=CONFIG.metrics.curvature_radius_mm,
    script:
        "../scripts/validation.py"


rule prediction:
    input:
        unpack(from_simulation("validation_files")),
        atlas=lambda wildcards: study.chains[wildcards.brain, "atlas"].surfaces,
        mesh=MESH["mesh"],
        data=MESH["data"],
        targets=TARGETS.format(brain="{brain}", origin="atlas"),
    output:
        PREDICTION,
    params:
        start_week=from_brain("week"),
        weeks=lambda wildcards: list(
            study.simulations[wildcards.run, wildcards.brain].real
        ),
        atlas_weeks=lambda wildcards: study.chains[wildcards.brain, "atlas"].later_weeks,
        of_atlas=from_simulation("from_others_only"),
        curvature_radius_mm=CONFIG.metrics.curvature_radius_mm,
    script:
        "../scripts/prediction.py"


def deviation_labels(wildcards):
    """Return the first columns of the table of deviations."""
    run, start, week = wildcards.run, wildcards.brain, wildcards.week
    real = study.simulations[run, start].real[week]
    names = {"run": run, "start": start, "week": real.week}
    return names | {"real": real.id, "subject": real.subject}


rule deviation:
    input:
        unpack(
            lambda wildcards: study.simulations[
                wildcards.run, wildcards.brain
            ].deviation_files(wildcards.week)
        ),
    output:
        **DEVIATION,
    params:
        sides=from_brain("sides"),
        labels=deviation_labels,
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
        unpack(lambda wildcards: study.ceiling_files(wildcards.brain)),
        mesh=MESH["mesh"],
        data=MESH["data"],
        report=PIAL["report"],
        carried=CARRIED_MESH,
    output:
        CEILING,
    wildcard_constraints:
        brain=one_of(study.carried),
    params:
        start_week=from_brain("week"),
        weeks=lambda wildcards: study.ceiling_weeks(wildcards.brain),
        curvature_radius_mm=CONFIG.metrics.curvature_radius_mm,
    script:
        "../scripts/registration_ceiling.py"


rule displacement_agreement:
    input:
        frames=FOLDING["frames"],
        carried=CARRIED_MESH,
    output:
        AGREEMENT,
    wildcard_constraints:
        brain=one_of(study.carried),
    params:
        labels=lambda wildcards: {
            "run": wildcards.run,
            "start_week": study.brains[wildcards.brain].week,
        },
        registered=from_simulation("follows_registration"),
    script:
        "../scripts/displacement_agreement.py"


# the weeks in which sulci begin, in a simulated brain and in the real ones that follow its start
rule onset:
    input:
        unpack(lambda wildcards: study.onset_files(wildcards.run, wildcards.brain)),
    output:
        ONSET,
    wildcard_constraints:
        brain=one_of(study.carried),
    params:
        sides=from_brain("sides"),
        radius_mm=CONFIG.metrics.curvature_radius_mm,
        run=lambda wildcards: wildcards.run,
        subject=lambda wildcards: wildcards.brain,
        run_weeks=from_simulation("weeks"),
        real_weeks=lambda wildcards: study.chains[wildcards.brain, "self"].weeks,
    script:
        "../scripts/onset.py"


rule folding_agreement:
    input:
        metrics=f"{STUDY}/metrics.csv",
        spectra=f"{STUDY}/spectra.csv",
    output:
        f"{STUDY}/folding_agreement.csv",
    params:
        pairs=[
            (one.run, one.start.id, float(week), real.id)
            for one in study.validated
            for week, real in one.real.items()
        ],
    script:
        "../scripts/folding_agreement.py"


rule validate:
    input:
        [
            f"{STUDY}/{name}.csv"
            for name, files in study.validation_tables.items()
            if files
        ],
        rules.deviation_scores.output if study.expected else [],
        asked_for(FIGURES, "validate"),
