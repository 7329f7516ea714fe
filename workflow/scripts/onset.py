"""Measure the onset week of each sulcus of the last observed brain, in the observed brains and in a run."""

import pandas as pd

from gyriflow.compare.onset import find_named_sulci, onset_table
from gyriflow.growth.carrying import carry_to_pose
from gyriflow.io.files import write_table
from gyriflow.io.registrations import read_correspondence
from gyriflow.io.surfaces import read_pose, read_surface, read_vertex_labels
from gyriflow.settings.terms import MEASURED
from gyriflow.step import step

files, params, tables = snakemake.input, snakemake.params, []
with step(snakemake.log[0]):
    pairs = [read_correspondence(path) for path in files.correspondences]
    poses = [read_pose(path) for path in files.reports]
    for side in params.sides:
        observed = dict(zip(params.real_weeks, map(read_surface, files[f"real_{side}"]), strict=True))
        simulated = dict(zip(params.run_weeks, map(read_surface, files[f"run_{side}"]), strict=True))
        *_, last = observed.values()
        labels, names = read_vertex_labels(path) if (path := files.get(f"{side}_regions")) else (None, {})
        sulci = find_named_sulci(last, side, labels, names, radius_mm=params.radius_mm)
        carried = [
            carry_to_pose(mesh, poses[number], pairs[number:], poses[-1])
            for number, mesh in enumerate(observed.values())
        ]
        # a run has the same vertices as its start brain
        start = carry_to_pose(next(iter(simulated.values())), poses[0], pairs, poses[-1])
        on_last = {MEASURED: carried, params.run: [start for _ in simulated]}
        for run, surfaces in ((MEASURED, observed), (params.run, simulated)):
            table = onset_table(surfaces, on_last[run], last, *sulci)
            tables.append(table.assign(run=run, subject=params.subject, hemisphere=side))
    write_table(snakemake.output[0], pd.concat(tables, ignore_index=True))
