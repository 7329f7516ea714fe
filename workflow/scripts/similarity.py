"""How far a simulated brain's surface is from a measured one of the same week."""

import pandas as pd

from gyriflow.io.files import write_table
from gyriflow.io.surfaces import read_surface
from gyriflow.metrics.similarity import surface_distance
from gyriflow.step import step

with step(snakemake.log[0]):
    distances = surface_distance(read_surface(snakemake.input.simulated), read_surface(snakemake.input.real))
    rows = [
        {**snakemake.params.labels, "metric": name, "value": value, "unit": "mm"} for name, value in distances.items()
    ]
    write_table(snakemake.output[0], pd.DataFrame(rows))
