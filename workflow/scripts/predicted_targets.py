"""Write the shapes that a start brain would have in later weeks if it grew as an
atlas."""

import numpy as np

from gyriflow.anatomy.sulci import may_have_slits
from gyriflow.folding.elastic_fit import ElasticFit
from gyriflow.geometry.deformations import between_moved
from gyriflow.growth.atlas_path import AtlasPath, other_volumes
from gyriflow.growth.expected import place_in_atlas, predict_shapes
from gyriflow.growth.series_shapes import SeriesShapes, sizes_of
from gyriflow.io.files import read_json
from gyriflow.io.registrations import (
    WeeklyShapes,
    read_correspondence,
    read_weekly_shapes,
    write_weekly_shapes,
)
from gyriflow.io.surfaces import read_pose
from gyriflow.io.tetmeshes import read_tetrahedral_mesh
from gyriflow.io.yaml_files import read_yaml
from gyriflow.metrics.norms import cohort_from_plain
from gyriflow.step import step

files, params = snakemake.input, snakemake.params
with step(snakemake.log[0]):
    mesh, kept = read_tetrahedral_mesh(files.mesh), read_weekly_shapes(files.path)
    path = AtlasPath(
        kept.tets,
        SeriesShapes(
            kept.weeks.tolist(),
            kept.positions,
            kept.stops,
        ),
    )
    pair_of_poses = zip(files.reports, params.posed, strict=True)
    poses = [
        np.eye(4) if is_posed else read_pose(report).world
        for report, is_posed in pair_of_poses
    ]
    pair = between_moved(read_correspondence(files.correspondence[0]), *poses)
    atlas_report = read_json(files.reports[1])
    inside = place_in_atlas(
        mesh,
        pair,
        path.mesh(params.atlas_week),
        ElasticFit,
        has_slits=params.open_sulci and may_have_slits(atlas_report),
    )
    options = {"further_weeks": params.further_weeks}
    others = []
    if files.norms:
        norms = cohort_from_plain(read_json(files.norms))
        others.append(norms.volumes_by_week(kept.weeks[path.observed]))
    if files.volumes:
        others += other_volumes(read_yaml(files.volumes), params.left_out)
    options["others"] = others
    if params.variation:
        varied = params.variation
        options |= {"age_shift_gw": varied.age_shift_gw, "fading_gw": varied.fading_gw}
        options["smoothing_mm"] = varied.difference_smoothing_mm
        options["lasting"] = varied.lasting
    growth = params.start_week, params.end_week, path, inside, params.atlas_week
    found = predict_shapes(mesh, *growth, ElasticFit, **options)
    sizes, ages = sizes_of(mesh, found.positions), found.ages.table()
    shapes = WeeklyShapes(
        np.array(found.weeks),
        found.positions,
        sizes,
        found.baselines,
        ages,
        found.shapes.stops,
        found.between,
        kept=found.kept,
        placed=found.placed,
    )
    write_weekly_shapes(snakemake.output[0], shapes)
