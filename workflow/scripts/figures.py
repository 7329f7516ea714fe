"""Draw the figures and tables of a rule: read its inputs and call, for each of its
outputs, the function of that name in the report."""

from importlib import import_module
from inspect import signature

from matplotlib.figure import Figure

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

files, output, params = snakemake.input, snakemake.output, snakemake.params


def _read_parameters(path):
    """Return the parameters of a run."""
    return parameters_from(read_yaml(path))


def _read_boundary(path):
    """Return the boundary of a run's start mesh, and the tags of its faces by name."""
    regions = read_regions(path)
    return TriangleMesh(regions.mesh.vertices, regions.facets), regions.facet_tags


def _read_elements(frames):
    """Return the elements of a run, and the fields of the model at its first and last
    week."""
    # only here, as importing them takes half a second of each figure
    from gyriflow.folding.growth import GrowthInputs, StepStart, model_fields
    from gyriflow.folding.growth_models import growth_model
    from gyriflow.folding.zones import zones_of_run

    parameters = _read_parameters(files.parameters)
    weeks = read_weeks(frames)
    mesh = TetrahedralMesh(
        read_positions(frames, weeks[0]),
        read_tets(frames),
    )
    zones = zones_of_run(mesh, parameters)
    model = growth_model(parameters, GrowthInputs(mesh, zones, {}))
    growth = model(StepStart(mesh.vertices, 0.0, parameters.step_s))
    fields = {}
    for week in (weeks[0], weeks[-1]):
        positions_mm = read_positions(frames, week)
        fields[week] = model_fields(growth, zones, positions_mm, week)
    return mesh.tets, fields


def _read_ages(path):
    """Return the ages by size of an atlas' brains."""
    return read_weekly_shapes(path).ages


READERS = {
    "ages": _read_ages,
    "boundary": _read_boundary,
    "elements": _read_elements,
    "frames": read_pial_frames,
    "growth": read_vertex_maps,
    "parameters": _read_parameters,
    "published": read_yaml,
    "quality": read_json,
}
"""Functions that read inputs by name; others are tables."""


def _read(name, paths):
    """Return the content of an input, a list if it has several files."""
    reader = READERS.get(name, read_table)
    if isinstance(paths, str):
        return reader(paths)
    return [reader(path) for path in paths]


def _read_brain(placed):
    """Return a brain of a grid with its surfaces, and their maps or regions.

    `placed` are its files and its place in the grid; it may have no maps.
    """
    # only here, as charts need no VTK, which takes a second to import
    from gyriflow.report.pictures import GridBrain

    contents = [{} for _ in placed["surfaces"]]
    for number, path in enumerate(placed["maps"]):
        is_regions = path.endswith(".label.gii")
        read = read_vertex_labels if is_regions else read_vertex_maps
        contents[number] = read(path)
    surfaces = [read_surface(path) for path in placed["surfaces"]]
    halves = list(zip(surfaces, contents, strict=True))
    return GridBrain(
        placed["row"],
        placed["column"],
        halves,
        placed["simulated"],
    )


with step(snakemake.log[0]):
    functions = {}
    for name in params.modules:
        functions |= vars(import_module(f"gyriflow.report.{name}"))
    found = dict(params.items())
    for name, paths in files.items():
        if name == "grid":
            found[name] = [_read_brain(placed) for placed in params.grid]
        else:
            found[name] = _read(name, paths)
    for name, written in output.items():
        arguments = signature(functions[name]).parameters
        given = {key: value for key, value in found.items() if key in arguments}
        drawn = functions[name](**given)
        if isinstance(drawn, Figure):
            write_figure(*written, drawn)
        else:
            # only here, as pictures need no tables, which take half a second to import
            from gyriflow.report.tables import html_table

            write_html(written, html_table(drawn))
