"""The tables of a study: its members and how they ended, how near they are to real brains, and which are nearest."""

import pandas as pd

from gyriflow.compare.members import member_row, nearest
from gyriflow.compare.published import with_published_nearest
from gyriflow.io.files import read_json, read_table, write_table
from gyriflow.io.yaml_files import read_yaml
from gyriflow.step import step

files, output, params = snakemake.input, snakemake.output, snakemake.params
with step(snakemake.log[0]):
    rows = []
    for member, own, zones, summary in zip(params.members, files.params, files.zones, files.summaries, strict=True):
        labels = {
            "study": snakemake.wildcards.study,
            "run": member["run"],
            "subject": member["subject"],
            "compare_week": params.week,
        }
        rows.append(member_row(labels, member["values"], read_yaml(own), read_json(zones), read_json(summary)))
    members, varied = pd.DataFrame(rows), list(params.members[0]["values"])
    found = pd.concat(map(read_table, files.comparisons), ignore_index=True)
    comparison = members[["subject", "run", *varied, "resolution"]].merge(found, on=["subject", "run"])
    closest = nearest(found, members, varied)
    write_table(output.members, members)
    write_table(output.comparison, comparison)
    write_table(output.nearest, with_published_nearest(closest, read_yaml(files.published), varied, params.week))
