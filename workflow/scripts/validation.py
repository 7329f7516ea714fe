"""Each simulated brain of a run beside the real one of its week, and beside the start brain merely scaled up."""

from gyriflow.compare.shapes import Shape, ready
from gyriflow.compare.validation import Comparison, ordered, validation_row
from gyriflow.growth.curves import value
from gyriflow.growth.following import curves_of_run
from gyriflow.io.files import read_table, write_table
from gyriflow.io.surfaces import read_surface, read_vertex_maps
from gyriflow.io.yaml_files import read_yaml
from gyriflow.metrics.curvature import curvature
from gyriflow.step import step
from gyriflow.units import CM2_PER_MM2, ML_PER_MM3

files, params, names = snakemake.input, snakemake.params, snakemake.wildcards
with step(snakemake.log[0]):
    rows, growth = [], read_yaml(files.params)["growth"]
    curves = curves_of_run(growth, read_table(files.curves) if files.curves else None, params.series)
    for number, week in enumerate(params.weeks):
        simulated, real = read_surface(files.simulated[number]), read_surface(files.whole[number])
        aim = [float(value(curve, week)) for curve in curves]
        aim = (aim[0] / CM2_PER_MM2, aim[1] / ML_PER_MM3) if aim else None
        even = ready(simulated, real)
        bend = curvature(even, radius_mm=params.curvature_radius_mm)
        shapes = {"run": Shape(even, bend.mean, bend.shape_index)}
        for name in ("real", "start", "adjacent"):
            maps = read_vertex_maps(files[f"{name}_maps"][number])
            shapes[name] = Shape(read_surface(files[name][number]), **maps)
        comparison = Comparison(names.run, params.kind, params.start_week, week)
        rows.append(validation_row(comparison, simulated=simulated, real_brain=real, curve=aim, **shapes))
    write_table(snakemake.output[0], ordered(rows))
