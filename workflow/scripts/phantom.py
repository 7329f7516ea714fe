"""A synthetic brain of a week as a label volume."""

from gyriflow.io.volumes import LabelVolume, write_label_volume
from gyriflow.phantom.brain import phantom_labels
from gyriflow.phantom.pathologies import PATHOLOGIES
from gyriflow.step import step

with step(snakemake.log[0]):
    labels, affine = phantom_labels(snakemake.params.week, **snakemake.params.settings)
    if pathology := snakemake.params.pathology:
        labels = PATHOLOGIES[pathology](labels, affine)
    write_label_volume(snakemake.output[0], LabelVolume(labels, affine))
