"""What all runs are worth, in one table of each kind, and where deviations stand among those of other brains."""

from gyriflow.compare.deviation import deviation_scores
from gyriflow.io.files import read_tables, write_table
from gyriflow.step import step

with step(snakemake.log[0]):
    tables = {name: read_tables(paths) for name, paths in snakemake.input.items() if paths}
    if "deviation" in tables:
        individuals = snakemake.params.individuals
        tables["deviation_centiles"] = deviation_scores(tables["deviation"], individuals=individuals)
    for name, path in snakemake.output.items():
        write_table(path, tables[name])
