"""Carry named sulci by registration to the vertices of a brain's hemispheres."""

from pathlib import Path

import numpy as np

from gyriflow.geometry.deformations import transform_points
from gyriflow.growth.carried_regions import PLACES_MM, regions_by_deformation, register_to_drawn_sulci
from gyriflow.growth.registration import channels
from gyriflow.io.surfaces import read_pose, read_surface, write_vertex_labels
from gyriflow.io.volumes import LabelSource, read_label_volume
from gyriflow.io.yaml_files import SCHEMES, read_yaml
from gyriflow.settings.terms import NO_REGION, SIDES, STRUCTURES
from gyriflow.step import step

files, params = snakemake.input, snakemake.params
with step(snakemake.log[0], files.volume):
    drawing, drawn = read_yaml(files.drawing), read_label_volume(files.drawn)
    names = {number: sulcus["name"] for number, sulcus in enumerate(drawing["sulci"], start=1)}
    drawn_on = LabelSource(Path(files.drawing).parent / drawing["labels"], "auto", SCHEMES[drawing["scheme"]])
    brains = []
    for labels in (params.labels, drawn_on):
        volume, scheme = labels.read(), labels.scheme
        parts = {"cerebrum": scheme.cerebrum, "cortex": scheme.cortex}
        brains.append(channels(volume.labels, volume.affine, **parts, voxel_mm=PLACES_MM))
    between = register_to_drawn_sulci(*brains, threads=snakemake.threads)
    back = np.eye(4) if params.posed else read_pose(files.report).inverse
    for side in SIDES:
        points = transform_points(read_surface(files[side]).vertices, back)
        labels = np.full(len(points), NO_REGION)
        if between is not None:
            labels = regions_by_deformation(points, between, drawn.labels, drawn.affine)
        write_vertex_labels(snakemake.output[f"{side}_regions"], labels, names, STRUCTURES[side])
