"""Score a run of the calibration against the observed brains; no score if it
diverged."""

from itertools import islice

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


def _surfaces_at_week(regions, frames):
    """Return the pial surfaces of a simulation at the week of the comparison: the
    whole, left and right."""
    return folded_surfaces(read_regions(regions), read_positions(frames, params.week))


with step(snakemake.log[0]):
    values = read_table(files.design).set_index("run").loc[run].to_dict()
    causes = [
        summary["diverged"]
        for summary in map(read_json, files.summaries)
        if summary["diverged"]
    ]
    radius_mm = params.settings["curvature_radius_mm"]
    # a diverged run has not reached the week
    simulated = (
        [] if causes else list(map(_surfaces_at_week, files.regions, files.frames))
    )

    def pair_up(simulations, observed):
        """Yield each simulation's surface or table with that of each of its observed
        brains."""
        for simulation, count in zip(simulations, params.compared, strict=True):
            yield from ((simulation, brain) for brain in islice(observed, count))

    brains = (
        observed_brain(path, read_surface(path), radius_mm) for path in files.observed
    )
    pairs = pair_up((whole for whole, _, _ in simulated), brains)
    simulated_spectra = (
        surface_spectra(left, right, **params.settings) for _, left, right in simulated
    )
    spectra = pair_up(simulated_spectra, map(read_table, files.spectra))
    score = run_score(
        pairs, params.weights, causes, radius_mm=radius_mm, spectra=spectra
    )
    write_table(
        snakemake.output[0],
        pd.DataFrame([{"run": run, "round": params.round, **values, **score}]),
    )
