"""Compare a run that predicts a brain, and simple baselines, with the observed brains."""

from gyriflow.compare.prediction import prediction_table, simple_predictions
from gyriflow.compare.shapes import PreparedSurface
from gyriflow.geometry.tetrahedra import boundary_surface
from gyriflow.geometry.triangles import TriangleMesh
from gyriflow.io.files import write_table
from gyriflow.io.registrations import read_weekly_shapes
from gyriflow.io.surfaces import read_surface, read_vertex_maps
from gyriflow.io.tetmeshes import read_tetrahedral_mesh
from gyriflow.step import step

files, params, names = snakemake.input, snakemake.params, snakemake.wildcards
observed, prepared, models = {}, {}, {}
with step(snakemake.log[0]):
    targets = read_weekly_shapes(files.targets)
    start, used = boundary_surface(read_tetrahedral_mesh(files.mesh))
    atlas = dict(zip(params.atlas_weeks, map(read_surface, files.atlas), strict=True))
    for number, week in enumerate(params.weeks):
        observed[week] = read_surface(files.whole[number])
        prepared[week] = PreparedSurface(read_surface(files.real[number]), **read_vertex_maps(files.real_maps[number]))
        models[week] = {"run": read_surface(files.simulated[number])}
        # baselines are the same for all runs from this brain; they are written with the run that grows as the atlas
        if params.of_atlas:
            at = targets.index(week)
            target = TriangleMesh(targets.positions[at][used], start.faces)
            registered = {name: TriangleMesh(points[at], start.faces) for name, points in targets.surfaces.items()}
            models[week] |= simple_predictions(start, target, registered, atlas.get(week))
    labels = {"run": names.run, "start": names.brain, "start_week": params.start_week}
    table = prediction_table(labels, models, observed, prepared, radius_mm=params.curvature_radius_mm)
    write_table(snakemake.output[0], table)
