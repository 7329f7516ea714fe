"""How far a simulated brain's surface is from a measured one of the same week."""

import pandas as pd

from gyriflow.io.files import write_table
from gyriflow.io.surfaces import read_surface
from gyriflow.metrics.similarity import surface_distance
from gyriflow.step import step

labels = snakemake.params.labels
with step(snakemake.log[0]):
    distances = surface_distance(read_surface(snakemake.input.simulated), read_surface(snakemake.input.real))
    # the names end in their unit
    parts = [(*name.rsplit("_", 1), value) for name, value in distances.items()]
    rows = [{**labels, "metric": name, "value": value, "unit": unit} for name, unit, value in parts]
    write_table(snakemake.output[0], pd.DataFrame(rows))
