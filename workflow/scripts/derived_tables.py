"""What follows from the metrics of all brains: long and wide tables, change, asymmetry, norms, distances of spectra."""

import pandas as pd

from gyriflow.io.files import read_table, write_table
from gyriflow.metrics.norms import measured_norms, measured_scores, norm_curves
from gyriflow.metrics.spangy import spectral_distances
from gyriflow.metrics.tables import asymmetry, change_between_scans, long_table, wide_table
from gyriflow.step import step

files, params = snakemake.input, snakemake.params
with step(snakemake.log[0]):
    metrics = read_table(files.metrics)
    people = metrics.assign(person=metrics["subject"].map(params.subjects))
    regions = [read_table(files.regions)] if files.regions else []
    long = long_table([metrics, *regions])
    parts = [asymmetry(table.fillna({"region": ""})) for table in (metrics.assign(region=""), *regions)]
    tables = {
        "metrics_long": long,
        "metrics_wide": wide_table(long, params.covariates),
        "change": change_between_scans(long, params.scans),
        "asymmetry": pd.concat(parts, ignore_index=True),
        "norms": measured_norms(people, params.reference),
        "norm_curves": norm_curves(people, params.reference, individuals=params.individuals),
        "centiles": measured_scores(people, params.reference, individuals=params.individuals),
        "spectral_distance": spectral_distances(read_table(files.spectra)),
    }
    for name, table in tables.items():
        write_table(snakemake.output[name], table)
