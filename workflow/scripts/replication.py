"""Compare a study with the results of the paper: two tables, and a page with the verdicts."""

from markupsafe import Markup

from gyriflow.compare.published import SweepTables, comparison_caption, published_nearest, replication_table
from gyriflow.io.figures import write_html
from gyriflow.io.files import read_json, read_table, write_table
from gyriflow.io.yaml_files import read_yaml
from gyriflow.report.tables import html_table
from gyriflow.step import step

files, output, params = snakemake.input, snakemake.output, snakemake.params
with step(snakemake.log[0]):
    sweeps = {
        name: SweepTables(
            **settings, **{table: read_table(files[table][number]) for table in ("members", "comparison", "nearest")}
        )
        for number, (name, settings) in enumerate(params.studies.items())
    }
    published = read_yaml(files.published)
    displacement, summary = read_table(files.displacement), read_json(files.summary[0])
    run, brain = params.run
    displacement = displacement[(displacement["run"] == run) & (displacement["subject"] == brain)]
    table = replication_table(published, displacement, list(sweeps.values()), summary)
    write_table(output.csv, table)
    write_table(output.nearest, published_nearest(published, sweeps))
    lines = [
        f"Displacements and cost are those of {' from '.join(params.run)}. The paper's brains: {published['atlas']}.",
        *(comparison_caption(name, sweep.week, sweep.comparison) for name, sweep in sweeps.items()),
    ]
    paragraphs = Markup("").join(Markup("<p>{}</p>\n").format(line) for line in lines)
    write_html(output.page, paragraphs + html_table(table))
