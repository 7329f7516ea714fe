"""The configuration as it was validated, with all paths."""

from gyriflow.io.yaml_files import write_yaml
from gyriflow.step import step

with step(snakemake.log[0]):
    write_yaml(snakemake.output[0], snakemake.params.config)
