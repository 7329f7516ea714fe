"""How far the brains of a run of the calibration are from the real ones; no score where the run has diverged."""

import numpy as np
import pandas as pd

from gyriflow.compare.calibration import SIZE_SCORES, shape_scores
from gyriflow.compare.distances import aligned_distances
from gyriflow.compare.shapes import prepare_for_comparison
from gyriflow.io.files import read_json, read_table, write_table
from gyriflow.io.surfaces import read_surface
from gyriflow.step import step

files, params, run = snakemake.input, snakemake.params, snakemake.wildcards.run


with step(snakemake.log[0]):
    values = read_table(files.design).set_index("run").loc[run].to_dict()
    causes = [summary["diverged"] for summary in map(read_json, files.summaries) if summary["diverged"]]
    simulated, reals, rows = list(map(read_surface, files.simulated)), list(map(read_surface, files.real)), []
    pairs = zip(np.repeat(np.arange(len(params.compared)), params.compared), reals, strict=True)
    for mesh, real in [(simulated[number], real) for number, real in pairs] if not causes else []:
        shapes = set(params.weights) - {*SIZE_SCORES, "surface_distance"}
        both = (prepare_for_comparison(brain, real, params.curvature_radius_mm) for brain in (mesh, real))
        row = shape_scores(*both, shapes) if shapes else {}
        row |= {name: score(mesh, real) for name, score in SIZE_SCORES.items() if name in params.weights}
        distance = {"surface_distance": aligned_distances(mesh, real)["distance_mm"]}
        rows.append(row | (distance if "surface_distance" in params.weights else {}))
    found = pd.DataFrame(rows, columns=list(params.weights)).mean()
    score = sum(weight * found[name] for name, weight in params.weights.items())
    outcome = {"outcome": "diverged" if causes else "finished", "cause": "; ".join(causes)}
    labels = {"run": run, "round": params.round, **values, "score": score}
    write_table(snakemake.output[0], pd.DataFrame([labels | found.to_dict() | outcome]))
