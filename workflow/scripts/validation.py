"""Each simulated brain of a run beside the real one of its week, and beside the start brain merely scaled up."""

from gyriflow.growth.curves import value
from gyriflow.growth.following import curves_of_run
from gyriflow.io.files import read_table, write_table
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


with step(snakemake.log[0]):
    start, rows, follow = read_surface(files.start), [], read_yaml(files.params).get("follow")
    curves = curves_of_run(follow, read_table(files.curves) if files.curves else None, params.series)
    for week, *paths in zip(params.weeks, files.simulated, files.real, files.adjacent, strict=True):
        simulated, real, adjacent = map(read_surface, paths)
        aim = [float(value(curve, week)) for curve in curves]
        aim = (aim[0] / CM2_PER_MM2, aim[1] / ML_PER_MM3) if aim else None
        shapes = {name: shape(mesh, real) for name, mesh in (("run", simulated), ("real", real), ("start", start))}
        shapes["adjacent"] = shape(adjacent, real)
        comparison = Comparison(names.run, params.kind, params.start_week, week)
        rows.append(validation_row(comparison, simulated=simulated, real_brain=real, curve=aim, **shapes))
    write_table(snakemake.output[0], ordered(rows))
