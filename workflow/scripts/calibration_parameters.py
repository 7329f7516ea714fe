"""Parameters of a run of the calibration: those of the base run with the values from the design of its round."""

from gyriflow.compare.calibration import calibrated_parameters
from gyriflow.io.files import read_table
from gyriflow.io.yaml_files import read_yaml, write_yaml
from gyriflow.step import step

with step(snakemake.log[0]):
    design = read_table(snakemake.input.design).set_index("run")
    values = design.loc[snakemake.wildcards.run].astype(float).to_dict()
    write_yaml(
        snakemake.output[0], calibrated_parameters(read_yaml(snakemake.input.base), values, snakemake.params.week)
    )
