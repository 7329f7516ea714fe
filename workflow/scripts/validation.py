"""Validate a run, or the start brain's mesh carried by registration, week by week."""

import numpy as np

from gyriflow.compare.shapes import PreparedSurface
from gyriflow.compare.validation import ObservedWeek, validation_table
from gyriflow.geometry.deformations import transform_points
from gyriflow.geometry.tetrahedra import TetrahedralMesh, boundary_surface
from gyriflow.geometry.triangles import TriangleMesh, transformed
from gyriflow.growth.carrying import carry_mesh
from gyriflow.growth.following import sizes_on_curves
from gyriflow.io.files import read_table, write_table
from gyriflow.io.registrations import WeeklyShapes, read_correspondence, read_weekly_shapes, write_weekly_shapes
from gyriflow.io.surfaces import read_pose, read_surface, read_vertex_maps
from gyriflow.io.tetmeshes import read_tetrahedral_mesh
from gyriflow.io.yaml_files import read_yaml
from gyriflow.step import step

files, params, output = snakemake.input, snakemake.params, snakemake.output


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
    if files.get("correspondences"):
        mesh, pose, sizes = read_tetrahedral_mesh(files.mesh), read_pose(files.report), {}
        # correspondences are in the coordinates of the files, the mesh is posed
        start = TetrahedralMesh(transform_points(mesh.vertices, pose.inverse), mesh.tets)
        positions = carry_mesh(start, [read_correspondence(path) for path in files.correspondences])
        write_weekly_shapes(output.carried, WeeklyShapes(np.array(params.carried_weeks), positions))
        carried, (boundary, used) = read_weekly_shapes(output.carried), boundary_surface(mesh)
        places = [carried.positions[carried.index(week)][used] for week in params.weeks]
        surfaces = [transformed(TriangleMesh(points, boundary.faces), pose.world) for points in places]
    else:
        surfaces, growth = map(read_surface, files.simulated), read_yaml(files.params)["growth"]
        curves = read_table(files.curves) if files.curves else None
        sizes = sizes_on_curves(growth, curves, params.series, params.weeks)
    simulated = dict(zip(params.weeks, surfaces, strict=True))
    labels = {name: params[name] for name in ("run", "kind", "start_week")} | {"start": snakemake.wildcards.brain}
    table = validation_table(labels, simulated, observed, sizes, radius_mm=params.curvature_radius_mm)
    write_table(output.table, table)
