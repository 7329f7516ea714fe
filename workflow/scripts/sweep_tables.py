"""Write the tables of a sweep: its runs and their outcome, distances to observed
brains, and the nearest runs."""

import pandas as pd

from gyriflow.compare.sweeps import (
    joined_comparisons,
    member_row,
    nearest_runs,
    with_common_cut,
)
from gyriflow.io.files import read_json, read_table, read_tables, write_table
from gyriflow.io.yaml_files import read_yaml
from gyriflow.metrics.repeatability import with_distance_noise
from gyriflow.step import step

files, output, params = snakemake.input, snakemake.output, snakemake.params
with step(snakemake.log[0]):
    rows = []
    for member, settings, zones, summary in zip(
        params.members, files.params, files.zones, files.summaries, strict=True
    ):
        labels = {
            "sweep": snakemake.wildcards.sweep,
            "run": member["run"],
            "subject": member["subject"],
        }
        labels["compare_week"] = params.week
        rows.append(
            member_row(
                labels,
                member["values"],
                read_yaml(settings),
                read_json(zones),
                read_json(summary),
            )
        )
    members, varied = pd.DataFrame(rows), list(params.members[0]["values"])
    found = joined_comparisons(map(read_table, files.comparisons))
    # observed brains are compared with several runs
    coefficients = read_tables(files.coefficients).drop_duplicates()
    if len(coefficients):
        found = with_common_cut(found, coefficients)
    found = with_distance_noise(found, read_yaml(files.noise), "measure")
    comparison = members[["subject", "run", *varied, "resolution"]].merge(
        found, on=["subject", "run"]
    )
    write_table(output.members, members)
    write_table(output.comparison, comparison)
    write_table(output.nearest, nearest_runs(found, members, varied))
