"""Compare a study with the results of the paper: two tables, and a page with the verdicts."""

from markupsafe import Markup

from gyriflow.compare.published import (
    SweepTables,
    comparison_caption,
    mirror_distance,
    place_of_largest,
    published_nearest,
    replication_table,
)
from gyriflow.geometry.tetrahedra import TetrahedralMesh, boundary_surface
from gyriflow.io.figures import write_html
from gyriflow.io.files import read_table, write_table
from gyriflow.io.frames import read_positions, read_tets, read_weeks
from gyriflow.io.surfaces import read_surface
from gyriflow.io.yaml_files import read_yaml
from gyriflow.report.tables import html_table
from gyriflow.step import step

files, output, params = snakemake.input, snakemake.output, snakemake.params
with step(snakemake.log[0]):
    sweeps = {
        name: SweepTables(
            **settings, **{table: read_table(files[table][number]) for table in ("members", "comparison", "nearest")}
        )
        for number, (name, settings) in enumerate(params.studies.items())
    }
    published = read_yaml(files.published)
    displacement = read_table(files.displacement)
    run, brain = params.run
    displacement = displacement[(displacement["run"] == run) & (displacement["subject"] == brain)]
    from_back, week = None, published["largest"]["from_week"]
    if {week, week + 1} <= set(read_weeks(files.frames[0])):
        before, after = (read_positions(files.frames[0], end) for end in (week, week + 1))
        _, pial = boundary_surface(TetrahedralMesh(before, read_tets(files.frames[0])))
        from_back = place_of_largest(before, after, pial)
    sides = [read_surface(path) for path in files.sides]
    table = replication_table(
        published,
        displacement,
        list(sweeps.values()),
        rates=read_table(files.rates) if files.rates else None,
        used_rate=read_yaml(files.params[0])["growth_rate_per_s"],
        from_back=from_back,
        mirror_mm=mirror_distance(*sides) if len(sides) == 2 else None,
        surfaces=dict(zip(params.observed, map(read_surface, files.observed), strict=True)),
    )
    write_table(output.csv, table)
    write_table(output.nearest, published_nearest(published, sweeps))
    lines = [
        f"Displacements are those of {' from '.join(params.run)}. The paper's brains: {published['atlas']}.",
        published["sensitivity"],
        *(comparison_caption(name, sweep.week, sweep.comparison) for name, sweep in sweeps.items()),
    ]
    paragraphs = Markup("").join(Markup("<p>{}</p>\n").format(line) for line in lines)
    write_html(output.page, paragraphs + html_table(table))
