"""How far a run of a study is from the real brains of its week; a table without rows where it has not come there."""

import pandas as pd

from gyriflow.compare.members import COLUMNS, distances_to
from gyriflow.io.files import read_table, write_table
from gyriflow.metrics.spangy import spectral_distances
from gyriflow.step import step

files, params, names = snakemake.input, snakemake.params, snakemake.wildcards
LABELS = ("subject", "run", "real", "real_population", "same_population")

with step(snakemake.log[0]):
    parts = [pd.DataFrame(columns=[*LABELS, *COLUMNS])]
    if files.get("metrics"):
        metrics, spectra, similarity = (
            pd.concat(map(read_table, paths), ignore_index=True)
            for paths in (files.metrics, files.spectra, files.similarity)
        )
        spectral = spectral_distances(spectra)
        spectral = spectral[spectral["run"] != "real"]
        for real, population in params.real.items():
            same = params.population == population
            labels = dict(zip(LABELS, (names.brain, names.run, real, population, same), strict=True))
            rows = distances_to(real, metrics, spectra, spectral, similarity)
            parts.append(rows.assign(**labels)[[*LABELS, *COLUMNS]])
    write_table(snakemake.output[0], pd.concat([part for part in parts if len(part)] or parts, ignore_index=True))
