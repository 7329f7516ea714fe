"""Write the shapes of a brain's mesh in the later weeks of its own series: targets of a
run, or an atlas' path."""

from contextlib import suppress
from itertools import pairwise
from pathlib import Path

import numpy as np

from gyriflow.anatomy.sulci import may_have_slits
from gyriflow.errors import StorageError
from gyriflow.folding.elastic_fit import ElasticFit
from gyriflow.geometry.deformations import between_moved
from gyriflow.growth.series_shapes import SeriesShapes, follow_series, sizes_of
from gyriflow.io.files import read_json
from gyriflow.io.origins import present_key
from gyriflow.io.registrations import (
    WeeklyShapes,
    read_correspondence,
    stored_name,
    write_weekly_shapes,
)
from gyriflow.io.surfaces import read_pose, read_surface
from gyriflow.io.tetmeshes import read_tetrahedral_mesh
from gyriflow.io.unfinished import unfinished_series
from gyriflow.step import step

files, params = snakemake.input, snakemake.params
with step(snakemake.log[0]):
    mesh = read_tetrahedral_mesh(files.mesh)
    surfaces = [read_surface(path) for path in files.surfaces]
    # mesh and surfaces are posed; correspondences are too, or are in the coordinates of
    # the files
    poses = pairwise(read_pose(path).world for path in (files.report, *files.reports))
    pairs = [
        between_moved(
            read_correspondence(path),
            *(
                np.eye(4) if is_posed else pose
                for is_posed, pose in zip(posed, pair, strict=True)
            ),
        )
        for path, posed, pair in zip(
            files.correspondences, params.posed, poses, strict=True
        )
    ]
    reports = [read_json(path) for path in files.reports]
    has_slits = params.open_sulci and any(map(may_have_slits, reports))
    made_from = [
        files.mesh,
        files.data,
        files.report,
        *files.correspondences,
        *files.surfaces,
        *files.reports,
    ]
    settings = [params.weeks, params.posed, has_slits, params.code]
    unfinished = unfinished_series(snakemake.output[0], made_from, settings)
    state = unfinished.read()

    def _keep(shapes: SeriesShapes) -> None:
        # a fit does not end for a checkpoint that cannot be written
        with suppress(StorageError):
            unfinished.write(shapes.weeks, shapes.positions, shapes.stops)

    found = follow_series(
        mesh,
        params.weeks,
        pairs,
        surfaces,
        ElasticFit(mesh),
        has_slits=has_slits,
        earlier=SeriesShapes(*state) if state else None,
        after_week=_keep,
    )
    sizes = sizes_of(mesh, found.positions)
    key = ""
    if params.origin:
        # known now that all files of the atlas are there
        key = present_key(params.origin) or ""
    own = {
        "stops": found.stops,
        "tets": mesh.tets,
        "made_from": key,
    }
    shapes = WeeklyShapes(
        np.array(found.weeks),
        found.positions,
        sizes,
        **own,
    )
    write_weekly_shapes(snakemake.output[0], shapes)
    if params.store and key:
        with suppress(StorageError):
            write_weekly_shapes(
                Path(
                    params.store,
                    stored_name(snakemake.wildcards.brain, key),
                ),
                shapes,
            )
    unfinished.remove()
