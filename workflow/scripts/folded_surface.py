"""The pial surface of a folding run at a week, its hemispheres (the facets that were theirs) and its thickness."""

from gyriflow.geometry.triangles import TriangleMesh, submesh
from gyriflow.io.frames import read_positions
from gyriflow.io.surfaces import write_brain, write_vertex_maps
from gyriflow.io.tetmeshes import read_regions
from gyriflow.metrics.thickness import depth_of_weight, simulated_thickness
from gyriflow.settings.terms import LEFT
from gyriflow.step import step

with step(snakemake.log[0]):
    regions = read_regions(snakemake.input.regions)
    positions = read_positions(snakemake.input.frames, float(snakemake.wildcards.week))
    surface, on_left = TriangleMesh(positions, regions.facets), regions.facet_tags["hemisphere"] == LEFT
    parts = on_left, ~on_left
    left, right = (submesh(surface, part)[0] if part.any() else None for part in parts)
    whole = submesh(surface, parts[0] | parts[1])[0]
    write_brain(snakemake.output, whole, left, right)
    depth = depth_of_weight(regions.fields["cortex_weight"])
    thickness = simulated_thickness(regions.mesh, depth, positions, whole)
    write_vertex_maps(snakemake.output.thickness, {"thickness_mm": thickness})
