# What all rules share: the validated configuration, names, and where results lie.
import os

from gyriflow.errors import GyriflowError
from gyriflow.settings.terms import SIDES
from gyriflow.study import resolve
from gyriflow.study.figures import figures_of
from gyriflow.study.registry import asked_for, by_rule, files_in, halves_of, measured_name
from gyriflow.study.paths import *
from gyriflow.running.launch import KEEP_GOING_VAR, DRY_RUN_VAR, MEASURE_ONLY_VAR, hold_lock, refused_brains
from gyriflow.running.provenance import input_contents, check_results_belong_to
from gyriflow.step import record_exit_code

# scripts and programs find the package without its being installed, in conda environments of single rules too
shell.prefix(
    f'set -euo pipefail; export PYTHONPATH="{SOURCE}${{{{PYTHONPATH:+:$PYTHONPATH}}}}"; '
    if CHECKED_OUT
    else "set -euo pipefail; "
)


# whether this is the process that runs the study; others run a job of it, or only look
RUNS = workflow.is_main_process and DRY_RUN_VAR not in os.environ


def validated_study():
    """Return the study without refused brains, and what the input files hold.

    Ends with a message and exit code 2 where the configuration is not valid.
    """
    from gyriflow.study.loading import load
    from gyriflow.io.yaml_files import read_keys

    try:
        base = Path.cwd()
        for path in workflow.configfiles:
            # Snakemake's own reading keeps the last of two equal keys
            file = Path(workflow.workdir_init, path)
            if set(read_keys(file)) & {"brains", "atlas", "participants"}:
                base = file.resolve().parent
        found = load(config, base, keep_going=KEEP_GOING_VAR in os.environ)
        study = resolve(found.measured_only if MEASURE_ONLY_VAR in os.environ else found, refused_brains())
        if workflow.is_main_process:
            files = [Path(workflow.workdir_init, path) for path in workflow.configfiles]
            check_results_belong_to(Path.cwd(), files, found, record=RUNS)
        return study, input_contents(Path.cwd(), found, record=RUNS)
    except GyriflowError as error:
        print(f"gyriflow: {error}", file=sys.stderr)
        record_exit_code(error.exit_code)
        sys.exit(error.exit_code)


study, CONTENTS = validated_study()
CONFIG = study.config
# brains that an earlier pass of this call has refused, and why; without them it finishes the study
KNOWN = {brain.id for brain in CONFIG.brains}
REFUSED = {brain: cause for brain, cause in refused_brains().items() if brain in KNOWN}
if REFUSED and workflow.is_main_process:
    # each has told its cause
    rest = "finishing the study without" if study.brains else "no brain is left"
    print(f"gyriflow: refused: {', '.join(REFUSED)}; {rest}", file=sys.stderr)
if REFUSED and not study.brains:
    sys.exit(0)
# Brains of one hemisphere have fewer files, and rules of their own with the same script: the files of the whole have no
# wildcard for the side, and Snakemake asks all files of a rule to have the same wildcards.
PARTS_OF_BRAINS = {"": SIDES, "_left": ("left",), "_right": ("right",)}
FIGURES = figures_of(study)
if workflow.is_main_process:
    for cause in study.unreachable.values():
        print(f"gyriflow: not folded: {cause}", file=sys.stderr)
    for row in CONFIG.left_out.values():
        print(f"gyriflow: left out: {row['cause']}", file=sys.stderr)

# held as long as this process lives: how `gyriflow.running.launch` tells a live run from one that was interrupted
if RUNS:
    LOCK = hold_lock(Path.cwd())


# the environment of each rule, for Snakemake's own deployment with conda
ENVIRONMENT = f"{workflow.basedir}/envs/gyriflow.yaml"


def brain_of(wildcards):
    """Return the brain that the wildcards name."""
    return study.brains[wildcards.brain]


def simulation_of(wildcards):
    """Return the run from a brain that the wildcards name."""
    return study.simulations[wildcards.run, wildcards.brain]


def brains_with(condition):
    """Return a pattern for the ids of the brains that meet a condition."""
    return one_of(brain.id for brain in study.brains.values() if condition(brain))


wildcard_constraints:
    **dict.fromkeys(("brain", "earlier", "later"), one_of(study.brains)),
    study=one_of(study.comparisons),
    run=one_of([*CONFIG.runs, *study.may_diverge]),
    week=r"\d+\.\d+",
    side="|".join(SIDES),
