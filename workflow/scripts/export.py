"""Surfaces, maps, regions and tables of a study in one folder to hand on."""

from gyriflow.io.exports import ExportedBrain, export_bids, export_plain
from gyriflow.io.files import emptied, read_table
from gyriflow.step import step
from gyriflow.version import version

files, params = snakemake.input, snakemake.params
with step(snakemake.log[0]):
    folder = emptied(snakemake.output[0])
    brains = [ExportedBrain(**brain) for brain in params.brains]
    tables = {"metrics_long": read_table(files.long), "metrics_wide": read_table(files.wide)}
    if params.names == "bids":
        export_bids(folder, brains, tables, version())
    else:
        export_plain(folder, brains, tables)
