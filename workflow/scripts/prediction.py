"""A run that predicts a brain and the simplest ways to do so, beside the real brains of the weeks."""

import numpy as np
import pandas as pd

from gyriflow.compare.placement import make_patches
from gyriflow.compare.prediction import endpoints, with_skill
from gyriflow.compare.shapes import PreparedSurface, prepare_for_comparison, scale_to_volume
from gyriflow.geometry.tetrahedra import boundary_surface
from gyriflow.geometry.triangles import TriangleMesh, signed_volume
from gyriflow.io.files import write_table
from gyriflow.io.registrations import read_weekly_shapes
from gyriflow.io.surfaces import read_surface, read_vertex_maps
from gyriflow.io.tetmeshes import read_tetrahedral_mesh
from gyriflow.step import step

files, params, names = snakemake.input, snakemake.params, snakemake.wildcards
with step(snakemake.log[0]):
    targets, rows = read_weekly_shapes(files.targets), []
    start, used = boundary_surface(read_tetrahedral_mesh(files.mesh))
    brains_of_atlas = dict(zip(params.atlas_weeks, files.atlas, strict=True))
    for number, week in enumerate(params.weeks):
        real = read_surface(files.whole[number])
        real_shape = PreparedSurface(read_surface(files.real[number]), **read_vertex_maps(files.real_maps[number]))
        patch, _ = make_patches(real_shape, mirrored=True)
        at = int(np.argmin(np.abs(targets.weeks - week)))
        target = TriangleMesh(targets.positions[at][used], start.faces)
        volume = signed_volume(target)
        # written with the run that grows as the atlas, for those beside it too
        simple = {"scaled": scale_to_volume(start, volume)}
        simple |= {name: TriangleMesh(places[at], start.faces) for name, places in targets.surfaces.items()}
        atlas = read_surface(brains_of_atlas[week]) if week in brains_of_atlas else simple["atlas"]
        simple |= {"atlas": scale_to_volume(atlas, volume), "target": target}
        models = {"run": read_surface(files.simulated[number])} | (simple if params.of_atlas else {})
        for model, surface in models.items():
            shape = prepare_for_comparison(surface, real, params.curvature_radius_mm)
            found = endpoints(surface, real, shape, real_shape, patch)
            row = {"run": names.run, "start": names.brain, "start_week": params.start_week, "week": week}
            rows.append(row | {"horizon": round(week - params.start_week, 6), "model": model} | found)
    write_table(snakemake.output[0], with_skill(pd.DataFrame(rows)))
