"""Score of a run of the calibration against the observed brains; none if the run has diverged."""

from itertools import islice

import pandas as pd

from gyriflow.compare.calibration import run_score
from gyriflow.io.files import read_json, read_table, write_table
from gyriflow.io.surfaces import read_surface
from gyriflow.step import step

files, params, run = snakemake.input, snakemake.params, snakemake.wildcards.run
with step(snakemake.log[0]):
    values = read_table(files.design).set_index("run").loc[run].to_dict()
    causes = [summary["diverged"] for summary in map(read_json, files.summaries) if summary["diverged"]]
    observed = map(read_surface, files.real)
    # a run that has diverged has not all surfaces
    pairs = [
        (simulated, brain)
        for simulated, count in zip(map(read_surface, files.simulated), params.compared, strict=not causes)
        for brain in islice(observed, count)
    ]
    score = run_score(pairs, params.weights, causes, radius_mm=params.curvature_radius_mm)
    write_table(snakemake.output[0], pd.DataFrame([{"run": run, "round": params.round, **values, **score}]))
