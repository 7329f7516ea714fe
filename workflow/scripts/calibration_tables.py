"""Write the runs of a calibration with their scores, and the optimum."""

from gyriflow.compare.calibration import find_optimum
from gyriflow.io.files import read_tables, write_table
from gyriflow.io.yaml_files import read_yaml
from gyriflow.metrics.repeatability import score_noise
from gyriflow.step import step

params, output = snakemake.params, snakemake.output
with step(snakemake.log[0]):
    runs = read_tables(snakemake.input.scores)
    write_table(output.runs, runs)
    optimum = find_optimum(runs, params.bounds)
    noise = score_noise(params.weights, read_yaml(snakemake.input.noise))
    write_table(output.optimum, optimum.assign(score_noise=noise))
