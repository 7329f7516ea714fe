# From fetal brain MRI to folding metrics. Configuration: config/README.md; results: docs/outputs.md.
import sys
from pathlib import Path

from snakemake.io import strip_wildcard_constraints
from snakemake.utils import min_version

min_version("9.0")
# beside this file in a checkout; an installed package holds this file
CHECKED_OUT = Path(workflow.basedir, "src").is_dir()
SOURCE = f"{workflow.basedir}/src" if CHECKED_OUT else str(Path(workflow.basedir).parents[1])
sys.path.insert(0, SOURCE)
from gyriflow.code_hash import code_hash

# a configuration given on the command line replaces the demo instead of being mixed with it
if not workflow.overwrite_configfiles:
    own = Path("config/config.yaml")
    demo = own.resolve() if own.is_file() else Path(workflow.basedir, own)

    configfile: demo


include: "workflow/rules/common.smk"
include: "workflow/rules/retrieve.smk"
include: "workflow/rules/surface.smk"
include: "workflow/rules/growth.smk"
include: "workflow/rules/mesh.smk"
include: "workflow/rules/registration.smk"
include: "workflow/rules/folding.smk"
include: "workflow/rules/metrics.smk"
include: "workflow/rules/regions.smk"
include: "workflow/rules/validation.smk"
include: "workflow/rules/study.smk"
include: "workflow/rules/studies.smk"
include: "workflow/rules/calibration.smk"
include: "workflow/rules/figures.smk"
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


# What all rules share. The log and the benchmark lie beside the results. A change of the code reruns what depends on it:
# a hash of the modules that a script imports is a parameter of its rule. So is what its inputs hold: a file may be
# replaced by an older one.
for job in workflow.rules:
    if not job.norun:
        job.log_modifier = job.benchmark_modifier = job.output_modifier
        output = strip_wildcard_constraints(next(iter(job.output), ""))
        log, benchmark = job_files(job.name, output)
        if not job.log:
            job.set_log(log)
        # a download's time is the network's, and figures take little
        if job.name not in ("atlas_file", *by_rule(FIGURES)):
            job.benchmark = job.benchmark or benchmark
        job.set_params(
            contents=lambda wildcards, job=job: [
                f"input with the content {CONTENTS[path]}"
                for path in job.expand_input(wildcards)[0]
                if path in CONTENTS
            ]
        )
        job.conda_env = f"{workflow.basedir}/envs/gyriflow.yaml"
    if job.script and "code" not in job.params.keys():
        source = job.basedir.join(job.script).get_path_or_uri(secret_free=False)
        job.set_params(code=code_hash(Path(source)))
