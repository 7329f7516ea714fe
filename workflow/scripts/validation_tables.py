"""Join the validation of all runs, and score the deviations of observed brains."""

from gyriflow.compare.deviation import deviation_scores
from gyriflow.io.files import read_tables, write_table
from gyriflow.step import step

files, params, output = snakemake.input, snakemake.params, snakemake.output
with step(snakemake.log[0]):
    tables = {
        name: read_tables(files[name]) for name, _ in output.items() if files.get(name)
    }
    if "deviation" in tables:
        tables["deviation_centiles"] = deviation_scores(
            tables["deviation"], individuals=params.individuals
        )
    for name, path in output.items():
        write_table(path, tables[name])
