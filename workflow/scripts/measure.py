"""The metrics of one brain, measured or simulated, at one week."""

from gyriflow.io.files import write_table
from gyriflow.io.surfaces import read_surface, write_vertex_maps
from gyriflow.metrics.measure import measure_brain
from gyriflow.step import step

files, output, params = snakemake.input, snakemake.output, snakemake.params
with step(snakemake.log[0]):
    brain = measure_brain(*map(read_surface, (files.whole, files.left, files.right)), **params.settings)
    for path, table in ((output.metrics, brain.table), (output.spectra, brain.spectra)):
        write_table(path, table.assign(**params.labels)[[*params.labels, *table.columns]])
    write_vertex_maps(output.left, brain.maps["left"], "CortexLeft")
    write_vertex_maps(output.right, brain.maps["right"], "CortexRight")
