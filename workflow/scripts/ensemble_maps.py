"""Write maps of the spread of an ensemble at a week on the hemispheres of its run."""

from gyriflow.compare.ensemble import ensemble_maps
from gyriflow.io.surfaces import STRUCTURES, read_surface, read_vertex_maps, write_vertex_maps
from gyriflow.step import step

files, sides = snakemake.input, snakemake.params.sides
with step(snakemake.log[0]):
    for number, side in enumerate(sides):
        # the run comes first, then its members, each with its sides
        run, *members = (read_surface(path) for path in files.surfaces[number :: len(sides)])
        values = [read_vertex_maps(path)["shape_index"] for path in files.maps[number :: len(sides)]]
        write_vertex_maps(snakemake.output[side], ensemble_maps(run, members, values), STRUCTURES[side])
