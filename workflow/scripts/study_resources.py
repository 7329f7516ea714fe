"""Time, memory, energy and emissions of all jobs: a row per simulation and per rule, and as a table for the report."""

from gyriflow.io.figures import write_html
from gyriflow.io.files import read_json, read_table, write_table
from gyriflow.io.jobs import read_benchmarks
from gyriflow.parameters.terms import run_names
from gyriflow.report.resources import Power, resources_html, simulation, stage_resources
from gyriflow.step import step

files, output, params = snakemake.input, snakemake.output, snakemake.params
with step(snakemake.log[0]):
    names = run_names(params.folded)
    folded = {tuple(pair): name for pair, name in zip(params.folded, names, strict=True)}
    runs = {
        name: simulation(read_json(summary), read_table(steps))
        for name, summary, steps in zip(names, files.summaries, files.steps, strict=True)
    }
    jobs = read_benchmarks(".", params.benchmarks)
    jobs["run"] = [folded.get((run, brain)) for run, brain in zip(jobs["run"], jobs["brain"], strict=True)]
    power = Power(**params.power)
    stages = stage_resources(jobs, runs, power)
    write_table(output.csv, stages)
    write_html(output.table, resources_html(stages, power, caption="Time, memory, energy and emissions"))
