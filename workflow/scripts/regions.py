"""Zones and fields of a run on the start mesh, for a look before the solve."""

from gyriflow.folding.output import layer_fields
from gyriflow.folding.parameters import parameters_from
from gyriflow.folding.zones import refuse_impossible, zones_of_run
from gyriflow.io.tetmeshes import read_tetrahedral_mesh, write_tetrahedral_mesh
from gyriflow.io.yaml_files import read_yaml
from gyriflow.step import step

FIELDS = ("zones", "distance", "cortex_weight", "growth", "shear_modulus", "normal")

with step(snakemake.log[0]):
    mesh = read_tetrahedral_mesh(snakemake.input.mesh)
    parameters = parameters_from(read_yaml(snakemake.input.params))
    zones = zones_of_run(mesh, parameters)
    refuse_impossible(mesh, zones)
    write_tetrahedral_mesh(snakemake.output.mesh, mesh, layer_fields(mesh.vertices, zones, parameters, FIELDS))
