"""A label volume made from a brain's image by the user's own command, checked before it is used."""

from gyriflow.anatomy.labels import cerebrum_mask
from gyriflow.io.commands import run_command
from gyriflow.io.files import replaced
from gyriflow.io.volumes import read_label_volume, require_same_grid
from gyriflow.parameters.schemes import LabelScheme
from gyriflow.step import step

image, params = snakemake.input[0], snakemake.params
with step(snakemake.log[0]), replaced(snakemake.output[0]) as labels:
    run_command(params.command, {"image": image, "labels": labels}, "labels")
    volume = read_label_volume(labels, affine_from=params.affine_from)
    require_same_grid(volume, snakemake.output[0], image, params.affine_from)
    cerebrum_mask(volume.labels, LabelScheme(**params.scheme))
