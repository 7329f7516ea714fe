"""What a shut fissure costs: the pial area of shipped brains from all their labels, and from a mask of the same voxels.

`python benchmarks/shut_fissure.py`
"""

import numpy as np

from gyriflow.anatomy.pial import from_labels
from gyriflow.geometry.triangles import area
from gyriflow.io.volumes import read_label_volume
from gyriflow.io.yaml_files import SCHEMES
from gyriflow.shipped import SHIPPED

BRAINS = {22: "notoperated", 25: "notoperated", 28: "operated", 31: "operated", 34: "operated"}
SCHEME = SCHEMES["spina-bifida-atlas"]

for week, kind in BRAINS.items():
    folder = SHIPPED / "atlases" / "spina-bifida" / f"fetal_SB_atlas_GA{week}_{kind}"
    volume = read_label_volume(folder / "parcellation.nii.gz", cropped=True)
    mask = np.isin(volume.labels, SCHEME.cerebrum).astype(np.int32)
    whole = from_labels(volume.labels, volume.affine, SCHEME, week=week, edge_length_mm=1.5)
    masked = from_labels(mask, volume.affine, SCHEMES["binary"], week=week, edge_length_mm=1.5)
    areas = area(whole.whole), area(masked.whole)
    shut = any("keeps the fissure shut" in warning for warning in masked.report["warnings"])
    print(
        f"{week} GW {kind}: {areas[0] / 100:.1f} to {areas[1] / 100:.1f} cm², {areas[1] / areas[0] - 1:+.1%}, {shut=}"
    )
