"""Time, memory, energy and emissions of all jobs, as a table and as a page for the report, and their warnings."""

from gyriflow.io.figures import write_html
from gyriflow.io.files import write_table
from gyriflow.report.tables import html_table, resources
from gyriflow.running.jobs import gather_messages, read_benchmarks
from gyriflow.settings.terms import run_names
from gyriflow.step import step

output, params = snakemake.output, snakemake.params
with step(snakemake.log[0]):
    names = dict(zip(map(tuple, params.folded), run_names(params.folded), strict=True))
    jobs = read_benchmarks(".", params.benchmarks)
    # all but the simulations are told by rule alone
    jobs["run"] = [
        names.get((run, brain)) if rule == "simulate" else None
        for rule, run, brain in zip(jobs["rule"], jobs["run"], jobs["brain"], strict=True)
    ]
    table = resources(jobs)
    write_table(output.csv, table)
    write_html(output.table, html_table(table))
    write_table(output.warnings, gather_messages(".", params.brains, params.folded))
