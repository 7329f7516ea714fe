"""The methods of a study as text with citations, filled with what was run."""

from gyriflow.io.files import read_json, read_text, write_text
from gyriflow.io.yaml_files import read_yaml
from gyriflow.report.page import methods_text
from gyriflow.step import step

files, params = snakemake.input, snakemake.params
with step(snakemake.log[0]):
    runs = [
        {"run": run, "start": brain, "parameters": read_yaml(settings), "summary": read_json(summary)}
        for (run, brain), settings, summary in zip(params.folded, files.params, files.summaries, strict=True)
    ]
    software = read_json(files.provenance)
    write_text(
        snakemake.output[0], methods_text(read_text(files.template), runs=runs, software=software, **params.used)
    )
