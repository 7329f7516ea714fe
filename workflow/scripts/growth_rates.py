"""Measure cortical areas and brain volumes of all brains, and growth rates between
their weeks."""

import pandas as pd

from gyriflow.geometry.triangles import area_cm2, volume_ml
from gyriflow.growth.rates import TISSUES, rates_of_series
from gyriflow.io.files import read_json, write_table
from gyriflow.io.surfaces import read_surface
from gyriflow.step import step

files, params, output = snakemake.input, snakemake.params, snakemake.output
with step(snakemake.log[0]):
    areas = pd.DataFrame(
        {
            "series": params.series,
            "subject": params.brains,
            "week": params.weeks,
        }
    )
    surfaces = [read_surface(file) for file in files.whole]
    areas["area_cm2"] = list(map(area_cm2, surfaces))
    areas["volume_ml"] = list(map(volume_ml, surfaces))
    tissues = [
        read_json(report).get("label_volumes_mL", {}) for report in files.reports
    ]
    for tissue in TISSUES:
        areas[f"{tissue}_ml"] = [volumes.get(tissue) for volumes in tissues]
    write_table(output.areas, areas)
    write_table(output.rates, rates_of_series(areas, params.with_rates))
