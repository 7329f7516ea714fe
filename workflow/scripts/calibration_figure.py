"""The scores of a calibration over its parameters, with the surrogate, the optimum and the sensitivities."""

from gyriflow.io.figures import write_figure
from gyriflow.io.files import read_table
from gyriflow.report.calibration import calibration_chart
from gyriflow.step import step

files, output, params = snakemake.input, snakemake.output, snakemake.params
with step(snakemake.log[0]):
    tables = [read_table(path) for path in (files.runs, files.optimum, files.sensitivities, files.profiles)]
    chart = calibration_chart(*tables, score=" + ".join(params.score), synthetic=params.synthetic)
    write_figure(output.png, output.pdf, chart, dpi=params.dpi)
