"""The charts of what a study's simulations are worth: gain by week, and skill by the smoothing of measured growth."""

from gyriflow.io.figures import write_figure
from gyriflow.io.files import read_table
from gyriflow.report.validation import smoothing_chart, validation_chart
from gyriflow.step import step

files, output, params = snakemake.input, snakemake.output, snakemake.params
with step(snakemake.log[0]):
    validation, ceiling = read_table(files.validation), read_table(files.ceiling) if files.ceiling else None
    if params.smoothing_mm is None:
        figure = validation_chart(validation, ceiling)
    else:
        smoothing = {run: float(length) for run, length in params.smoothing_mm.items()}
        figure = smoothing_chart(validation, smoothing, ceiling)
    write_figure(output.png, output.pdf, figure, dpi=params.dpi)
