"""Export surfaces, maps, regions and tables of a study as a BIDS derivative."""

from pathlib import Path

from gyriflow.io.exports import export_bids
from gyriflow.io.files import read_table
from gyriflow.io.made_files import making_files
from gyriflow.metrics.tables import described_columns, wide_table
from gyriflow.step import step
from gyriflow.version import version

files, params = snakemake.input, snakemake.params
with step(snakemake.log[0]):
    folder = Path(snakemake.output[0]).parent
    long = read_table(files.long)
    # made anew, since covariates are texts that may look like numbers
    wide = wide_table(
        long,
        {brain.brain: brain.covariates for brain in params.brains},
    )
    tables = {"metrics_long": long, "metrics_wide": wide}
    with making_files(folder, folder.with_name(".export-files.json")):
        export_bids(
            folder,
            params.brains,
            tables,
            version(),
            described_columns(long),
        )
