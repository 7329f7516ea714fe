"""The pial surface of a folding run at a week, its hemispheres (the facets that were theirs) and its thickness."""

import numpy as np

from gyriflow.folding.regions import LEFT
from gyriflow.geometry.triangles import TriangleMesh, submesh
from gyriflow.io.frames import read_positions
from gyriflow.io.regions import read_regions
from gyriflow.io.surfaces import write_surface, write_vertex_maps
from gyriflow.metrics.thickness import depth_of_weight, simulated_thickness
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
    if output.get("thickness"):
        depth, pial = depth_of_weight(regions.fields["cortex_weight"]), submesh(surface, np.ones_like(on_left))[0]
        write_vertex_maps(output.thickness, {"thickness_mm": simulated_thickness(regions.mesh, depth, positions, pial)})
