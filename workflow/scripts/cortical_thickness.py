"""Cortical thickness at the vertices of a brain's pial surface, from the labels of its cortex."""

from gyriflow.anatomy.thickness import thickness_from_labels
from gyriflow.io.files import write_json
from gyriflow.io.surfaces import read_pose, read_surface, write_vertex_maps
from gyriflow.io.volumes import read_label_volume
from gyriflow.parameters.schemes import LabelScheme
from gyriflow.step import step

files, params = snakemake.input, snakemake.params
with step(snakemake.log[0], files.labels):
    scheme, volume = (
        LabelScheme(**params.scheme),
        read_label_volume(files.labels, affine_from=params.affine_from, cropped=True),
    )
    surface, pose = read_surface(files.surface), read_pose(files.report)
    thickness = thickness_from_labels(volume.labels, volume.affine, scheme, surface, pose, **params.settings)
    write_vertex_maps(snakemake.output.thickness, {"cortical thickness (mm)": thickness.values_mm})
    write_vertex_maps(snakemake.output.measured, {"thickness_mm": thickness.measured_mm})
    write_json(snakemake.output.report, thickness.report)
