"""Validation of a run, or of the start brain's mesh carried by registration, week by week."""

from gyriflow.compare.shapes import PreparedSurface
from gyriflow.compare.validation import ObservedWeek, validation_table
from gyriflow.geometry.tetrahedra import boundary_surface
from gyriflow.geometry.triangles import TriangleMesh, transformed
from gyriflow.growth.following import sizes_on_curves
from gyriflow.io.files import read_table, write_table
from gyriflow.io.registrations import read_weekly_shapes
from gyriflow.io.surfaces import read_pose, read_surface, read_vertex_maps
from gyriflow.io.tetmeshes import read_tetrahedral_mesh
from gyriflow.io.yaml_files import read_yaml
from gyriflow.step import step

files, params = snakemake.input, snakemake.params


def prepared(name, number):
    """Read a surface that was prepared for comparison in a week."""
    return PreparedSurface(read_surface(files[name][number]), **read_vertex_maps(files[f"{name}_maps"][number]))


with step(snakemake.log[0]):
    observed = {
        week: ObservedWeek(
            params.real[number],
            read_surface(files.whole[number]),
            *(prepared(name, number) for name in ("real", "start", "adjacent")),
        )
        for number, week in enumerate(params.weeks)
    }
    if files.get("carried"):
        boundary, used = boundary_surface(read_tetrahedral_mesh(files.mesh))
        pose, carried, sizes = read_pose(files.report), read_weekly_shapes(files.carried), {}
        places = [carried.positions[carried.index(week)][used] for week in params.weeks]
        surfaces = [transformed(TriangleMesh(points, boundary.faces), pose.world) for points in places]
    else:
        surfaces, growth = map(read_surface, files.simulated), read_yaml(files.params)["growth"]
        curves = read_table(files.curves) if files.curves else None
        sizes = sizes_on_curves(growth, curves, params.series, params.weeks)
    simulated = dict(zip(params.weeks, surfaces, strict=True))
    labels = {name: params[name] for name in ("run", "kind", "start_week")} | {"start": snakemake.wildcards.brain}
    table = validation_table(labels, simulated, observed, sizes, radius_mm=params.curvature_radius_mm)
    write_table(snakemake.output[0], table)
