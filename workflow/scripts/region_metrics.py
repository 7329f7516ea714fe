"""Measure the regions of a brain."""

from gyriflow.io.files import write_table
from gyriflow.io.surfaces import read_surface, read_vertex_labels, read_vertex_maps
from gyriflow.metrics.tables import region_metrics
from gyriflow.settings.terms import SIDES
from gyriflow.step import step

files, columns = snakemake.input, snakemake.params.columns
with step(snakemake.log[0]):
    regions = {side: read_vertex_labels(files[f"{side}_regions"]) for side in SIDES}
    table = region_metrics(
        {side: read_surface(files[side]) for side in SIDES},
        {side: read_vertex_maps(files[f"{side}_maps"]) for side in SIDES},
        {side: labels for side, (labels, _) in regions.items()},
        {
            number: name
            for _, names in regions.values()
            for number, name in names.items()
        },
    )
    write_table(
        snakemake.output[0], table.assign(**columns)[[*columns, *table.columns]]
    )
