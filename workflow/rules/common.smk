# What all rules share: the validated configuration, names, and where results lie.
from inspect import signature

from gyriflow.errors import GyriflowError
from gyriflow.parameters.measures import SHAPE_MEASURES
from gyriflow.parameters.terms import SIDES
from gyriflow.study import Plan
from gyriflow.study.paths import *
from gyriflow.cli.launch import hold_lock, keeps_going, refused_brains, runs_nothing
from gyriflow.cli.provenance import input_contents, require_own_results
from gyriflow.step import record_exit_code
from gyriflow.units import week_tag

# scripts and programs find the package without its being installed, in conda environments of single rules too
shell.prefix(
    f'set -euo pipefail; export PYTHONPATH="{SOURCE}${{{{PYTHONPATH:+:$PYTHONPATH}}}}"; '
    if CHECKED_OUT
    else "set -euo pipefail; "
)


def validated_config():
    """Returns the configuration as models, the plan without refused brains, what the input files hold, and why brains
    cannot be folded.

    Ends with a message and exit code 2 where it is not valid.
    """
    from gyriflow.config import load
    from gyriflow.io.yaml_files import read_keys

    try:
        base = Path.cwd()
        for path in workflow.configfiles:
            # Snakemake's own reading keeps the last of two equal keys
            file = Path(workflow.workdir_init, path)
            if set(read_keys(file)) & {"brains", "atlas", "participants"}:
                base = file.resolve().parent
        found = load(config, base, keep_going=keeps_going())
        # without the brains that an earlier pass of this call has refused, others may lead nowhere: these are left out
        plan = Plan(found.without(refused_brains()))
        unled = plan.expecting.unled()
        if unled and not refused_brains():
            raise next(iter(unled.values()))
        if workflow.is_main_process:
            files = [Path(workflow.workdir_init, path) for path in workflow.configfiles]
            require_own_results(Path.cwd(), files, found, record=not runs_nothing())
        record = workflow.is_main_process and not runs_nothing()
        return found, plan, input_contents(Path.cwd(), found, record), unled
    except GyriflowError as error:
        print(f"gyriflow: {error}", file=sys.stderr)
        record_exit_code(error.exit_code)
        sys.exit(error.exit_code)


WHOLE_CONFIG, PLAN, CONTENTS, UNLED = validated_config()
if UNLED:
    PLAN = Plan(PLAN.config.without((), unfolded=UNLED))
CONFIG = PLAN.config
# brains that an earlier pass of this call has refused, and why; without them it finishes the study
REFUSED = {
    brain: cause
    for brain, cause in refused_brains().items()
    if brain in [known.id for known in WHOLE_CONFIG.brains]
}
if REFUSED and workflow.is_main_process:
    # each has told its cause
    rest = "finishing the study without" if CONFIG.brains else "no brain is left"
    print(f"gyriflow: refused: {', '.join(REFUSED)}; {rest}", file=sys.stderr)
if REFUSED and not CONFIG.brains:
    sys.exit(0)
if workflow.is_main_process:
    for cause in UNLED.values():
        print(f"gyriflow: not folded: {cause}", file=sys.stderr)
    for row in WHOLE_CONFIG.left_out.values():
        print(f"gyriflow: left out: {row['cause']}", file=sys.stderr)

# held as long as this process lives: how `gyriflow.cli.launch` tells a live run from one that was interrupted
if workflow.is_main_process and not runs_nothing():
    LOCK = hold_lock(Path.cwd())


def of(tell):
    """Returns an input function: what a function says of the wildcards that its arguments are called by."""
    names = signature(tell).parameters
    return lambda wildcards: tell(**{name: getattr(wildcards, name) for name in names})


def of_brain(*names):
    """Returns by name input functions: what the configuration says of a brain."""
    return {
        name: lambda wildcards, name=name: getattr(CONFIG.brain(wildcards.brain), name)
        for name in names
    }


wildcard_constraints:
    brain=one_of(PLAN.brains.ids),
    run=one_of([*CONFIG.runs, *PLAN.runs.members]),
    week=r"\d+\.\d+",
    side="|".join(SIDES),
