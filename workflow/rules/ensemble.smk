# Ensembles: intervals and spread of a run from its members, runs with uncertain inputs varied.
def ensemble_of(wildcards):
    """Return the members of a simulation's ensemble."""
    return [study.simulations[run, wildcards.brain] for run in simulation_of(wildcards).members]


def reached(simulations, weeks):
    """Return the simulated brains at those of some weeks that each simulation has reached."""
    return [
        SIMULATED[*simulation.key, week]
        for simulation in simulations
        for week in weeks
        if reaches(simulation.run, simulation.brain, week)
    ]


def metrics_of(rows):
    return [f"{row.folder}/metrics.csv" for row in rows]


rule ensemble:
    input:
        run=lambda w: metrics_of(study.rows_of(simulation_of(w))),
        members=lambda w: metrics_of(reached(ensemble_of(w), simulation_of(w).weeks)),
        observed=lambda w: metrics_of(BRAINS[row.shown] for row in study.comparisons(simulation_of(w))),
        # the tested errors of predictions
        accuracy=lambda w: PREDICTION_TESTS if simulation_of(w).is_atlas_prediction else [],
        # all members at once, not one after the other as `reaches` asks for them
        summaries=lambda w: [member.file(FOLDING["summary"]) for member in ensemble_of(w)],
    output:
        ENSEMBLE,
    script:
        "../scripts/ensemble.py"


def rows_of_ensemble(wildcards):
    """Return the simulated brains of a run and of its members at a week."""
    return reached([simulation_of(wildcards), *ensemble_of(wildcards)], [float(wildcards.week)])


rule ensemble_maps:
    input:
        surfaces=lambda w: [row.parts[w.side] for row in rows_of_ensemble(w)],
        maps=lambda w: [f"{row.folder}/{w.side}.shape.gii" for row in rows_of_ensemble(w)],
    output:
        ENSEMBLE_MAPS,
    script:
        "../scripts/ensemble_maps.py"


rule growth_sd:
    input:
        run=GROWTH_MAPS,
        members=lambda w: [
            member.file(GROWTH_MAPS)
            for member in ensemble_of(w)
            if reaches(member.run, w.brain, member.weeks[-1])
        ],
    output:
        GROWTH_SD,
    script:
        "../scripts/growth_sd.py"
