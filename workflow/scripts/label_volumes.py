"""The volumes of a brain's labels, and where they stand among published ones."""

import numpy as np
import pandas as pd

from gyriflow.io.files import write_table
from gyriflow.io.yaml_files import read_yaml
from gyriflow.metrics.norms import published_norms, published_scores, structure_volumes
from gyriflow.step import step
from gyriflow.units import ML_PER_MM3

output, params = snakemake.output, snakemake.params
with step(snakemake.log[0], params.labels.path):
    scheme, volume = params.labels.scheme, params.labels.read(cropped=True)
    numbers, voxels = np.unique(volume.labels[volume.labels > 0], return_counts=True)
    volumes = dict(zip(numbers.tolist(), voxels * abs(np.linalg.det(volume.affine[:3, :3])) * ML_PER_MM3, strict=True))
    rows = [(number, scheme.labels.get(number, ""), value) for number, value in volumes.items()]
    table = pd.DataFrame(rows, columns=["label", "tissue", "volume_mL"])
    write_table(output.volumes, table.assign(**params.columns)[[*params.columns, *table.columns]])
    norms = published_norms(read_yaml(snakemake.input.norms))
    found, others = structure_volumes(volumes, scheme, norms)
    scores = published_scores(found, params.columns["week"], norms, others, params.sides)
    write_table(output.scores, scores.assign(subject=params.columns["subject"])[["subject", *scores.columns]])
