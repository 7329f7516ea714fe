"""The tables of a study: its members and how they ended, how near they are to real brains, and which are nearest."""

import pandas as pd

from gyriflow.compare.members import member_row, nearest, side_by_side
from gyriflow.compare.published import comparison_caption, with_published_nearest
from gyriflow.io.figures import write_printed
from gyriflow.io.files import read_json, read_table
from gyriflow.io.yaml_files import read_yaml
from gyriflow.step import step

files, params, study = snakemake.input, snakemake.params, snakemake.wildcards.study


def paths(name):
    """Returns the files of one of the tables, by kind."""
    return {kind: snakemake.output[f"{name}_{kind}"] for kind in ("csv", "md", "tex")}


with step(snakemake.log[0]):
    rows = []
    for member, own, zones, summary in zip(params.members, files.params, files.zones, files.summaries, strict=True):
        labels = {"study": study, "run": member["run"], "subject": member["subject"], "compare_week": params.week}
        rows.append(member_row(labels, member["values"], read_yaml(own), read_json(zones), read_json(summary)))
    members, varied = pd.DataFrame(rows), list(params.members[0]["values"])
    found = pd.concat(map(read_table, files.comparisons), ignore_index=True)
    comparison = members[["subject", "run", *varied, "resolution"]].merge(found, on=["subject", "run"])
    caption = comparison_caption(study, params.week, found)
    write_printed(paths("members"), members, f"Runs of the study {study}: how each ended, and what it took.")
    wide = side_by_side(comparison, varied)
    write_printed(paths("comparison"), comparison, f"Distance of each run from the real. {caption}", printed=wide)
    closest = with_published_nearest(nearest(found, members, varied), read_yaml(files.published), varied, params.week)
    write_printed(paths("nearest"), closest, f"Nearest run by each measure. {caption}")
