"""Write the inside of a brain's pial surface as a label volume, for the registration of brains without labels."""

from gyriflow.geometry.matching import surface_mask
from gyriflow.io.surfaces import read_surface
from gyriflow.io.volumes import LabelVolume, write_label_volume
from gyriflow.step import step

with step(snakemake.log[0]):
    mask = surface_mask(read_surface(snakemake.input[0]), snakemake.params.voxel_mm)
    write_label_volume(snakemake.output[0], LabelVolume(*mask))
