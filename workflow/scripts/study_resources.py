"""Time, memory, energy and emissions of all jobs: a row per simulation and per rule, and as a table for the report."""

from gyriflow.io.benchmarks import read_benchmarks
from gyriflow.io.figures import write_html
from gyriflow.io.files import read_json, read_table, write_table
from gyriflow.report.resources import Power, resources_html, simulation, stage_resources
from gyriflow.step import step

files, output, params = snakemake.input, snakemake.output, snakemake.params
with step(snakemake.log[0]):
    runs = {
        run: simulation(read_json(summary), read_table(steps))
        for run, summary, steps in zip(params.runs, files.summaries, files.steps, strict=True)
    }
    power = Power(**params.power)
    stages = stage_resources(read_benchmarks(".", params.benchmarks), runs, power)
    write_table(output.csv, stages)
    write_html(output.table, resources_html(stages, power, caption="Time, memory, energy and emissions"))
