"""The pial surface of a folding run at a week, and its hemispheres: the facets that were theirs at the start."""

import numpy as np

from gyriflow.geometry.triangles import TriangleMesh, submesh
from gyriflow.io.frames import read_positions
from gyriflow.io.regions import read_regions
from gyriflow.io.surfaces import write_surface
from gyriflow.parameters.terms import LEFT
from gyriflow.step import step

output = snakemake.output
with step(snakemake.log[0]):
    regions = read_regions(snakemake.input.regions)
    positions = read_positions(snakemake.input.frames, float(snakemake.wildcards.week))
    surface, on_left = TriangleMesh(positions, regions.facets), regions.facet_tags["hemisphere"] == LEFT
    for name, part, structure in (
        ("whole", np.ones_like(on_left), None),
        ("left", on_left, "CortexLeft"),
        ("right", ~on_left, "CortexRight"),
    ):
        write_surface(output[name], submesh(surface, part)[0], structure)
