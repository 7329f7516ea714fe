"""Fit smooth curves to the measured areas and volumes of each series of brains, and
write their errors."""

import pandas as pd

from gyriflow.growth.curves import curve_table, errors, fits_of_series
from gyriflow.io.files import read_table, write_table
from gyriflow.step import step

output = snakemake.output
with step(snakemake.log[0]):
    areas, curves, misfits = read_table(snakemake.input[0]), [], []
    for name, fits in fits_of_series(areas).items():
        tables = (
            curve_table({quantity: fit.curve for quantity, fit in fits.items()}),
            errors(fits),
        )
        for table, joined in zip(
            tables,
            (curves, misfits),
            strict=True,
        ):
            joined.append(table.assign(series=name)[["series", *table.columns]])
    write_table(output.curves, pd.concat(curves, ignore_index=True))
    write_table(output.errors, pd.concat(misfits, ignore_index=True))
