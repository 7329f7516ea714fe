"""Each simulated brain of a run beside the real one of its week, and beside the start brain merely scaled up."""

from gyriflow.growth.curves import tabulated, value
from gyriflow.io.files import write_table
from gyriflow.io.surfaces import read_surface
from gyriflow.io.yaml_files import read_yaml
from gyriflow.metrics.curvature import curvature
from gyriflow.step import step
from gyriflow.units import CM2_PER_MM2, ML_PER_MM3
from gyriflow.validation.shapes import Shape, ready
from gyriflow.validation.tables import Comparison, ordered, validation_row

files, params, names = snakemake.input, snakemake.params, snakemake.wildcards


def shape(mesh, real):
    """Returns a surface ready to be compared with the real brain's, with its curvature."""
    even = ready(mesh, real)
    bend = curvature(even, radius_mm=params.curvature_radius_mm)
    return Shape(even, bend.mean, bend.shape_index)


def followed_at(sizes, week):
    """Returns the size that growth followed at a week."""
    return float(value(tabulated(list(sizes), list(sizes.values()), may_shrink=True), week))


with step(snakemake.log[0]):
    follow, start, rows = read_yaml(files.params).get("follow"), read_surface(files.start), []
    for week, *paths in zip(params.weeks, files.simulated, files.real, files.adjacent, strict=True):
        simulated, real, adjacent = map(read_surface, paths)
        curve = None
        if follow is not None:
            area, volume = (followed_at(follow[name], week) for name in ("area_cm2", "volume_ml"))
            curve = area / CM2_PER_MM2, volume / ML_PER_MM3
        shapes = {name: shape(mesh, real) for name, mesh in (("run", simulated), ("real", real), ("start", start))}
        shapes["adjacent"] = shape(adjacent, real)
        comparison = Comparison(names.run, params.kind, params.start_week, week)
        rows.append(validation_row(comparison, simulated=simulated, real_brain=real, curve=curve, **shapes))
    write_table(snakemake.output[0], ordered(rows))
