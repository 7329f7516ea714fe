"""Smooth curves through the measured areas and volumes of each series of brains, and how far they are from them."""

import pandas as pd

from gyriflow.growth.curves import curve_table, errors
from gyriflow.growth.following import fits_of_series
from gyriflow.io.files import read_table, write_table
from gyriflow.step import step

output = snakemake.output
with step(snakemake.log[0]):
    series = fits_of_series(read_table(snakemake.input[0]), may_shrink=snakemake.params.may_shrink)
    curves, away = [], []
    for name, fits in series.items():
        table = curve_table({quantity: fit.curve for quantity, fit in fits.items()})
        curves.append(table.assign(series=name)[["series", *table.columns]])
        away.append(errors(fits).assign(series=name))
    write_table(output.curves, pd.concat(curves, ignore_index=True))
    write_table(output.errors, pd.concat(away, ignore_index=True))
