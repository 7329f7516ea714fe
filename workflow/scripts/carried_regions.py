"""Carry regions to the vertices of a brain's hemispheres from the brain on which they
are given."""

import numpy as np

from gyriflow.geometry.triangles import transformed
from gyriflow.growth.carrying import carry_regions
from gyriflow.io.registrations import read_correspondence
from gyriflow.io.surfaces import (
    read_pose,
    read_surface,
    read_vertex_labels,
    write_vertex_labels,
)
from gyriflow.settings.terms import SIDES, STRUCTURES
from gyriflow.step import step

files, reports = snakemake.input, (snakemake.input.given_report, snakemake.input.report)
with step(snakemake.log[0]):
    # correspondences are in the coordinates of the files
    back = [
        np.eye(4) if posed else read_pose(report).inverse
        for report, posed in zip(
            reports,
            snakemake.params.posed,
            strict=True,
        )
    ]
    between = read_correspondence(files.correspondence)
    for side in SIDES:
        regions, names = read_vertex_labels(files[f"{side}_regions"])
        pairs = zip(
            (files[f"given_{side}"], files[side]),
            back,
            strict=True,
        )
        found = carry_regions(
            regions,
            *(transformed(read_surface(path), matrix) for path, matrix in pairs),
            between,
        )
        write_vertex_labels(
            snakemake.output[f"{side}_regions"], found, names, STRUCTURES[side]
        )
