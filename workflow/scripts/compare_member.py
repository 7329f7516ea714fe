"""Compare a run of a sweep with the observed brains of its week; no rows if it has not
reached that week."""

from itertools import batched

import pandas as pd

from gyriflow.compare.sweeps import COEFFICIENTS, joined_comparisons, member_comparison
from gyriflow.io.files import read_tables, write_table
from gyriflow.io.surfaces import read_surface
from gyriflow.step import step

files, params, names = snakemake.input, snakemake.params, snakemake.wildcards


def _parts(paths):
    """Read the surfaces of a brain by part."""
    return dict(
        zip(
            params.parts,
            map(read_surface, paths),
            strict=True,
        )
    )


with step(snakemake.log[0]):
    table, coefficients = joined_comparisons([]), pd.DataFrame(columns=COEFFICIENTS)
    if files.get("metrics"):
        metrics, spectra, coefficients = map(
            read_tables, (files.metrics, files.spectra, files.coefficients)
        )
        observed = map(
            _parts,
            batched(files.measured, len(params.parts)),
        )
        observed = dict(zip(params.observed, observed, strict=True))
        populations = {names.brain: params.population, **params.observed}
        simulated = _parts(files.simulated)
        table = member_comparison(
            names.run, names.brain, populations, metrics, spectra, simulated, observed
        )
    write_table(snakemake.output.table, table)
    write_table(snakemake.output.coefficients, coefficients[COEFFICIENTS])
