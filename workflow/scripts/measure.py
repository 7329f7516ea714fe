"""Measure an observed or a simulated brain at a week; of a simulated brain, also write
surfaces and thickness."""

from gyriflow.folding.folded_surfaces import folded_surfaces
from gyriflow.geometry.matching import match_surface, values_at
from gyriflow.io.files import read_json, write_table
from gyriflow.io.frames import read_positions
from gyriflow.io.surfaces import (
    STRUCTURES,
    read_surface,
    read_vertex_maps,
    write_brain,
    write_vertex_maps,
)
from gyriflow.io.tetmeshes import read_regions
from gyriflow.metrics.measure import measure_brain
from gyriflow.metrics.thickness import depth_of_weight, simulated_thickness
from gyriflow.settings.terms import SIDES
from gyriflow.step import step

files, output, params = snakemake.input, snakemake.output, snakemake.params
settings = dict(params.settings)
with step(snakemake.log[0]):
    surfaces = files
    if files.get("frames"):
        regions = read_regions(files.regions)
        surfaces = output
        positions = read_positions(files.frames, params.columns["week"])
        whole, left, right = folded_surfaces(regions, positions)
        write_brain(output, whole, left, right)
        depth = depth_of_weight(regions.fields["cortex_weight"])
        thickness = simulated_thickness(regions.mesh, depth, positions, whole)
        write_vertex_maps(output.thickness, {"thickness_mm": thickness})
    if surfaces.get("thickness"):
        (settings["thickness_mm"],) = read_vertex_maps(surfaces.thickness).values()
    if surfaces.get("report"):
        settings["label_volumes_ml"] = read_json(surfaces.report).get(
            "label_volumes_mL", {}
        )
    left, right = (
        read_surface(surfaces[side]) if surfaces.get(side) else None for side in SIDES
    )
    found = measure_brain(read_surface(surfaces.whole), left, right, **settings)
    maps = found.maps
    if files.get("fine"):
        # tables are of the finer surfaces, maps of those of the mesh, whose vertices
        # are the same in all weeks
        mesh_surface = read_surface(surfaces.whole)
        whole, left, right = map(read_surface, files.fine)
        match = match_surface(whole, mesh_surface)
        settings["thickness_mm"] = values_at(match, settings["thickness_mm"])
        found = measure_brain(whole, left, right, **settings)
    for name, table in (
        ("metrics", found.table),
        ("spectra", found.spectra),
        ("coefficients", found.coefficients),
    ):
        write_table(
            output[name],
            table.assign(**params.columns)[[*params.columns, *table.columns]],
        )
    for side, values in maps.items():
        write_vertex_maps(
            output[f"{side}_maps"],
            values,
            STRUCTURES[side],
        )
