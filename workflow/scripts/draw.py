"""A figure or a table of the registry: its files are read, one function of the report draws them."""

from importlib import import_module
from itertools import pairwise

import numpy as np

from gyriflow.geometry.poses import pose_from
from gyriflow.geometry.tetrahedra import TetrahedralMesh, boundary_surface
from gyriflow.geometry.triangles import TriangleMesh, transformed
from gyriflow.io.figures import write_figure, write_html
from gyriflow.io.files import read_json, read_table, write_json
from gyriflow.io.frames import read_field, read_positions, read_tets, read_weeks
from gyriflow.io.maps import read_maps, read_volume_map
from gyriflow.io.surfaces import read_surface, read_vertex_labels, read_vertex_maps
from gyriflow.io.tetmeshes import read_regions
from gyriflow.io.yaml_files import read_yaml
from gyriflow.parameters.folding import parameters_from
from gyriflow.step import step
from gyriflow.units import SECONDS_PER_GW

# what functions need besides, each imports itself: its figure alone depends on it
READERS = {
    ".csv": read_table,
    ".json": read_json,
    ".yaml": lambda path: parameters_from(read_yaml(path)),
    ".surf.gii": read_surface,
    ".shape.gii": read_vertex_maps,
    ".label.gii": read_vertex_labels,
    "regions.xdmf": read_regions,
    "maps.h5": read_maps,
}


def read(inputs):
    """Returns dictionaries and lists of files as they are with the files' content; other files stay paths."""
    match inputs:
        case str():
            return next((reader(inputs) for end, reader in READERS.items() if inputs.endswith(end)), inputs)
        case dict():
            return {key: read(value) for key, value in inputs.items()}
        case list() | tuple():
            return [read(value) for value in inputs]
        case _:
            return inputs


def surface_overlay(image, surface, report, affine_from, **_):
    """Returns the image in the pose of the surface, which was turned upright."""
    volume = read_volume_map(image, affine_from)
    return {"values": volume.values, "affine": pose_from(report["pose"]).world @ volume.affine, "surface": surface}


def displacement_maps(frames, **shown):
    """Returns the displacement of runs between output weeks on the pial surface at the interval's end."""
    maps = {}
    for run, path in frames.items():
        weeks = read_weeks(path)
        surface, pial = boundary_surface(TetrahedralMesh(read_positions(path, weeks[0]), read_tets(path)))
        at = {week: read_positions(path, week)[pial] for week in weeks}
        maps[run] = {
            (a, b): (TriangleMesh(at[b], surface.faces), np.linalg.norm(at[b] - at[a], axis=1))
            for a, b in pairwise(weeks)
        }
    return {"displacements": maps, **shown}


def scalar_maps(frames, quantity, params=None, **shown):
    """Returns contact pressure on the surface of the start, where no fold hides it, or growth on that of the week."""
    start, *weeks = read_weeks(frames)
    surface, pial = boundary_surface(TetrahedralMesh(read_positions(frames, start), read_tets(frames)))
    if params is not None:
        steps, maps, directions = SECONDS_PER_GW / params.step_s, {}, {}
        for a, b in pairwise((start, *weeks)):
            growth = steps * read_field(frames, b, "tangential_growth_per_step")[pial]
            maps[a, b] = TriangleMesh(read_positions(frames, b)[pial], surface.faces), 100 * np.expm1(2 * growth)
            directions[a, b] = read_field(frames, b, "growth_direction_per_step")[pial]
        return {"maps": {"growth": maps}, "directions": directions, "quantity": quantity, **shown}
    maps = {week: (surface, read_field(frames, week, quantity)[pial]) for week in weeks}
    return {"maps": {"simulated": maps}, "quantity": quantity, **shown}


def outlines_chart(runs, real, **shown):
    """Returns the simulated brains in the pose in which each is nearest to the real one."""
    from gyriflow.geometry.alignment import fit_onto

    laid = {
        run: {week: transformed(mesh, fit_onto(mesh, real[week])) for week, mesh in known.items()}
        for run, known in runs.items()
    }
    return {"runs": laid, "real": real, **shown}


def zones_picture(mesh, params, synthetic, **_):
    """Returns the boundary of the start mesh with its zones."""
    boundary = TriangleMesh(mesh.mesh.vertices, mesh.facets)
    shown = {"fissure_x_mm": params.fissure_x_mm, "synthetic": synthetic}
    return {"mesh": boundary, "zones": mesh.facet_tags["zone"], **shown}


def norms_chart(metrics, reference, **shown):
    """Returns the metrics of brains with the hemispheres of the reference."""
    from gyriflow.metrics.norms import same_sides

    return {"metrics": metrics[same_sides(metrics, reference)], "reference": reference, **shown}


params, output = snakemake.params, snakemake.output
with step(snakemake.log[0]):
    module, _, function = params.draw.rpartition(".")
    content = {**read(params.inputs), **params.options}
    # a function here of the same name works out what is drawn from the files
    if function in globals():
        content = globals()[function](**content)
    shown = getattr(import_module(f"gyriflow.report.{module}"), function)(**content)
    if isinstance(shown, str):
        write_html(output[0], shown)
    elif isinstance(shown, dict):
        write_json(output[0], shown)
    else:
        write_figure(*output, shown, dpi=params.dpi)
