"""Export surfaces, maps, regions and tables of a study as a BIDS derivative."""

from pathlib import Path

from gyriflow.io.exports import ExportedBrain, export_bids
from gyriflow.io.files import read_table
from gyriflow.io.made_files import making_files
from gyriflow.metrics.tables import wide_names
from gyriflow.step import step
from gyriflow.version import version

files, params = snakemake.input, snakemake.params
with step(snakemake.log[0]):
    folder = Path(snakemake.output[0]).parent
    brains = [ExportedBrain(**brain) for brain in params.brains]
    tables = {"metrics_long": read_table(files.long), "metrics_wide": read_table(files.wide)}
    units = dict(zip(wide_names(tables["metrics_long"]), tables["metrics_long"]["unit"], strict=True))
    with making_files(folder, folder.with_name(".export-files.json")):
        export_bids(folder, brains, tables, version(), units)
