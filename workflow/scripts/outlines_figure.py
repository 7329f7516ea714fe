"""Outlines of simulated over those of measured brains, laid onto each other."""

from gyriflow.geometry.triangles import TriangleMesh
from gyriflow.io.figures import write_figure
from gyriflow.io.surfaces import read_surface
from gyriflow.metrics.alignment import rigid_alignment
from gyriflow.report.outlines import outlines_chart
from gyriflow.step import step

files, params = snakemake.input, snakemake.params


def laid_on(simulated, real):
    """Returns the simulated brain in the pose in which it is nearest to the real one, and the real one."""
    motion = rigid_alignment(simulated, real).matrix
    return TriangleMesh(simulated.vertices @ motion[:3, :3].T + motion[:3, 3], simulated.faces), real


with step(snakemake.log[0]):
    pairs = zip(map(read_surface, files.simulated), map(read_surface, files.real), strict=True)
    laid = dict(zip(params.weeks, (laid_on(*pair) for pair in pairs), strict=True))
    figure = outlines_chart(laid, measured=params.measured, synthetic=params.synthetic)
    write_figure(snakemake.output.png, snakemake.output.pdf, figure, dpi=params.dpi)
