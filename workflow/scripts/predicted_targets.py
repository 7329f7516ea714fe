"""Write the shapes that a start brain would have in later weeks if it grew as an atlas."""

import numpy as np

from gyriflow.folding.elastic_fit import ElasticFit
from gyriflow.geometry.deformations import between_moved
from gyriflow.growth.atlas_path import AtlasPath
from gyriflow.growth.expected import predict_shapes
from gyriflow.growth.series_shapes import SeriesShapes, sizes_of
from gyriflow.io.files import read_json
from gyriflow.io.registrations import WeeklyShapes, read_correspondence, read_weekly_shapes, write_weekly_shapes
from gyriflow.io.surfaces import read_pose
from gyriflow.io.tetmeshes import read_tetrahedral_mesh
from gyriflow.metrics.norms import cohort_from_plain
from gyriflow.step import step

files, params = snakemake.input, snakemake.params
with step(snakemake.log[0]):
    mesh, kept = read_tetrahedral_mesh(files.mesh), read_weekly_shapes(files.path)
    path = AtlasPath(kept.tets, SeriesShapes(kept.weeks.tolist(), kept.positions, kept.stops))
    poses = [np.eye(4) if posed else read_pose(report).world for report, posed in zip(files.reports, params.posed)]
    pair = between_moved(read_correspondence(files.correspondence[0]), *poses)
    options = {"further_weeks": params.further_weeks}
    # labels whose sulci stay fused have none to open; surfaces are taken as they are
    opened = read_json(files.reports[1]).get("sulci", {"sheets": 1}).get("sheets")
    options["open_sulci"] = bool(params.opens_sulci and opened)
    if files.norms:
        weeks = [kept.weeks[number] for number in path.observed]
        options["norm_ml"] = cohort_from_plain(read_json(files.norms)).volumes_ml(weeks)
    if params.variation:
        names = {"age_shift_gw", "fading_gw"}
        options |= {name: getattr(params.variation, name) for name in names}
        options["smoothing_mm"] = params.variation.difference_smoothing_mm
    found = predict_shapes(mesh, params.start_week, params.end_week, path, pair, params.atlas_week, ElasticFit, **options)
    by_week = dict(zip(found.shapes.weeks, found.shapes.positions, strict=True)) | dict(found.between)
    weeks = sorted(by_week)
    positions = np.stack([by_week[week] for week in weeks])
    # the baselines have no stops
    surfaces = {name: dict(zip(found.weeks, at, strict=True)) for name, at in found.baselines.items()}
    stops = found.shapes.stops
    at_all = {name: [at[min(at, key=lambda known: abs(known - week))] for week in weeks] for name, at in surfaces.items()}
    shapes = WeeklyShapes(
        np.array(weeks), positions, sizes_of(mesh, positions), at_all, found.ages.table(), stops, list(found.between)
    )
    write_weekly_shapes(snakemake.output[0], shapes)
