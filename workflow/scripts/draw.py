"""A figure or a table of the registry: its files are read, one function of the report draws them."""

from importlib import import_module
from itertools import pairwise

import numpy as np
import pandas as pd

from gyriflow.geometry.tetrahedra import TetrahedralMesh, boundary_surface
from gyriflow.geometry.triangles import TriangleMesh, transformed
from gyriflow.io.figures import write_figure, write_html
from gyriflow.io.files import read_json, read_table, write_json
from gyriflow.io.frames import read_field, read_positions, read_tets, read_weeks
from gyriflow.io.surfaces import read_surface, read_vertex_labels, read_vertex_maps
from gyriflow.io.tetmeshes import read_regions
from gyriflow.io.yaml_files import read_yaml
from gyriflow.settings.folding import parameters_from
from gyriflow.step import step
from gyriflow.units import SECONDS_PER_GW

READERS = {
    ".csv": read_table,
    ".json": read_json,
    ".yaml": lambda path: parameters_from(read_yaml(path)),
    ".surf.gii": read_surface,
    ".shape.gii": read_vertex_maps,
    ".label.gii": read_vertex_labels,
    "regions.xdmf": read_regions,
}


def read(inputs):
    """Return dictionaries and lists of files as they are with the files' content; other files stay paths."""
    match inputs:
        case str():
            return next((reader(inputs) for end, reader in READERS.items() if inputs.endswith(end)), inputs)
        case dict():
            return {key: read(value) for key, value in inputs.items()}
        case list() | tuple():
            return [read(value) for value in inputs]
        case _:
            return inputs


# what is drawn is worked out from the files by functions that are called as the rules


def start_surface(frames):
    """Return the pial surface of the first frame, and its vertices among those of the mesh."""
    start = TetrahedralMesh(read_positions(frames, read_weeks(frames)[0]), read_tets(frames))
    return boundary_surface(start)


def displacement_maps(frames):
    """Return the displacement of runs between output weeks on the pial surface at the interval's end."""
    maps = {}
    for run, path in frames.items():
        surface, pial = start_surface(path)
        at = {week: read_positions(path, week)[pial] for week in read_weeks(path)}
        maps[run] = {
            (a, b): (TriangleMesh(at[b], surface.faces), np.linalg.norm(at[b] - at[a], axis=1)) for a, b in pairwise(at)
        }
    return {"displacements": maps}


def growth_found_figure(frames, params, **shown):
    """Return growth of area in % per week on the surface at the interval's end, and its directions."""
    surface, pial = start_surface(frames)
    steps_per_week, maps, directions = SECONDS_PER_GW / params.step_s, {}, {}
    for a, b in pairwise(read_weeks(frames)):
        growth = steps_per_week * read_field(frames, b, "tangential_growth_per_step")[pial]
        at = TriangleMesh(read_positions(frames, b)[pial], surface.faces)
        maps[a, b] = at, 100 * np.expm1(2 * growth)
        directions[a, b] = read_field(frames, b, "growth_direction_per_step")[pial]
    return {"maps": {"growth": maps}, "directions": directions, **shown}


def outlines_figure(runs, real, **shown):
    """Return the simulated brains in the pose in which each is nearest to the real one."""
    from gyriflow.geometry.alignment import fit_onto

    aligned = {
        run: {week: transformed(mesh, fit_onto(mesh, real[week])) for week, mesh in brains.items()}
        for run, brains in runs.items()
    }
    return {"runs": aligned, "real": real, **shown}


def zones_figure(mesh, data, params):
    """Return the boundary of the start mesh with its zones."""
    boundary = TriangleMesh(mesh.mesh.vertices, mesh.facets)
    return {"mesh": boundary, "zones": mesh.facet_tags["zone"], "fissure_x_mm": params.fissure_x_mm}


def norms_figure(metrics, reference, **shown):
    """Return the metrics of brains with the hemispheres of the reference."""
    from gyriflow.metrics.norms import same_sides

    return {"metrics": metrics[same_sides(metrics, reference)], "reference": reference, **shown}


params, output = snakemake.params, snakemake.output
with step(snakemake.log[0]):
    name, _, function = params.draw.rpartition(".")
    module = import_module(f"gyriflow.report.{name}")
    content = {**read(dict(params.inputs)), **params.options}
    if snakemake.rule in globals():
        content = globals()[snakemake.rule](**content)
    drawn = getattr(module, function)(**content)
    if isinstance(drawn, pd.DataFrame):
        write_html(output[0], module.html_table(drawn))
    elif isinstance(drawn, dict):
        write_json(output[0], drawn)
    else:
        write_figure(*output, drawn)
