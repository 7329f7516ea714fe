"""Norms of the measured brains over weeks, and where each brain stands among them."""

from gyriflow.io.files import read_table, write_table
from gyriflow.metrics.norms import measured_norms, measured_scores, norm_curves
from gyriflow.step import step

output, reference = snakemake.output, snakemake.params.reference
with step(snakemake.log[0]):
    metrics = read_table(snakemake.input.metrics)
    write_table(output.norms, measured_norms(metrics, reference))
    write_table(output.curves, norm_curves(metrics, reference))
    write_table(output.centiles, measured_scores(metrics, reference))
