"""The spectra of a study's runs in the bands of folds, beside the real brain's."""

import pandas as pd

from gyriflow.io.figures import write_figure
from gyriflow.io.files import read_table
from gyriflow.report.influence import influence_spectra, value_labels
from gyriflow.step import step

params = snakemake.params
with step(snakemake.log[0]):
    spectra = pd.concat(map(read_table, snakemake.input), ignore_index=True)
    labels = dict(zip(params.runs, value_labels(params.members), strict=True))
    shown = {"week": params.week, "measured": params.measured, "synthetic": params.synthetic}
    figure = influence_spectra(spectra, labels, **shown)
    write_figure(snakemake.output.png, snakemake.output.pdf, figure, dpi=params.dpi)
