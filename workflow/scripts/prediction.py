"""Compare a run that predicts a brain, and simple baselines, with the observed brains."""

from gyriflow.compare.comparison import ObservedBrain, comparison_table, simple_predictions
from gyriflow.compare.shapes import PreparedSurface
from gyriflow.geometry.tetrahedra import boundary_surface
from gyriflow.geometry.triangles import TriangleMesh
from gyriflow.io.files import write_table
from gyriflow.io.registrations import read_weekly_shapes
from gyriflow.io.surfaces import read_surface, read_vertex_maps
from gyriflow.io.tetmeshes import read_tetrahedral_mesh
from gyriflow.step import step

files, params, names = snakemake.input, snakemake.params, snakemake.wildcards
observed, models = {}, {}


def prepared(name, number):
    """Read a surface that was prepared for comparison in a week."""
    return PreparedSurface(read_surface(files[name][number]), **read_vertex_maps(files[f"{name}_maps"][number]))


with step(snakemake.log[0]):
    targets = read_weekly_shapes(files.targets)
    start, used = boundary_surface(read_tetrahedral_mesh(files.mesh))
    atlas = dict(zip(params.atlas_weeks, map(read_surface, files.atlas), strict=True))
    for number, week in enumerate(params.weeks):
        baselines = {name: prepared(name, number) for name in ("start", "adjacent")}
        surface = read_surface(files.whole[number])
        observed[week] = ObservedBrain(params.observed[number], surface, prepared("observed", number), baselines)
        models[week] = {"run": read_surface(files.simulated[number])}
        # baselines are the same for all runs from this brain; they are written with the run that grows as the atlas
        if params.of_atlas:
            at = targets.index(week)
            target = TriangleMesh(targets.positions[at][used], start.faces)
            registered = {name: TriangleMesh(points[at], start.faces) for name, points in targets.surfaces.items()}
            models[week] |= simple_predictions(start, target, registered, atlas.get(week))
    labels = {"run": names.run, "kind": params.kind, "start": names.brain, "start_week": params.start_week}
    write_table(snakemake.output[0], comparison_table(labels, models, observed, radius_mm=params.curvature_radius_mm))
