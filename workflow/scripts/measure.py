"""The metrics of one brain, measured or simulated, at one week."""

from gyriflow.io.files import read_json, write_table
from gyriflow.io.surfaces import STRUCTURES, read_surface, read_vertex_maps, write_vertex_maps
from gyriflow.metrics.measure import measure_brain
from gyriflow.settings.terms import SIDES
from gyriflow.step import step

files, output, params = snakemake.input, snakemake.output, snakemake.params
settings = dict(params.settings)
with step(snakemake.log[0]):
    if files.get("thickness"):
        (settings["thickness_mm"],) = read_vertex_maps(files.thickness).values()
    if files.report:
        settings["label_volumes_ml"] = read_json(files.report).get("label_volumes_mL", {})
    left, right = (read_surface(files[side]) if files.get(side) else None for side in SIDES)
    brain = measure_brain(read_surface(files.whole), left, right, **settings)
    for name, table in (("metrics", brain.table), ("spectra", brain.spectra), ("coefficients", brain.coefficients)):
        write_table(output[name], table.assign(**params.labels)[[*params.labels, *table.columns]])
    for side, maps in brain.maps.items():
        write_vertex_maps(output[side], maps, STRUCTURES[side])
