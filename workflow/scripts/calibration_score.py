"""Score a run of the calibration against the observed brains; no score if it diverged."""

from itertools import islice

import pandas as pd

from gyriflow.compare.calibration import run_score
from gyriflow.folding.start_regions import folded_surfaces
from gyriflow.io.files import read_json, read_table, write_table
from gyriflow.io.frames import read_positions
from gyriflow.io.surfaces import read_surface
from gyriflow.io.tetmeshes import read_regions
from gyriflow.step import step

files, params, run = snakemake.input, snakemake.params, snakemake.wildcards.run


def surface_at_week(regions, frames):
    """Return the pial surface of a simulation at the week of the comparison."""
    return folded_surfaces(read_regions(regions), read_positions(frames, params.week))[0]


with step(snakemake.log[0]):
    values = read_table(files.design).set_index("run").loc[run].to_dict()
    causes = [summary["diverged"] for summary in map(read_json, files.summaries) if summary["diverged"]]
    observed = map(read_surface, files.real)
    # read by `run_score`, since a diverged run has not reached the week
    simulated = map(surface_at_week, files.regions, files.frames)
    pairs = (
        (surface, brain)
        for surface, count in zip(simulated, params.compared, strict=True)
        for brain in islice(observed, count)
    )
    score = run_score(pairs, params.weights, causes, radius_mm=params.curvature_radius_mm)
    write_table(snakemake.output[0], pd.DataFrame([{"run": run, "round": params.round, **values, **score}]))
