# Accuracy of simulations: each simulated brain is compared with the observed brain of its week; the scaled start brain
# is the baseline.

# by start brain and week: the same for all runs
REFERENCES = {(row.brain, row.week): row for row in study.compared.values() if row.observed}


rule prepared_surfaces:
    input:
        observed=lambda w: BRAINS[REFERENCES[w.brain, float(w.week)].observed].pial,
        adjacent=lambda w: BRAINS[REFERENCES[w.brain, float(w.week)].adjacent].pial,
        start=PIAL["whole"],
    output:
        **PREPARED,
    params:
        curvature_radius_mm=CONFIG.metrics.curvature_radius_mm,
    script:
        "../scripts/prepared_surfaces.py"


def observed_of(wildcards):
    """Return the brains that a run is compared with, by week."""
    return study.observed(simulation_of(wildcards))


def compared_files(wildcards):
    """Return the surfaces of a run and those that they are compared with, by kind, one per week."""
    observed = observed_of(wildcards)
    prepared = {
        name: [file_of(file, brain=wildcards.brain, week=week) for week in observed]
        for name, file in PREPARED.items()
    }
    return {
        **prepared,
        "simulated": [
            study.measured_parts(SIMULATED[wildcards.run, wildcards.brain, week])["whole"] for week in observed
        ],
        "whole": [brain.pial for brain in observed.values()],
    }


# of both rules that compare a run
COMPARED = {
    "run": lambda w: w.run,
    "start_week": lambda w: BRAINS[w.brain].week,
    "weeks": lambda w: list(observed_of(w)),
    "observed": lambda w: [brain.id for brain in observed_of(w).values()],
    "kind": lambda w: simulation_of(w).kind,
    "curvature_radius_mm": CONFIG.metrics.curvature_radius_mm,
}


rule validation:
    input:
        unpack(compared_files),
        params=PARAMETERS,
        # reference for the errors of runs that follow no curve
        curves=lambda w: (CURVES["curves"] if simulation_of(w).series else []),
    output:
        table=VALIDATION,
    params:
        **COMPARED,
        series=lambda w: simulation_of(w).series,
    script:
        "../scripts/validation.py"


rule prediction:
    input:
        unpack(compared_files),
        **START_MESH,
        atlas=lambda w: [BRAINS[brain].pial for brain in study.chains[w.brain, "atlas"].later],
        targets=TARGETS.format(brain="{brain}", origin="atlas"),
    output:
        table=PREDICTION,
    params:
        **COMPARED,
        atlas_weeks=lambda w: study.chains[w.brain, "atlas"].weeks[1:],
        of_atlas=lambda w: simulation_of(w).is_atlas_prediction,
    script:
        "../scripts/validation.py"


rule atlas_brain:
    input:
        **START_MESH,
        predicted=lambda w: study.measured_parts(SIMULATED[w.run, w.brain, float(w.week)])["whole"],
        targets=TARGETS.format(brain="{brain}", origin="atlas"),
    output:
        ATLAS_BRAIN,
    params:
        week=lambda w: float(w.week),
    script:
        "../scripts/atlas_brain.py"


def deviating(wildcards):
    """Return the start brain, its run at the first week and at another week, and the observed brain of that week."""
    start = BRAINS[wildcards.brain]
    week = float(wildcards.week)
    return {
        "start": start,
        "first": SIMULATED[wildcards.run, start.id, start.week],
        "expected": SIMULATED[wildcards.run, start.id, week],
        "observed": observed_of(wildcards)[week],
    }


def deviation_columns(wildcards):
    """Return the first columns of the deviation table."""
    week = float(wildcards.week)
    observed = observed_of(wildcards)[week]
    names = {"run": wildcards.run, "start": wildcards.brain, "week": week}
    return names | {"observed": observed.id, "subject": observed.subject_name}


rule deviation:
    input:
        unpack(lambda w: {name: row.pial for name, row in deviating(w).items()}),
        # in the order of the surfaces; only if all of them have one
        thickness=lambda w: (
            [row.thickness for row in deviating(w).values()]
            if all(row.thickness for row in deviating(w).values())
            else []
        ),
        sides=lambda w: deviating(w)["expected"].hemispheres,
        regions=lambda w: deviating(w)["expected"].regions,
    output:
        **DEVIATION,
    params:
        sides=lambda w: BRAINS[w.brain].sides,
        columns=deviation_columns,
    script:
        "../scripts/deviation.py"


# tables of validation, and the files that are joined in each
JOINED = {
    "prediction": [simulation.file(PREDICTION) for simulation in study.predictions],
    "deviation": [
        simulation.file(DEVIATION["table"], week=week)
        for simulation in study.atlas_predictions
        for week in study.observed(simulation)
    ],
    "validation": [simulation.file(VALIDATION) for simulation in study.validated],
}
VALIDATION_TABLES = [
    *(name for name, files in JOINED.items() if files),
    *(["deviation_centiles"] if study.atlas_predictions else []),
]


rule validation_tables:
    input:
        **JOINED,
    output:
        **{name: f"{STUDY}/{name}.csv" for name in VALIDATION_TABLES},
    params:
        individuals=study.are_individuals(
            {
                brain.id
                for simulation in study.atlas_predictions
                for brain in study.observed(simulation).values()
            }
        ),
    script:
        "../scripts/validation_tables.py"


rule validate:
    input:
        rules.validation_tables.output if study.validated else [],
        figure_files(*SECTIONS["Validation"]),
