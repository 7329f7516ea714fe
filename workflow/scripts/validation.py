"""Each simulated brain of a run, or the start carried by registration, beside the real one and the start scaled up."""

import numpy as np

from gyriflow.compare.shapes import PreparedSurface, prepare_for_comparison
from gyriflow.compare.validation import ordered, validation_row
from gyriflow.geometry.deformations import transform_points
from gyriflow.geometry.tetrahedra import boundary_surface
from gyriflow.geometry.triangles import TriangleMesh
from gyriflow.growth.curves import value
from gyriflow.growth.following import curves_of_run
from gyriflow.io.files import read_table, write_table
from gyriflow.io.registrations import read_weekly_shapes
from gyriflow.io.surfaces import read_pose, read_surface, read_vertex_maps
from gyriflow.io.tetmeshes import read_tetrahedral_mesh
from gyriflow.io.yaml_files import read_yaml
from gyriflow.step import step

files, params = snakemake.input, snakemake.params
with step(snakemake.log[0]):
    rows, curves = [], []
    if files.get("carried"):
        surface, pial = boundary_surface(read_tetrahedral_mesh(files.mesh))
        pose, carried = read_pose(files.report), read_weekly_shapes(files.carried)
        at = [carried.positions[np.flatnonzero(carried.weeks == week)[0]][pial] for week in params.weeks]
        surfaces = [TriangleMesh(transform_points(places, pose.world), surface.faces) for places in at]
    else:
        surfaces, growth = map(read_surface, files.simulated), read_yaml(files.params)["growth"]
        curves = curves_of_run(growth, read_table(files.curves) if files.curves else None, params.series)
    for number, (week, simulated) in enumerate(zip(params.weeks, surfaces, strict=True)):
        aims = {name: float(value(curve, week)) for name, curve in zip(("area_cm2", "volume_ml"), curves, strict=False)}
        real = read_surface(files.whole[number])
        shapes = {"run": prepare_for_comparison(simulated, real, params.curvature_radius_mm)}
        for name in ("real", "start", "adjacent"):
            maps = read_vertex_maps(files[f"{name}_maps"][number])
            shapes[name] = PreparedSurface(read_surface(files[name][number]), **maps)
        labels = {"run": params.run, "kind": params.kind, "start_week": params.start_week, "week": week}
        labels |= {"start": snakemake.wildcards.brain, "real": params.real[number]}
        rows.append(validation_row(labels, simulated=simulated, real_brain=real, aims=aims, **shapes))
    write_table(snakemake.output[0], ordered(rows))
