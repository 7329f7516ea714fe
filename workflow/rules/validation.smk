# What simulations are worth: each simulated brain beside the real one of its week, with the scaled start as baseline.
rule ready_surfaces:
    input:
        real=lambda w: study.references[w.brain, float(w.week)][0].pial,
        adjacent=lambda w: study.references[w.brain, float(w.week)][1].pial,
        start=PIAL["whole"],
    output:
        **READY,
    params:
        curvature_radius_mm=CONFIG.metrics.curvature_radius_mm,
    script:
        "../scripts/ready_surfaces.py"


rule validation:
    input:
        unpack(from_simulation("validation_files")),
        params=PARAMETERS,
        # what the errors of runs that follow no curve are errors against
        curves=lambda w: (CURVES["curves"] if study.simulations[w.run, w.brain].series else []),
    output:
        VALIDATION,
    params:
        start_week=from_brain("week"),
        series=from_simulation("series"),
        weeks=lambda w: list(study.simulations[w.run, w.brain].real),
        run=lambda w: w.run,
        real=lambda w: [brain.id for brain in study.simulations[w.run, w.brain].real.values()],
        kind=from_simulation("kind"),
        curvature_radius_mm=CONFIG.metrics.curvature_radius_mm,
    script:
        "../scripts/validation.py"


rule prediction:
    input:
        unpack(from_simulation("validation_files")),
        atlas=lambda w: study.chains[w.brain, "atlas"].surfaces,
        mesh=MESH["mesh"],
        data=MESH["data"],
        targets=TARGETS.format(brain="{brain}", origin="atlas"),
    output:
        PREDICTION,
    params:
        start_week=from_brain("week"),
        weeks=lambda w: list(study.simulations[w.run, w.brain].real),
        atlas_weeks=lambda w: study.chains[w.brain, "atlas"].later_weeks,
        of_atlas=from_simulation("from_others_only"),
        curvature_radius_mm=CONFIG.metrics.curvature_radius_mm,
    script:
        "../scripts/prediction.py"


def deviation_labels(wildcards):
    """Return the first columns of the table of deviations."""
    run, start, week = wildcards.run, wildcards.brain, float(wildcards.week)
    real = study.simulations[run, start].real[week]
    names = {"run": run, "start": start, "week": week}
    return names | {"real": real.id, "subject": real.subject}


rule deviation:
    input:
        unpack(lambda w: study.simulations[w.run, w.brain].deviation_files(float(w.week))),
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
    params:
        individuals=study.individuals({real.id for one in study.expected for real in one.real.values()}),
    script:
        "../scripts/deviation_scores.py"


rule registration_ceiling:
    input:
        unpack(lambda w: study.ceiling_files(w.brain)),
        mesh=MESH["mesh"],
        data=MESH["data"],
        report=PIAL["report"],
        carried=CARRIED_MESH,
    output:
        CEILING,
    params:
        start_week=from_brain("week"),
        weeks=lambda w: study.ceiling_weeks(w.brain),
        run="registration",
        real=lambda w: [study.references[w.brain, week][0].id for week in study.ceiling_weeks(w.brain)],
        kind="explained",
        curvature_radius_mm=CONFIG.metrics.curvature_radius_mm,
    script:
        "../scripts/validation.py"


rule displacement_agreement:
    input:
        frames=FOLDING["frames"],
        carried=CARRIED_MESH,
    output:
        AGREEMENT,
    params:
        labels=lambda w: {
            "run": w.run,
            "start_week": study.brains[w.brain].week,
        },
        registered=from_simulation("follows_registration"),
    script:
        "../scripts/displacement_agreement.py"


# the weeks in which sulci begin, in a simulated brain and in the real ones that follow its start
rule onset:
    input:
        unpack(lambda w: study.onset_files(w.run, w.brain)),
    output:
        ONSET,
    params:
        sides=from_brain("sides"),
        radius_mm=CONFIG.metrics.curvature_radius_mm,
        run=lambda w: w.run,
        subject=lambda w: w.brain,
        run_weeks=from_simulation("weeks"),
        real_weeks=lambda w: study.chains[w.brain, "self"].weeks,
    script:
        "../scripts/onset.py"


rule validate:
    input:
        [f"{STUDY}/{name}.csv" for name, files in study.validation_tables.items() if files],
        rules.deviation_scores.output if study.expected else [],
        asked_for(FIGURES, "validate"),
