# Calibration: rounds of runs, each round's parameters chosen from the scores of the earlier ones.
#
# The number of runs is fixed; their parameters are not: those of a round are in a table, which its runs read. Finished
# runs are not repeated, so an interrupted calibration continues.
from gyriflow.settings.terms import SPECTRAL_SCORES

CALIBRATED = study.calibration
IS_SPECTRAL = CALIBRATED and not set(CONFIG.calibrate.score).isdisjoint(SPECTRAL_SCORES)
# spectra of the observed brains, if they are scored
OBSERVED_SPECTRA = [
    f"{real.folder}/spectra.csv"
    for brains in (CALIBRATED.observed.values() if IS_SPECTRAL else [])
    for real in brains
]


rule calibration_design:
    input:
        # bands that are not resolved are refused before the first run
        spectra=OBSERVED_SPECTRA,
        scores=lambda w: CALIBRATED.scores_before(int(w.round)),
    output:
        f"{CALIBRATION}/round-{{round}}.csv",
    wildcard_constraints:
        round=r"\d+",
    params:
        bounds=lambda w: CONFIG.calibrate.parameters,
        score=lambda w: list(CONFIG.calibrate.score),
        runs=lambda w: [run for run, number in CALIBRATED.rounds.items() if number == int(w.round)],
    script:
        "../scripts/calibration_design.py"


rule prepare_calibrated:
    input:
        **START_MESH,
        design=lambda w: CALIBRATED.design(w.run),
        base=lambda w: PARAMETERS.format(run=CONFIG.calibrate.base, brain=w.brain),
        maps=lambda w: simulation_of(w).maps,
        sides=lambda w: [PIAL[side].format(brain=w.brain) for side in BRAINS[w.brain].sides],
    output:
        **START_REGIONS,
        params=PARAMETERS,
    wildcard_constraints:
        run=one_of(CALIBRATED.rounds if CALIBRATED else []),
    params:
        week=lambda w: CONFIG.calibrate.compare_week,
    script:
        "../scripts/prepare_calibrated.py"


def from_bases(pattern):
    """Return an input function: a file of a run of the calibration from each brain that the base run folds."""
    return lambda w: [pattern.format(run=w.run, brain=base.start.id) for base in CALIBRATED.base]


rule calibration_score:
    input:
        frames=from_bases(FOLDING["frames"]),
        regions=from_bases(REGIONS["mesh"]),
        data=from_bases(REGIONS["data"]),
        summaries=from_bases(FOLDING["summary"]),
        real=lambda w: [real.pial for brains in CALIBRATED.observed.values() for real in brains],
        spectra=OBSERVED_SPECTRA,
        design=lambda w: CALIBRATED.design(w.run),
    output:
        f"{CALIBRATION}/scores/{{run}}.csv",
    wildcard_constraints:
        run=one_of(CALIBRATED.rounds if CALIBRATED else []),
    params:
        # number of observed brains of each simulated one
        compared=lambda w: list(map(len, CALIBRATED.observed.values())),
        week=lambda w: CONFIG.calibrate.compare_week,
        weights=lambda w: CONFIG.calibrate.score,
        round=lambda w: CALIBRATED.rounds[w.run],
        settings=MEASURED_WITH,
    script:
        "../scripts/calibration_score.py"


rule calibration_tables:
    input:
        scores=CALIBRATED.scores_before(max(CALIBRATED.rounds.values()) + 1) if CALIBRATED else [],
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
