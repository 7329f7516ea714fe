"""Maps of the contact pressure at the output weeks, on the surface of the start: there no fold hides it."""

from gyriflow.geometry.tetrahedra import TetrahedralMesh, boundary_surface
from gyriflow.io.figures import write_figure
from gyriflow.io.frames import read_field, read_positions, read_tets, read_weeks
from gyriflow.report.renders import scalar_maps
from gyriflow.step import step

frames, params = snakemake.input[0], snakemake.params
with step(snakemake.log[0]):
    start, *weeks = read_weeks(frames)
    surface, pial = boundary_surface(TetrahedralMesh(read_positions(frames, start), read_tets(frames)))
    maps = {week: (surface, read_field(frames, week, params.quantity)[pial]) for week in weeks}
    figure = scalar_maps(
        {"simulated": maps},
        quantity=params.quantity,
        views=("left", "right", "top", "bottom"),
        synthetic=params.synthetic,
    )
    write_figure(snakemake.output.png, snakemake.output.pdf, figure, dpi=params.dpi)
