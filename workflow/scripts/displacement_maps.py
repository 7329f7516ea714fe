"""Maps of the displacement between output weeks on the pial surface at the interval's end."""

from itertools import pairwise

import numpy as np

from gyriflow.geometry.tetrahedra import TetrahedralMesh, boundary_surface
from gyriflow.geometry.triangles import TriangleMesh
from gyriflow.io.figures import write_figure
from gyriflow.io.frames import read_positions, read_tets, read_weeks
from gyriflow.report.renders import displacement_maps
from gyriflow.step import step

frames, params = snakemake.input[0], snakemake.params
with step(snakemake.log[0]):
    weeks = read_weeks(frames)
    surface, pial = boundary_surface(TetrahedralMesh(read_positions(frames, weeks[0]), read_tets(frames)))
    positions = {week: read_positions(frames, week)[pial] for week in weeks}
    maps = {
        (a, b): (TriangleMesh(positions[b], surface.faces), np.linalg.norm(positions[b] - positions[a], axis=1))
        for a, b in pairwise(weeks)
    }
    figure = displacement_maps(maps, synthetic=params.synthetic)
    write_figure(snakemake.output.png, snakemake.output.pdf, figure, dpi=params.dpi)
