# Shared by all rules: the plan of the study, names and paths of results.
import os
from contextlib import chdir

from gyriflow.errors import GyriflowError, InputError
from gyriflow.grouping import grouped
from gyriflow.settings.base import folder_of
from gyriflow.settings.terms import SIDES
from gyriflow.study import resolve
from gyriflow.study.atlases import known_checksums
from gyriflow.study.brains import label_source, registered_source
from gyriflow.study.paths import *
from gyriflow.study.study import read_plan, write_plan
from gyriflow.running.launch import MEASURE_ONLY_VAR, refused_brains, session
from gyriflow.running.provenance import input_contents, check_results_belong_to
from gyriflow.running.snakemake_internals import remove_stale

# scripts and programs find the package without an installation, also in conda environments of single rules, and import
# nothing from the working directory
shell.prefix(
    "set -euo pipefail; export PYTHONSAFEPATH=1; "
    + (f'export PYTHONPATH="{SOURCE}${{{{PYTHONPATH:+:$PYTHONPATH}}}}"; ' if CHECKED_OUT else "")
)


# whether this process runs the study; other processes run one job, or are dry runs
RUNS = workflow.is_main_process and not session.is_dry
# whether the rules print messages: a call reads them once to plan, and again to run
PRINTS = workflow.is_main_process and not session.is_planned


def planned_study():
    """Return the plan of the study, without refused brains, and the contents of its input files.

    A process that runs the study writes the plan. InputError if the configuration is not valid.
    """
    from gyriflow.study.loading import load
    from gyriflow.io.yaml_files import read_keys

    # a dry run is in a view of the working directory
    directory = session.viewed or Path.cwd()
    base = directory
    for path in workflow.configfiles:
        # Snakemake itself keeps the last of two equal keys
        file = Path(workflow.workdir_init, path)
        if set(read_keys(file)) & {"brains", "atlas", "participants"}:
            base = folder_of(file)
    with chdir(directory):
        found = load(config, base, keep_going=session.keeps_going)
        used = found.measured_only if MEASURE_ONLY_VAR in os.environ else found
        study = resolve(used, refused_brains())
        checksums = known_checksums(study.used_atlases)
    files = [Path(workflow.workdir_init, path) for path in workflow.configfiles]
    check_results_belong_to(Path.cwd(), files, found, record=RUNS)
    if RUNS:
        write_plan(study, Path(PLAN))
    return study, input_contents(Path.cwd(), found, checksums, record=RUNS)


def end_with(error):
    """End with the message and the exit code of an error, before any job."""
    print(f"gyriflow: {error}", file=sys.stderr)
    sys.exit(error.exit_code)


if workflow.is_main_process and not session.is_launched:
    problem = "Snakemake does not know what results were made from"
    remedy = "Start it by ./run snakemake or python -m gyriflow.running.launch, with the same arguments."
    end_with(InputError(problem, remedy=remedy))

try:
    # a job reads the plan
    study, CONTENTS = planned_study() if workflow.is_main_process else (read_plan(Path(PLAN)), {})
except GyriflowError as error:
    end_with(error)
session.study = study
CONFIG = study.config
BRAINS = study.brains
# by run, start brain and week
SIMULATED = study.simulated
# the runs of each sweep
SWEEPS = study.by_sweep
# run and start brain of each simulation of `runs`, those with an ensemble, and the runs of sweeps, calibration and
# ensembles, which may diverge without stopping the study
PAIRS = [simulation.key for simulation in study.run_simulations]
WITH_ENSEMBLE = [simulation for simulation in study.run_simulations if simulation.members]
MAY_DIVERGE = dict.fromkeys(
    simulation.run for simulation in study.simulations.values() if simulation.may_diverge
)
# brains refused in an earlier pass of this call; the study is finished without them
REFUSED = [row.brain for row in study.left_out.values() if row.why == "refused"]
if REFUSED and PRINTS:
    # the causes have been printed
    rest = "finishing the study without" if BRAINS else "no brain is left"
    print(f"gyriflow: refused: {', '.join(REFUSED)}; {rest}", file=sys.stderr)
if REFUSED and not BRAINS:
    remove_stale([], STUDY, REPORT)
    sys.exit(0)
if PRINTS:
    messages = []
    for row in study.left_out.values():
        if row.why == "not folded":
            messages.append((row.brain, f"not folded: {row.cause}"))
        elif row.why == "cannot be used" and not REFUSED:
            messages.append((row.brain, f"left out: {row.cause}"))
    for line, _ in grouped(messages):
        print(f"gyriflow: {line}", file=sys.stderr)

# the environment of each rule, for Snakemake's software deployment with conda
ENVIRONMENT = f"{workflow.basedir}/envs/gyriflow.yaml"


# input files that several rules read together
START_MESH = {name: MESH[name] for name in ("mesh", "data")}
START_REGIONS = {"regions": MESH_REGIONS["mesh"], "data": MESH_REGIONS["data"]}
POSED_SIDES = {**{side: PIAL[side] for side in SIDES}, "report": PIAL["report"]}


def simulation_of(wildcards):
    """Return the simulation of the wildcards."""
    return study.simulations[wildcards.run, wildcards.brain]


# any brain: Snakemake reads the constraint of a wildcard for each file, which takes long for the ids of many brains
ANY_BRAIN = "[^/]+"


def brains_where(condition):
    """Return a regular expression for the ids of the brains that meet a condition.

    All output files of a rule are made by each of its jobs, and brains of one hemisphere have fewer. So they have rules
    of their own (`use rule … as …_left with:`).
    """
    ids = [brain.id for brain in BRAINS.values() if condition(brain)]
    return ANY_BRAIN if len(ids) == len(BRAINS) else one_of(ids)


wildcard_constraints:
    **dict.fromkeys(("earlier", "later"), one_of(BRAINS)),
    brain=ANY_BRAIN,
    sweep=one_of(SWEEPS),
    run=one_of([*CONFIG.runs, *MAY_DIVERGE]),
    week=r"\d+\.\d+",
    side="|".join(SIDES),
