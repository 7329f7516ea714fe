"""Fill the surfaces of a brain without labels to a label volume for its
registration."""

from gyriflow.anatomy.thickness import (
    TYPICAL_THICKNESS_MM,
    TYPICAL_VOXEL_MM,
    filled_labels,
)
from gyriflow.geometry.poses import posed_whites
from gyriflow.io.files import read_json
from gyriflow.io.surfaces import read_pose, read_surface
from gyriflow.io.volumes import LabelVolume, write_label_volume
from gyriflow.step import step

files = snakemake.input
with step(snakemake.log[0], *files.white):
    report = read_json(files.report)
    similar = read_json(files.similar) if files.similar else {}
    whites = {side: read_surface(path) for side, path in snakemake.params.white.items()}
    labels, affine = filled_labels(
        read_surface(files.whole),
        [read_surface(path) for path in files.sides],
        report["fissure_x_mm"],
        whites=list(posed_whites(read_pose(files.report), whites).values()),
        thickness_mm=similar.get("mean_mm", TYPICAL_THICKNESS_MM),
        voxel_mm=similar.get("voxel_mm", TYPICAL_VOXEL_MM),
    )
    write_label_volume(snakemake.output[0], LabelVolume(labels, affine))
