"""How many modes each hemisphere needs by Weyl's law, of measured and simulated brains."""

import pandas as pd

from gyriflow.io.files import write_table
from gyriflow.io.surfaces import read_surface
from gyriflow.metrics.spangy import weyl_numbers
from gyriflow.step import step

files, params = iter(snakemake.input), snakemake.params
with step(snakemake.log[0]):
    tables = []
    for labels, sides in zip(params.labels, params.sides, strict=True):
        brain = {side: read_surface(next(files)) for side in sides}
        table = weyl_numbers(brain, params.formula)
        tables.append(table.assign(**labels)[[*labels, *table.columns]])
    write_table(snakemake.output[0], pd.concat(tables, ignore_index=True))
