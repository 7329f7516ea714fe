"""Validate registration alone: carry the start brain's mesh along it, and compare it week by week as a run is."""

import numpy as np

from gyriflow.compare.comparison import ObservedBrain, comparison_table
from gyriflow.compare.shapes import PreparedSurface
from gyriflow.geometry.tetrahedra import boundary_surface
from gyriflow.geometry.triangles import TriangleMesh, transformed
from gyriflow.growth.carrying import carry_mesh
from gyriflow.io.files import write_table
from gyriflow.io.registrations import WeeklyShapes, read_correspondence, read_weekly_shapes, write_weekly_shapes
from gyriflow.io.surfaces import read_pose, read_surface, read_vertex_maps
from gyriflow.io.tetmeshes import read_tetrahedral_mesh
from gyriflow.step import step

files, params, output = snakemake.input, snakemake.params, snakemake.output


def prepared(name, number):
    """Read a surface that was prepared for comparison in a week."""
    return PreparedSurface(read_surface(files[name][number]), **read_vertex_maps(files[f"{name}_maps"][number]))


with step(snakemake.log[0]):
    mesh, pose = read_tetrahedral_mesh(files.mesh), read_pose(files.report)
    positions = carry_mesh(mesh, [read_correspondence(path) for path in files.correspondences], pose)
    write_weekly_shapes(output.carried, WeeklyShapes(np.array(params.carried_weeks), positions))
    carried, (boundary, used) = read_weekly_shapes(output.carried), boundary_surface(mesh)
    surfaces, observed = {}, {}
    for number, week in enumerate(params.weeks):
        points = carried.positions[carried.index(week)][used]
        surfaces[week] = {"run": transformed(TriangleMesh(points, boundary.faces), pose.world)}
        baselines = {name: prepared(name, number) for name in ("start", "adjacent")}
        surface = read_surface(files.whole[number])
        observed[week] = ObservedBrain(params.observed[number], surface, prepared("observed", number), baselines)
    labels = {name: params[name] for name in ("run", "kind", "start_week")} | {"start": snakemake.wildcards.brain}
    write_table(output.table, comparison_table(labels, surfaces, observed, radius_mm=params.curvature_radius_mm))
