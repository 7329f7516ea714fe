"""How far a run of a study is from the real brains of its week; a table without rows where it has not come there."""

from itertools import batched

import pandas as pd

from gyriflow.compare.distances import aligned_distances
from gyriflow.compare.members import DISTANCE_COLUMNS, distances_to
from gyriflow.io.files import read_table, write_table
from gyriflow.io.surfaces import read_surface
from gyriflow.metrics.spangy import spectral_distances
from gyriflow.step import step

files, params, names = snakemake.input, snakemake.params, snakemake.wildcards
LABELS = ("subject", "run", "real", "real_population", "same_population")

with step(snakemake.log[0]):
    parts = [pd.DataFrame(columns=[*LABELS, *DISTANCE_COLUMNS])]
    if files.get("metrics"):
        metrics, spectra = (
            pd.concat(map(read_table, paths), ignore_index=True) for paths in (files.metrics, files.spectra)
        )
        spectral = spectral_distances(spectra)
        spectral = spectral[spectral["run"] != "real"]
        simulated, every_real = list(map(read_surface, files.simulated)), batched(files.measured, len(params.parts))
        for (real, population), of_real in zip(params.real.items(), every_real, strict=True):
            same = params.population == population
            labels = dict(zip(LABELS, (names.brain, names.run, real, population, same), strict=True))
            pairs = zip(params.parts, simulated, map(read_surface, of_real), strict=True)
            surfaces = {part: aligned_distances(mesh, measured) for part, mesh, measured in pairs}
            rows = distances_to(real, metrics, spectra, spectral, surfaces)
            parts.append(rows.assign(**labels)[[*LABELS, *DISTANCE_COLUMNS]])
    write_table(snakemake.output[0], pd.concat([part for part in parts if len(part)] or parts, ignore_index=True))
