"""How the real brain of a week deviates from what a run expects: maps on the expected surface, and a table."""

import numpy as np
import pandas as pd
from scipy.spatial import KDTree

from gyriflow.compare.prediction import deviation_maps
from gyriflow.geometry.alignment import fit_onto
from gyriflow.geometry.matching import match_points, values_at
from gyriflow.geometry.triangles import TriangleMesh, transformed, vertex_normals
from gyriflow.growth.expected import fit_onto_surface
from gyriflow.io.files import write_table
from gyriflow.io.surfaces import read_surface, read_vertex_labels, read_vertex_maps, write_vertex_maps
from gyriflow.metrics.regions import region_metrics
from gyriflow.step import step


def at(mesh, surface, values):
    """Return the values at the vertices of a surface at those of a mesh beside it."""
    return values_at(match_points(mesh.vertices, vertex_normals(mesh), surface), values)


files, params = snakemake.input, snakemake.params
with step(snakemake.log[0]):
    start, first, surface, real = map(read_surface, (files.start, files.first, files.expected, files.real))
    expected = transformed(surface, fit_onto(surface, real))
    fitted = TriangleMesh(fit_onto_surface(expected, real), expected.faces)
    maps = deviation_maps(expected, fitted)
    if files.thickness:
        at_start, run_at_start, run, found = (read_vertex_maps(path)["thickness_mm"] for path in files.thickness)
        # that of the start brain grows as the run has it grow
        grown = at(first, start, at_start) * run / run_at_start
        maps["thickness_difference_mm"] = at(fitted, real, found) - grown
    write_vertex_maps(snakemake.output.maps, maps)
    parts = {"whole": surface, **dict(zip(params.sides, map(read_surface, files.sides), strict=True))}
    places = {part: KDTree(surface.vertices).query(mesh.vertices)[1] for part, mesh in parts.items()}
    own = {part: {name: values[place] for name, values in maps.items()} for part, place in places.items()}
    tables = [region_metrics(parts, own, {part: np.ones(len(place)) for part, place in places.items()}, {1: ""})]
    for side, path in zip(params.sides, files.regions, strict=False):
        labels, names = read_vertex_labels(path)
        tables.append(region_metrics({side: parts[side]}, own, {side: labels}, names))
    table = pd.concat(tables, ignore_index=True)
    means = table["metric"].str.startswith("mean_")
    table = table[means].assign(metric=table["metric"].str.removeprefix("mean_"), **params.labels)
    write_table(snakemake.output.table, table[[*params.labels, "hemisphere", "region", "metric", "value", "unit"]])
