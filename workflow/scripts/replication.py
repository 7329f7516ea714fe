"""What the paper reports beside the same of this study, with a verdict on each: a table and a page."""

from markupsafe import Markup

from gyriflow.compare.published import StudyTables, comparison_caption, replication
from gyriflow.io.figures import write_html
from gyriflow.io.files import read_json, read_table, write_table
from gyriflow.io.yaml_files import read_yaml
from gyriflow.report.tables import html_table
from gyriflow.step import step

NAMES = ("members", "comparison", "nearest")
files, params = snakemake.input, snakemake.params
with step(snakemake.log[0]):
    parts = (map(read_table, files[name]) for name in NAMES)
    tables = dict(zip(params.studies, zip(*parts, strict=True), strict=True))
    studies = {
        name: StudyTables(**params.studies[name], **dict(zip(NAMES, of, strict=True))) for name, of in tables.items()
    }
    published = read_yaml(files.published)
    displacement, summary = read_table(files.displacement), read_json(files.summary[0])
    run, brain = params.run
    displacement = displacement[(displacement["run"] == run) & (displacement["subject"] == brain)]
    table = replication(published, displacement, list(studies.values()), summary)
    write_table(snakemake.output.csv, table)
    said = [
        f"Displacements and cost are those of {' from '.join(params.run)}. The paper's brains: {published['atlas']}."
    ]
    said += [comparison_caption(name, study.week, study.comparison) for name, study in studies.items()]
    body = html_table(table)
    write_html(snakemake.output.page, Markup("").join(Markup("<p>{}</p>\n").format(line) for line in said) + body)
