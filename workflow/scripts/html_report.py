"""The HTML report: a second Snakemake looks at the finished results with the same configuration."""

import subprocess
import sys

from gyriflow.errors import GyriflowError
from gyriflow.io.files import replaced
from gyriflow.io.yaml_files import write_yaml
from gyriflow.step import step

output, params = snakemake.output, snakemake.params
with step(snakemake.log[0]):
    write_yaml(output.config, params.config)
    with replaced(output.html) as temporary:
        options = ["--configfile", output.config, "--snakefile", params.snakefile, "--nolock", "--report", temporary]
        command = [sys.executable, "-m", "snakemake", "figures", "metrics", "study_resources", "quality", *options]
        outcome = subprocess.run(command, capture_output=True, text=True, check=False)
        if outcome.returncode:
            last = "\n".join(outcome.stderr.splitlines()[-8:])
            raise GyriflowError("the report could not be made", path=output.html, found=last)
