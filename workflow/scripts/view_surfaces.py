"""The surfaces of all weeks, simulated and measured, for the report's 3D view."""

import numpy as np

from gyriflow.geometry.triangles import merged
from gyriflow.io.files import write_json
from gyriflow.io.surfaces import read_surface, read_vertex_maps
from gyriflow.report.view3d import LABELS, TimedSurface, view_data, with_displacement
from gyriflow.step import step

params = snakemake.params


def timed(week, surfaces, maps):
    """Returns the hemispheres of a week, as one surface with the maps that both have."""
    halves = [read_vertex_maps(f"{maps}/{path.rpartition('/')[2].partition('.')[0]}.shape.gii") for path in surfaces]
    shared = [name for name in LABELS if all(name in half for half in halves)]
    values = {name: np.concatenate([half[name] for half in halves]) for name in shared}
    whole = read_surface(surfaces[0]) if len(surfaces) == 1 else merged(*map(read_surface, surfaces))
    return TimedSurface(week, whole, values)


with step(snakemake.log[0]):
    runs = {name: with_displacement([timed(*frame) for frame in frames]) for name, frames in params.runs.items()}
    real = [timed(*frame) for frame in params.real]
    write_json(snakemake.output[0], view_data(runs, real, measured=params.measured))
