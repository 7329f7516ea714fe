"""The histograms of element quality."""

from gyriflow.io.figures import write_figure
from gyriflow.io.files import read_json
from gyriflow.report.charts import quality_histogram
from gyriflow.step import step

params = snakemake.params
with step(snakemake.log[0]):
    histogram = read_json(snakemake.input[0])["histogram"]
    figure = quality_histogram(histogram, min_radius_ratio=params.min_radius_ratio, synthetic=params.synthetic)
    write_figure(snakemake.output.png, snakemake.output.pdf, figure, dpi=params.dpi)
