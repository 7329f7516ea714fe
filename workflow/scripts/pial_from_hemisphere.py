"""The clean pial surface in RAS+ mm of the only hemisphere of a brain, from its surface or from a label volume."""

from gyriflow.anatomy.pial import from_labels, from_surface
from gyriflow.io.files import write_json
from gyriflow.io.surfaces import read_one_hemisphere, write_brain
from gyriflow.io.volumes import read_label_volume
from gyriflow.parameters.schemes import LabelScheme
from gyriflow.step import step

file, output, params = snakemake.input[0], snakemake.output, snakemake.params
with step(snakemake.log[0], file):
    of_both = {"side": params.side, "week": params.week, **params.settings}
    if params.scheme:
        volume = read_label_volume(file, affine_from=params.affine_from, cropped=True)
        scheme = LabelScheme(**params.scheme)
        surface = from_labels(volume.labels, volume.affine, scheme, **of_both, **params.of_labels)
    else:
        mesh = read_one_hemisphere(file, params.side)
        surface = from_surface(mesh, coordinates=params.coordinates, **of_both, **params.of_surfaces)
    write_brain(output, surface.whole, surface.left, surface.right)
    write_json(output.report, surface.report)
