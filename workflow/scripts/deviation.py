"""Measure how an observed brain deviates from a run's prediction: maps on the predicted
surface, and a table."""

from gyriflow.compare.deviation import (
    deviation_maps,
    deviation_table,
    thickness_difference,
)
from gyriflow.geometry.alignment import align
from gyriflow.geometry.triangles import TriangleMesh
from gyriflow.growth.expected import fit_onto_surface
from gyriflow.io.files import write_table
from gyriflow.io.surfaces import (
    read_surface,
    read_vertex_labels,
    read_vertex_maps,
    write_vertex_maps,
)
from gyriflow.step import step

files, params = snakemake.input, snakemake.params
with step(snakemake.log[0]):
    start, first, surface, observed = map(
        read_surface,
        (
            files.start,
            files.first,
            files.expected,
            files.observed,
        ),
    )
    expected = align(surface, observed)
    fitted = TriangleMesh(fit_onto_surface(expected, observed), expected.faces)
    maps = deviation_maps(expected, fitted)
    if files.thickness:
        start_mm, first_mm, expected_mm, observed_mm = (
            read_vertex_maps(path)["thickness_mm"] for path in files.thickness
        )
        maps["thickness_difference_mm"] = thickness_difference(
            fitted,
            (observed, observed_mm),
            (start, start_mm),
            (first, first_mm),
            expected_mm,
        )
    write_vertex_maps(snakemake.output.maps, maps)
    sides = dict(
        zip(
            params.sides,
            map(read_surface, files.sides),
            strict=True,
        )
    )
    regions = dict(
        zip(
            params.sides,
            map(read_vertex_labels, files.regions),
            strict=False,
        )
    )
    write_table(
        snakemake.output.table,
        deviation_table(params.columns, surface, maps, sides, regions),
    )
