"""Write the targets of a start brain: the shapes of its mesh in later weeks."""

from itertools import pairwise

import numpy as np

from gyriflow.folding.elastic_fit import ElasticFit
from gyriflow.geometry.deformations import between_moved
from gyriflow.growth.expected import carry_sharply, predict_shapes, sizes_of
from gyriflow.io.files import read_json
from gyriflow.io.registrations import WeeklyShapes, read_correspondence, write_weekly_shapes
from gyriflow.io.surfaces import read_pose, read_surface
from gyriflow.io.tetmeshes import read_tetrahedral_mesh
from gyriflow.metrics.norms import cohort_from_plain
from gyriflow.step import step

files, params = snakemake.input, snakemake.params
with step(snakemake.log[0]):
    mesh = read_tetrahedral_mesh(files.mesh)
    surfaces = [read_surface(path) for path in files.surfaces]
    # mesh and surfaces are posed; correspondences are too, or are in the coordinates of the files
    poses = pairwise(read_pose(path).world for path in (files.report, *files.reports))
    pairs = [
        between_moved(
            read_correspondence(path),
            *(np.eye(4) if is_posed else pose for is_posed, pose in zip(posed, pair, strict=True)),
        )
        for path, posed, pair in zip(files.correspondences, params.posed, poses, strict=True)
    ]
    # labels whose sulci stay fused have none to open; surfaces are taken as they are
    opened = [read_json(path).get("sulci", {"sheets": 1}).get("sheets") for path in files.reports]
    open_sulci = params.opens_sulci and any(opened)
    ages, variation = None, params.variation
    if params.is_own_growth:
        weeks, baselines = [params.start_week, *params.weeks], {}
        positions = carry_sharply(mesh, pairs, surfaces, ElasticFit(mesh), open_sulci=open_sulci)
    else:
        options = {"make_body": ElasticFit, "open_sulci": open_sulci}
        if files.norms:
            options["norm_ml"] = cohort_from_plain(read_json(files.norms)).volumes_ml(params.stated_weeks)
        if variation:
            options |= {"smoothing_mm": variation.difference_smoothing_mm, "fading_gw": variation.fading_gw}
        inputs = (params.start_week, pairs, surfaces, params.weeks, params.further_weeks)
        weeks, positions, baselines, ages = predict_shapes(mesh, *inputs, **options)
    sizes, table = sizes_of(mesh, positions), ages.table() if ages else None
    targets = WeeklyShapes(np.array(weeks), positions, sizes, baselines, table)
    write_weekly_shapes(snakemake.output[0], targets)
