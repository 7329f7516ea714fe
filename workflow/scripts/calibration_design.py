"""Choose the parameters of a round's runs: first spread over the bounds, later where improvement is expected."""

from gyriflow.compare.calibration import fit_surrogate, propose_runs, require_bands, sobol_design
from gyriflow.io.files import read_table, read_tables, write_table
from gyriflow.step import step

params, earlier, spectra = snakemake.params, snakemake.input.scores, snakemake.input.spectra
with step(snakemake.log[0], *spectra):
    for path in spectra:
        require_bands(read_table(path), params.score, path)
    count = len(params.runs)
    if earlier:
        design = propose_runs(fit_surrogate(read_tables(earlier), params.bounds, params.seed), count)
    else:
        design = sobol_design(params.bounds, count, params.seed)
    design.insert(0, "run", params.runs)
    write_table(snakemake.output[0], design)
