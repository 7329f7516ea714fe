"""The runs of a study at the week of comparison: surfaces and maps of the shape index, beside the real brain."""

from itertools import batched

import numpy as np

from gyriflow.geometry.triangles import merged
from gyriflow.io.figures import write_figure
from gyriflow.io.surfaces import read_surface, read_vertex_maps
from gyriflow.report.influence import influence_picture, value_labels
from gyriflow.step import step

files, params = snakemake.input, snakemake.params


def brain(surfaces, maps):
    """Returns the hemispheres as one surface with its values."""
    values = np.concatenate([read_vertex_maps(path)["shape_index"] for path in maps])
    halves = [read_surface(path) for path in surfaces]
    return (halves[0] if len(halves) == 1 else merged(*halves)), values


with step(snakemake.log[0]):
    labels = dict(zip(params.runs, value_labels(params.members), strict=True))
    pairs = zip(batched(files.surfaces, params.sides), batched(files.maps, params.sides), strict=True)
    known = [brain(*pair) for pair in pairs]
    reached = dict(zip(params.reached, known, strict=False))
    figure = influence_picture(
        {label: reached.get(run) for run, label in labels.items()},
        known[len(params.reached)] if len(known) > len(params.reached) else None,
        measured=params.measured,
        synthetic=params.synthetic,
    )
    write_figure(snakemake.output.png, snakemake.output.pdf, figure, dpi=params.dpi)
