"""Write the maps of a brain's hemisphere at the vertices of the study's template."""

import numpy as np

from gyriflow.geometry.triangles import transformed
from gyriflow.growth.carrying import maps_on_template
from gyriflow.io.registrations import read_correspondence
from gyriflow.io.surfaces import (
    STRUCTURES,
    read_pose,
    read_surface,
    read_vertex_maps,
    write_vertex_maps,
)
from gyriflow.step import step

files = snakemake.input
with step(snakemake.log[0]):
    between = [read_correspondence(path) for path in files.get("correspondence", [])]
    # correspondences are in the coordinates of the files
    places = zip(
        (files.template, files.surface),
        (files.template_report, files.report),
        snakemake.params.posed,
        strict=True,
    )
    template, surface = (
        transformed(
            read_surface(path),
            np.eye(4) if posed or not between else read_pose(report).inverse,
        )
        for path, report, posed in places
    )
    maps = maps_on_template(read_vertex_maps(files.maps), surface, template, between)
    write_vertex_maps(
        snakemake.output[0],
        maps,
        STRUCTURES[snakemake.wildcards.side],
    )
