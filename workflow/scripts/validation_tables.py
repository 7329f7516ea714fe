"""Write the validation of all runs, the agreement of their displacements, and the scores of deviations."""

import pandas as pd

from gyriflow.compare.deviation import deviation_scores
from gyriflow.compare.displacement import displacement_table
from gyriflow.geometry.tetrahedra import TetrahedralMesh, boundary_surface
from gyriflow.io.files import read_tables, write_table
from gyriflow.io.frames import read_positions, read_tets, read_weeks
from gyriflow.io.registrations import read_weekly_shapes
from gyriflow.step import step

files, params, output = snakemake.input, snakemake.params, snakemake.output


def agreement(run, registered, frames, carried):
    """Compare the displacement of a run's pial vertices with the measured one, interval by interval."""
    carried, weeks = read_weekly_shapes(carried), read_weeks(frames)
    shared = [week for week in weeks if week in carried.weeks]
    surface, pial = boundary_surface(TetrahedralMesh(read_positions(frames, weeks[0]), read_tets(frames)))
    simulated = [read_positions(frames, week)[pial] for week in shared]
    observed = [carried.positions[carried.index(week)][pial] for week in shared]
    table = displacement_table(shared, simulated, observed, surface.faces, registered=registered)
    return table.assign(run=run, start_week=weeks[0])[["run", "start_week", *table.columns]]


with step(snakemake.log[0]):
    tables = {name: read_tables(files[name]) for name, _ in output.items() if files.get(name)}
    if "deviation" in tables:
        tables["deviation_centiles"] = deviation_scores(tables["deviation"], individuals=params.individuals)
    if params.carried:
        runs = zip(*zip(*params.carried, strict=True), files.frames, files.carried, strict=True)
        tables["displacement_agreement"] = pd.concat([agreement(*run) for run in runs], ignore_index=True)
    for name, path in output.items():
        write_table(path, tables[name])
