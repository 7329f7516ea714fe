# From fetal brain MRI to folding metrics. Configuration: config/README.md; results: docs/outputs.md.
import sys
from pathlib import Path

from snakemake.utils import min_version

min_version("9.0")
# beside this file in a checkout; an installed package holds this file
CHECKED_OUT = Path(workflow.basedir, "src").is_dir()
SOURCE = (
    f"{workflow.basedir}/src" if CHECKED_OUT else str(Path(workflow.basedir).parents[1])
)
sys.path.insert(0, SOURCE)
from gyriflow.provenance import code_hash

# a configuration given on the command line replaces the demo instead of being mixed with it
if not workflow.overwrite_configfiles:
    own = Path("config/config.yaml")
    demo = own.resolve() if own.is_file() else Path(workflow.basedir, own)

    configfile: demo


report: "workflow/report/workflow.rst"


include: "workflow/rules/common.smk"
include: "workflow/rules/retrieve.smk"
include: "workflow/rules/input.smk"
include: "workflow/rules/surface.smk"
include: "workflow/rules/growth.smk"
include: "workflow/rules/mesh.smk"
include: "workflow/rules/registration.smk"
include: "workflow/rules/folding.smk"
include: "workflow/rules/metrics.smk"
include: "workflow/rules/regions.smk"
include: "workflow/rules/validation.smk"
include: "workflow/rules/onset.smk"
include: "workflow/rules/validation_figures.smk"
include: "workflow/rules/study.smk"
include: "workflow/rules/studies.smk"
include: "workflow/rules/calibration.smk"
include: "workflow/rules/run_figures.smk"
include: "workflow/rules/influence_figures.smk"
include: "workflow/rules/study_figures.smk"
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
        rules.study_warnings.output,
        rules.report.input,


# a change of the code reruns what depends on it: a hash of the modules that a script imports is a parameter of its rule
for job in workflow.rules:
    if job.script:
        source = job.basedir.join(job.script).get_path_or_uri(secret_free=False)
        job.set_params(code=code_hash(Path(source)))
