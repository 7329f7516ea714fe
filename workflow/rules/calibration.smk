# Calibration: rounds of runs, each round's parameters chosen from the scores of the earlier ones.
#
# The number of runs is fixed; their parameters are not: those of a round are in a table, which its runs read. Finished
# runs are not repeated, so an interrupted calibration continues.
from gyriflow.settings.terms import SPECTRAL_SCORES

CALIBRATED = list(study.calibration.values())
# by run; the rows of a run, one for each start brain, differ in that only
ROUNDS = {row.run: row for row in CALIBRATED}
STARTS = [row for row in CALIBRATED if row.run == CALIBRATED[0].run]
IS_SPECTRAL = CALIBRATED and not set(CONFIG.calibrate.score).isdisjoint(SPECTRAL_SCORES)
# spectra of the observed brains, if they are scored
OBSERVED_SPECTRA = [
    f"{BRAINS[brain].folder}/spectra.csv" for row in (STARTS if IS_SPECTRAL else []) for brain in row.observed
]


def scores_before(number):
    """Return the scores of all runs in earlier rounds."""
    return [row.score for row in ROUNDS.values() if row.round < number]


rule calibration_design:
    input:
        # bands that are not resolved are refused before the first run
        spectra=OBSERVED_SPECTRA,
        scores=lambda w: scores_before(int(w.round)),
    output:
        DESIGN,
    wildcard_constraints:
        round=r"\d+",
    params:
        bounds=lambda w: CONFIG.calibrate.parameters,
        score=lambda w: list(CONFIG.calibrate.score),
        runs=lambda w: [run for run, row in ROUNDS.items() if row.round == int(w.round)],
    script:
        "../scripts/calibration_design.py"


rule prepare_calibrated:
    input:
        **START_MESH,
        design=lambda w: ROUNDS[w.run].design,
        base=lambda w: PARAMETERS.format(run=CONFIG.calibrate.base, brain=w.brain),
        maps=lambda w: simulation_of(w).maps or [],
        sides=lambda w: [PIAL[side].format(brain=w.brain) for side in BRAINS[w.brain].sides],
    output:
        **START_REGIONS,
        params=PARAMETERS,
    wildcard_constraints:
        run=one_of(ROUNDS),
    params:
        week=lambda w: CONFIG.calibrate.compare_week,
    script:
        "../scripts/prepare_calibrated.py"


def from_bases(pattern):
    """Return an input function: a file of a run of the calibration from each brain that the base run folds."""
    return lambda w: [pattern.format(run=w.run, brain=start.brain) for start in STARTS]


rule calibration_score:
    input:
        frames=from_bases(FOLDING["frames"]),
        regions=from_bases(MESH_REGIONS["mesh"]),
        data=from_bases(MESH_REGIONS["data"]),
        summaries=from_bases(FOLDING["summary"]),
        observed=lambda w: [BRAINS[brain].pial for start in STARTS for brain in start.observed],
        spectra=OBSERVED_SPECTRA,
        design=lambda w: ROUNDS[w.run].design,
    output:
        SCORE,
    wildcard_constraints:
        run=one_of(ROUNDS),
    params:
        # number of observed brains of each simulated one
        compared=lambda w: [len(start.observed) for start in STARTS],
        week=lambda w: CONFIG.calibrate.compare_week,
        weights=lambda w: CONFIG.calibrate.score,
        round=lambda w: ROUNDS[w.run].round,
        settings=MEASURED_WITH,
    script:
        "../scripts/calibration_score.py"


rule calibration_tables:
    input:
        scores=[row.score for row in ROUNDS.values()],
        noise=f"{workflow.basedir}/norms/repeatability.yaml",
    output:
        runs=f"{CALIBRATION}/runs.csv",
        optimum=f"{CALIBRATION}/optimum.csv",
    params:
        bounds=lambda w: CONFIG.calibrate.parameters,
        weights=lambda w: CONFIG.calibrate.score,
    script:
        "../scripts/calibration_tables.py"


rule calibrate:
    input:
        rules.calibration_tables.output if CALIBRATED else [],
        figure_files("calibration_figure"),
