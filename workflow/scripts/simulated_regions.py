"""Write the regions of a run's hemispheres: those of the start brain, which move with
the tissue."""

from gyriflow.geometry.triangles import TriangleMesh, submesh
from gyriflow.growth.carried_regions import regions_from_surface
from gyriflow.io.surfaces import read_surface, read_vertex_labels, write_vertex_labels
from gyriflow.io.tetmeshes import read_regions
from gyriflow.settings.terms import LEFT, SIDES, STRUCTURES
from gyriflow.step import step

files = snakemake.input
with step(snakemake.log[0]):
    start = read_regions(files.mesh)
    surface = TriangleMesh(start.mesh.vertices, start.facets)
    on_left = start.facet_tags["hemisphere"] == LEFT
    for side, part in zip(
        SIDES,
        (on_left, ~on_left),
        strict=True,
    ):
        labels, names = read_vertex_labels(files[f"{side}_regions"])
        found = regions_from_surface(
            submesh(surface, part)[0], read_surface(files[side]), labels
        )
        write_vertex_labels(
            snakemake.output[f"{side}_regions"], found, names, STRUCTURES[side]
        )
