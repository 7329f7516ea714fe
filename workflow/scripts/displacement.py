"""The weekly norms of a run's displacement."""

from gyriflow.geometry.tetrahedra import TetrahedralMesh, boundary_surface
from gyriflow.io.files import write_table
from gyriflow.io.frames import read_positions, read_tets, read_weeks
from gyriflow.metrics.tables import weekly_norms
from gyriflow.step import step

frames, labels = snakemake.input[0], snakemake.params.labels
with step(snakemake.log[0]):
    weeks = read_weeks(frames)
    positions = [read_positions(frames, week) for week in weeks]
    _, pial = boundary_surface(TetrahedralMesh(positions[0], read_tets(frames)))
    table = weekly_norms(weeks, positions, pial)
    write_table(snakemake.output[0], table.assign(**labels)[[*labels, *table.columns]])
