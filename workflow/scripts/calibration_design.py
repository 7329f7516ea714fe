"""Choose the parameters of a round's runs: first spread over the bounds, later near the
best."""

from gyriflow.compare.calibration import first_round, next_round, require_bands
from gyriflow.io.files import read_table, read_tables, write_table
from gyriflow.step import step

SEED = 0
"""Seed of the sequence and of the estimator."""

params, earlier, spectra = (
    snakemake.params,
    snakemake.input.scores,
    snakemake.input.spectra,
)
with step(snakemake.log[0], *spectra):
    for path in spectra:
        require_bands(read_table(path), params.score, path)
    count = len(params.runs)
    if earlier:
        design = next_round(read_tables(earlier), params.bounds, count, SEED)
    else:
        design = first_round(params.bounds, count, SEED)
    design.insert(0, "run", params.runs)
    write_table(snakemake.output[0], design)
