"""Write the intervals of a run from the members of its ensemble."""

from gyriflow.compare.accuracy import interval_table
from gyriflow.io.files import read_tables, write_table
from gyriflow.io.yaml_files import read_yaml
from gyriflow.step import step

files = snakemake.input
with step(snakemake.log[0]):
    run, members = map(read_tables, (files.run, files.members))
    observed = read_tables(files.observed) if files.observed else run[:0]
    tests = read_yaml(files.accuracy)["rows"] if files.accuracy else []
    write_table(
        snakemake.output[0],
        interval_table(run, members, observed, tests),
    )
