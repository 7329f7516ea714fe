# From fetal brain MRI to folding metrics. Configuration: config/README.md; results: docs/outputs.md.
import sys
from pathlib import Path

from snakemake.utils import min_version

min_version("9.27")
# next to this file in a checkout; in an installed package this file is inside the package
CHECKED_OUT = Path(workflow.basedir, "src").is_dir()
SOURCE = f"{workflow.basedir}/src" if CHECKED_OUT else str(Path(workflow.basedir).parents[1])
sys.path.insert(0, SOURCE)
from gyriflow.code_hash import code_hash
from gyriflow.running.requirements import SOLVER, require_for
from gyriflow.running.snakemake_internals import (
    check_brains,
    complete_rules,
    remove_stale,
    rerun_on_code_changes,
)


# Dates of files mean nothing: `gyriflow.running.launch` compares results with their manifests, and names the files that
# Snakemake makes again.
inputflags:
    ancient,


# a configuration from the command line replaces that of the demo; they are not merged
if not workflow.overwrite_configfiles:
    own = Path("config/config.yaml")
    demo = own.resolve() if own.is_file() else Path(workflow.basedir, own)

    configfile: demo


include: "workflow/rules/common.smk"
include: "workflow/rules/figures.smk"
include: "workflow/rules/retrieve.smk"
include: "workflow/rules/surface.smk"
include: "workflow/rules/growth.smk"
include: "workflow/rules/mesh.smk"
include: "workflow/rules/registration.smk"
include: "workflow/rules/folding.smk"
include: "workflow/rules/metrics.smk"
include: "workflow/rules/ensemble.smk"
include: "workflow/rules/regions.smk"
include: "workflow/rules/validation.smk"
include: "workflow/rules/study.smk"
include: "workflow/rules/sweeps.smk"
include: "workflow/rules/calibration.smk"
include: "workflow/rules/quality.smk"
include: "workflow/rules/report.smk"


rule all:
    default_target: True
    input:
        rules.surface.input,
        rules.mesh.input,
        rules.growth.input,
        rules.folding.input,
        rules.metrics.input,
        rules.figures.input,
        rules.quality.input,
        rules.report.input,


# every job runs in the environment, and has a log
complete_rules(workflow.rules, ENVIRONMENT)
SCRIPTS = Path(workflow.basedir, "workflow", "scripts")
rerun_on_code_changes(workflow.rules, SCRIPTS)
try:
    check_brains(session.targets, workflow.rules, BRAINS)
except GyriflowError as error:
    end_with(error)
if RUNS and study.left_out:
    remove_stale(workflow.rules, STUDY, REPORT)


# before the first job
onstart:
    programs = {}
    for rule in {job.rule for job in workflow.dag.needrun_jobs()}:
        if rule.script:
            programs[rule.name] = SCRIPTS / Path(rule.script).name
        elif rule.shellcmd:
            programs[rule.name] = SOLVER
    try:
        # with conda or containers jobs have environments of their own
        if not workflow.deployment_settings.deployment_method:
            require_for(programs)
    except GyriflowError as error:
        end_with(error)
