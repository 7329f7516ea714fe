"""The validated parameters of a run, which its folding reads and which stay with its results."""

from gyriflow.io.files import read_json
from gyriflow.io.yaml_files import write_yaml
from gyriflow.step import step

weeks = snakemake.params.weeks
with step(snakemake.log[0]):
    surface = read_json(snakemake.input[0])
    write_yaml(
        snakemake.output[0],
        {
            "start_week": weeks[0],
            "output_weeks": list(weeks),
            "fissure_x_mm": surface["fissure_x_mm"],
            **snakemake.params.settings,
        },
    )
