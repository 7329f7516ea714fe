"""The outline of a brain's pial surface over its image."""

import numpy as np

from gyriflow.io.figures import write_figure
from gyriflow.io.files import read_json
from gyriflow.io.maps import read_volume_map
from gyriflow.io.surfaces import read_surface
from gyriflow.report.overlay import surface_overlay
from gyriflow.step import step

files, output, params = snakemake.input, snakemake.output, snakemake.params
with step(snakemake.log[0]):
    image = read_volume_map(files.image, params.affine_from)
    # the surface was turned upright
    affine = np.array(read_json(files.report)["pose"]) @ image.affine
    figure = surface_overlay(image.values, affine, read_surface(files.surface))
    write_figure(output.png, output.pdf, figure, dpi=params.dpi)
