"""Zones, tags and fields of a run on the start mesh, for inspection before the solve."""

import numpy as np

from gyriflow.anatomy.fissure import nearer_left
from gyriflow.folding.checks import refuse_impossible
from gyriflow.folding.growth import GrowthInputs, StepStart
from gyriflow.folding.growth_models import growth_model
from gyriflow.folding.output import layer_fields
from gyriflow.folding.zones import cell_tags, facet_tags, zones_of_run
from gyriflow.geometry.triangles import TriangleMesh
from gyriflow.io.surfaces import read_surface
from gyriflow.io.tetmeshes import Regions, read_maps, read_tetrahedral_mesh, write_regions
from gyriflow.io.yaml_files import read_yaml
from gyriflow.settings.folding import parameters_from, require_maps
from gyriflow.settings.terms import REGION_FIELDS
from gyriflow.step import step

files = snakemake.input
with step(snakemake.log[0]):
    mesh, parameters = read_tetrahedral_mesh(files.mesh), parameters_from(read_yaml(files.params))
    maps = read_maps(files.maps) if files.maps else {}
    require_maps(parameters, maps, len(mesh.vertices))
    zones = zones_of_run(mesh, parameters)
    refuse_impossible(mesh, zones)
    model = growth_model(parameters, GrowthInputs.of(mesh, zones, maps), mesh.vertices)
    growth = model(StepStart(mesh.vertices, 0.0, parameters.step_s))
    of_start = parameters.start_week, REGION_FIELDS, growth.logarithm()
    fields = layer_fields(mesh.vertices, zones, growth.parameters, maps, *of_start)
    boundary = TriangleMesh(mesh.vertices, zones.facets)
    if parameters.side is None:
        on_left = nearer_left(boundary, *map(read_surface, files.sides))
    else:
        on_left = np.full(len(zones.facets), parameters.side == "left")
    tags = cell_tags(mesh, zones, fields["cortex_weight"]), facet_tags(zones, on_left)
    write_regions(snakemake.output.mesh, Regions(mesh, zones.facets, fields, *tags))
