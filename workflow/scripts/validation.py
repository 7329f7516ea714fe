"""Each simulated brain of a run beside the real one of its week, and beside the start brain merely scaled up."""

from gyriflow.growth.curves import tabulated, value
from gyriflow.growth.following import QUANTITIES
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


def aims(follow):
    """Returns by quantity the sizes that growth followed, or those of the curves through the measured brains."""
    if follow is not None:
        return {name: follow[name] for name in QUANTITIES}
    if not files.curves:
        return {}
    table = read_table(files.curves)
    rows = table[table["series"] == params.series]
    return {name: dict(part[["week", "value"]].to_numpy()) for name, part in rows.groupby("quantity")}


with step(snakemake.log[0]):
    start, rows, sizes = read_surface(files.start), [], aims(read_yaml(files.params).get("follow"))
    curves = [tabulated(list(sizes[name]), list(sizes[name].values()), may_shrink=True) for name in sizes]
    for week, *paths in zip(params.weeks, files.simulated, files.real, files.adjacent, strict=True):
        simulated, real, adjacent = map(read_surface, paths)
        aim = [float(value(curve, week)) for curve in curves]
        aim = (aim[0] / CM2_PER_MM2, aim[1] / ML_PER_MM3) if aim else None
        shapes = {name: shape(mesh, real) for name, mesh in (("run", simulated), ("real", real), ("start", start))}
        shapes["adjacent"] = shape(adjacent, real)
        comparison = Comparison(names.run, params.kind, params.start_week, week)
        rows.append(validation_row(comparison, simulated=simulated, real_brain=real, curve=aim, **shapes))
    write_table(snakemake.output[0], ordered(rows))
