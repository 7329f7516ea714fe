"""Cortical areas and brain volumes of all brains, and the growth rates between their weeks."""

import pandas as pd

from gyriflow.geometry.triangles import area, signed_volume
from gyriflow.growth.rates import growth_rates
from gyriflow.io.files import write_table
from gyriflow.io.surfaces import read_surface
from gyriflow.step import step
from gyriflow.units import CM2_PER_MM2, ML_PER_MM3

files, params = snakemake.input, snakemake.params
with step(snakemake.log[0]):
    areas = pd.DataFrame(
        {
            "subject": params.brains,
            "week": params.weeks,
            "area_cm2": [
                (area(read_surface(left)) + area(read_surface(right))) * CM2_PER_MM2
                for left, right in zip(files.left, files.right, strict=True)
            ],
            "volume_ml": [signed_volume(read_surface(whole)) * ML_PER_MM3 for whole in files.whole],
        }
    ).sort_values("week")
    # brains of one week count as their mean
    weekly = areas.groupby("week", as_index=False)[["area_cm2", "volume_ml"]].mean()
    rates = growth_rates(weekly["week"], weekly["area_cm2"] / CM2_PER_MM2, weekly["volume_ml"] / ML_PER_MM3)
    write_table(snakemake.output.areas, areas)
    write_table(snakemake.output.rates, rates)
