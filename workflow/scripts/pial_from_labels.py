"""The clean pial surface of a brain and of its hemispheres in RAS+ mm, from a label volume."""

from gyriflow.anatomy.pial import from_labels
from gyriflow.io.downloads import require_checksums
from gyriflow.io.files import write_json
from gyriflow.io.surfaces import write_brain
from gyriflow.io.volumes import read_label_volume
from gyriflow.parameters.schemes import LabelScheme
from gyriflow.step import step

labels, output, params = snakemake.input.labels, snakemake.output, snakemake.params
with step(snakemake.log[0], labels):
    require_checksums(params.known)
    scheme, volume = (
        LabelScheme(**params.scheme),
        read_label_volume(labels, affine_from=params.affine_from, cropped=True),
    )
    surface = from_labels(volume.labels, volume.affine, scheme, week=params.week, **params.settings)
    write_brain(output, surface.whole, surface.left, surface.right)
    write_json(output.report, surface.report)
