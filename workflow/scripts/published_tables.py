"""Parameters, displacement, growth rates and cost beside what the FetalFoldSim paper reports."""

import pandas as pd

from gyriflow.compare.published import cost_table, displacement_table, growth_table, parameters_table
from gyriflow.io.figures import write_printed
from gyriflow.io.files import read_json, read_table
from gyriflow.io.yaml_files import read_yaml
from gyriflow.step import step

files, folded = snakemake.input, snakemake.params.folded
OTHER = "The paper's brains are those of a normal atlas (dHCP); here:"

with step(snakemake.log[0]):
    several = len({brain for _, brain in folded}) > 1
    names = [f"{run} {brain}" if several else run for run, brain in folded]
    published = read_yaml(files.published)
    params = dict(zip(names, map(read_yaml, files.params), strict=True))
    moves = [read_table(path).assign(run=name) for name, path in zip(names, files.displacement, strict=True)]
    summaries = dict(zip(names, map(read_json, files.summaries), strict=True))
    lasted = {name: (own["end_week"] - own["start_week"], summaries[name]) for name, own in params.items()}
    rates = pd.DataFrame(columns=["series", "from_week", "to_week", "rate_per_s", "core_rate_per_s"])
    rates = read_table(files.rates) if files.rates else rates
    brains = f"{OTHER} {', '.join(dict.fromkeys(snakemake.params.populations))}."
    for name, table, caption in (
        ("parameters", parameters_table(published, params), "Parameters of the runs beside the paper's."),
        ("displacement", displacement_table(published, pd.concat(moves)), f"Weekly displacement norms. {brains}"),
        ("growth_rates", growth_table(published, rates), f"Growth rates from measured brains. {brains}"),
        ("cost", cost_table(published, lasted), "What the runs took, beside the paper's."),
    ):
        write_printed({kind: snakemake.output[f"{name}_{kind}"] for kind in ("csv", "md", "tex")}, table, caption)
