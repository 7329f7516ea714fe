"""Zones, tags and fields of a run on the start mesh, for a look before the solve."""

from gyriflow.folding.output import layer_fields
from gyriflow.folding.parameters import parameters_from, require_maps
from gyriflow.folding.regions import cell_tags, facet_tags
from gyriflow.folding.zone_checks import refuse_impossible
from gyriflow.folding.zones import zones_of_run
from gyriflow.io.maps import read_maps
from gyriflow.io.regions import Regions, write_regions
from gyriflow.io.tetmeshes import read_tetrahedral_mesh
from gyriflow.io.yaml_files import read_yaml
from gyriflow.step import step

FIELDS = ("zones", "distance", "cortex_weight", "growth", "shear_modulus", "bulk_modulus", "normal")

files = snakemake.input
with step(snakemake.log[0]):
    mesh = read_tetrahedral_mesh(files.mesh)
    parameters = parameters_from(read_yaml(files.params))
    maps = read_maps(files.maps) if files.maps else {}
    require_maps(parameters, maps, len(mesh.vertices))
    zones = zones_of_run(mesh, parameters)
    refuse_impossible(mesh, zones)
    fields = layer_fields(mesh.vertices, zones, parameters, maps, parameters.start_week, FIELDS)
    tags = cell_tags(mesh, zones, fields["cortex_weight"]), facet_tags(mesh, zones)
    write_regions(snakemake.output.mesh, Regions(mesh, zones.facets, fields, *tags))
