"""Score a run of the calibration against the observed brains; no score if it
diverged."""

import pandas as pd

from gyriflow.compare.calibration import run_score
from gyriflow.compare.comparison import observed_brain
from gyriflow.folding.folded_surfaces import folded_surfaces
from gyriflow.io.files import read_json, read_table, write_table
from gyriflow.io.frames import read_positions
from gyriflow.io.surfaces import read_surface
from gyriflow.io.tetmeshes import read_regions
from gyriflow.metrics.measure import surface_spectra
from gyriflow.step import step

files, params, run = snakemake.input, snakemake.params, snakemake.wildcards.run


def _pairs_with(observed, simulated):
    """Yield, for each simulated brain, what there is of it and of each of its observed
    brains."""
    for brain, count in zip(simulated, params.compared, strict=True):
        for _ in range(count):
            yield brain, next(observed)


with step(snakemake.log[0]):
    values = read_table(files.design).set_index("run").loc[run].to_dict()
    endings = [read_json(path)["diverged"] for path in files.summaries]
    causes = [cause for cause in endings if cause]
    radius_mm = params.settings["curvature_radius_mm"]
    simulated = []
    # a diverged run has not reached the week
    if not causes:
        for regions, frames in zip(
            files.regions,
            files.frames,
            strict=True,
        ):
            positions = read_positions(frames, params.week)
            simulated.append(folded_surfaces(read_regions(regions), positions))
    brains = (
        observed_brain(path, read_surface(path), radius_mm) for path in files.observed
    )
    simulated_spectra = (
        surface_spectra(left, right, **params.settings) for _, left, right in simulated
    )
    score = run_score(
        _pairs_with(brains, [whole for whole, _, _ in simulated]),
        params.weights,
        causes,
        radius_mm=radius_mm,
        spectra=_pairs_with(map(read_table, files.spectra), simulated_spectra),
    )
    row = {
        "run": run,
        "round": params.round,
        **values,
        **score,
    }
    write_table(snakemake.output[0], pd.DataFrame([row]))
