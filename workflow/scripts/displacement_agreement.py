"""Agreement of the displacement of a run's pial vertices with the measured one, interval by interval."""

from gyriflow.compare.displacement import displacement_table
from gyriflow.geometry.tetrahedra import TetrahedralMesh, boundary_surface
from gyriflow.io.files import write_table
from gyriflow.io.frames import read_positions, read_tets, read_weeks
from gyriflow.io.registrations import read_weekly_shapes
from gyriflow.step import step

files, labels = snakemake.input, snakemake.params.labels
with step(snakemake.log[0]):
    carried, weeks = read_weekly_shapes(files.carried), read_weeks(files.frames)
    shared = [week for week in weeks if week in carried.weeks]
    start = read_positions(files.frames, weeks[0])
    surface, pial = boundary_surface(TetrahedralMesh(start, read_tets(files.frames)))
    simulated = [read_positions(files.frames, week)[pial] for week in shared]
    measured = [carried.positions[carried.index(week)][pial] for week in shared]
    table = displacement_table(shared, simulated, measured, surface.faces, registered=snakemake.params.registered)
    write_table(snakemake.output[0], table.assign(**labels)[[*labels, *table.columns]])
