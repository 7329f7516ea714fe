"""Validate a run: compare its simulated brains with the observed ones, week by week."""

from gyriflow.compare.comparison import ObservedBrain, add_curves, comparison_table
from gyriflow.compare.shapes import PreparedSurface
from gyriflow.growth.curves import sizes_on_curves
from gyriflow.io.files import read_table, write_table
from gyriflow.io.surfaces import read_surface, read_vertex_maps
from gyriflow.io.yaml_files import read_yaml
from gyriflow.step import step

files, params = snakemake.input, snakemake.params


def prepared(name, number):
    """Read a surface that was prepared for comparison in a week."""
    return PreparedSurface(read_surface(files[name][number]), **read_vertex_maps(files[f"{name}_maps"][number]))


with step(snakemake.log[0]):
    simulated, observed = {}, {}
    for number, week in enumerate(params.weeks):
        simulated[week] = {"run": read_surface(files.simulated[number])}
        baselines = {name: prepared(name, number) for name in ("start", "adjacent")}
        surface = read_surface(files.whole[number])
        observed[week] = ObservedBrain(params.observed[number], surface, prepared("observed", number), baselines)
    growth, curves = read_yaml(files.params)["growth"], read_table(files.curves) if files.curves else None
    sizes = sizes_on_curves(growth, curves, params.series, params.weeks)
    labels = {name: params[name] for name in ("run", "kind", "start_week")} | {"start": snakemake.wildcards.brain}
    table = comparison_table(labels, simulated, observed, radius_mm=params.curvature_radius_mm)
    write_table(snakemake.output.table, add_curves(table, sizes))
