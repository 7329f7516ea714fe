"""Compare a run with the observed brains week by week."""

from gyriflow.compare.comparison import (
    ObservedBrain,
    add_curves,
    comparison_table,
    simple_predictions,
)
from gyriflow.compare.shapes import PreparedSurface
from gyriflow.geometry.tetrahedra import boundary_surface
from gyriflow.geometry.triangles import TriangleMesh
from gyriflow.growth.curves import sizes_on_curves
from gyriflow.io.files import read_table, write_table
from gyriflow.io.registrations import read_weekly_shapes
from gyriflow.io.surfaces import read_surface, read_vertex_maps
from gyriflow.io.tetmeshes import read_tetrahedral_mesh
from gyriflow.io.yaml_files import read_yaml
from gyriflow.step import step

files, params, output = snakemake.input, snakemake.params, snakemake.output


def _observed_brain(number):
    """Read the observed brain of a week as it was prepared for comparison."""
    maps = {
        name: read_vertex_maps(files[f"{name}_maps"][number])
        for name in ("observed", "start", "adjacent")
    }
    mesh = read_surface(files.observed[number])
    return ObservedBrain(
        params.observed[number],
        read_surface(files.whole[number]),
        PreparedSurface(mesh, **maps.pop("observed")),
        baselines=maps,
    )


def _simple_models():
    """Yield for each week the predictions without mechanics, the same for all runs from
    a start brain."""
    targets = read_weekly_shapes(files.targets)
    start, used = boundary_surface(read_tetrahedral_mesh(files.mesh))
    atlas = dict(
        zip(
            params.atlas_weeks,
            map(read_surface, files.atlas),
            strict=True,
        )
    )
    for week in params.weeks:
        at = targets.index(week)
        target = TriangleMesh(targets.positions[at][used], start.faces)
        registered = {
            name: TriangleMesh(points[at], start.faces)
            for name, points in targets.surfaces.items()
        }
        yield simple_predictions(start, target, registered, atlas.get(week))


with step(snakemake.log[0]):
    models = {
        week: {"run": read_surface(path)}
        for week, path in zip(
            params.weeks,
            files.simulated,
            strict=True,
        )
    }
    # these are written with the run that grows as the atlas
    if params.get("of_atlas"):
        models = {
            week: models[week] | simple
            for week, simple in zip(models, _simple_models(), strict=True)
        }
    observed = {
        week: _observed_brain(number) for number, week in enumerate(params.weeks)
    }
    labels = {name: params[name] for name in ("run", "kind", "start_week")} | {
        "start": snakemake.wildcards.brain
    }
    table = comparison_table(
        labels, models, observed, radius_mm=params.curvature_radius_mm
    )
    if files.get("params"):
        growth = read_yaml(files.params)["growth"]
        curves = read_table(files.curves) if files.curves else None
        table = add_curves(
            table, sizes_on_curves(growth, curves, params.series, params.weeks)
        )
    write_table(output.table, table)
