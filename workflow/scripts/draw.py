"""Draw figures and tables of `workflow/figures.yaml`: read their input files and call
their functions."""

from importlib import import_module
from pathlib import Path

import pandas as pd

from gyriflow.folding.zones import model_fields, zones_of_run
from gyriflow.geometry.tetrahedra import TetrahedralMesh
from gyriflow.geometry.triangles import TriangleMesh
from gyriflow.io.figures import write_figure, write_html
from gyriflow.io.files import read_json, read_table
from gyriflow.io.frames import read_pial_frames, read_positions, read_tets, read_weeks
from gyriflow.io.registrations import read_weekly_shapes
from gyriflow.io.surfaces import read_surface, read_vertex_labels, read_vertex_maps
from gyriflow.io.tetmeshes import read_regions
from gyriflow.io.yaml_files import read_yaml
from gyriflow.settings.folding import parameters_from
from gyriflow.step import step


def read_boundary(path):
    """Return the boundary of a run's start mesh, and the tags of its faces by name."""
    regions = read_regions(path)
    return TriangleMesh(regions.mesh.vertices, regions.facets), regions.facet_tags


def read_elements(path):
    """Return the elements of a run, and the fields of the model at its first and last
    week."""
    frames, run = path.replace(".xdmf", ".h5"), Path(path).parents[1]
    params, weeks = parameters_from(read_yaml(run / "params.yaml")), read_weeks(frames)
    mesh = TetrahedralMesh(read_positions(frames, weeks[0]), read_tets(frames))
    zones = zones_of_run(mesh, params)
    ends = (weeks[0], weeks[-1])
    return mesh.tets, {
        week: model_fields(zones, read_positions(frames, week), params, week)
        for week in ends
    }


READERS = {
    ".csv": read_table,
    ".json": read_json,
    "params.yaml": lambda path: parameters_from(read_yaml(path)),
    ".yaml": read_yaml,
    ".surf.gii": read_surface,
    ".shape.gii": read_vertex_maps,
    ".label.gii": read_vertex_labels,
    "frames.h5": read_pial_frames,
    "frames.xdmf": read_elements,
    "regions.h5": read_boundary,
    "targets.atlas.h5": lambda path: read_weekly_shapes(path).ages,
}
"""Functions that read files, by the end of the file name."""


def read(inputs):
    """Return nested dictionaries and lists with each path replaced by the content of
    its file."""
    match inputs:
        case str():
            return next(
                reader for end, reader in READERS.items() if inputs.endswith(end)
            )(inputs)
        case dict():
            return {key: read(value) for key, value in inputs.items()}
        case list():
            return [read(value) for value in inputs]
    return inputs


with step(snakemake.log[0]):
    for figure in snakemake.params.figures:
        name, _, function = figure["draw"].partition(".")
        module = import_module(f"gyriflow.report.{name}")
        drawn = getattr(module, function)(
            **read(dict(figure["inputs"])), **figure["options"]
        )
        if isinstance(drawn, pd.DataFrame):
            write_html(*figure["files"], module.html_table(drawn))
        else:
            write_figure(*figure["files"], drawn)
