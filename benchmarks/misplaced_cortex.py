"""Count warnings of misplaced cortex for unchanged label volumes, and for the same volumes with faults.

    ./run python benchmarks/misplaced_cortex.py --weeks 21 38 --atlas cc0 'FOLDER/week{week}_labels.nii.gz' \\
        --atlas crl 'FOLDER/HarvardSTA{week}_Study1/parcellation.nii.gz'

Without --atlas, the volumes of the shipped atlas are taken. Labels are those of the scheme spina-bifida-atlas. Each row
has the number of volumes, the number with a warning, and the weeks without one. The last line is one JSON object.
"""

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from common import ROOT, print_rows
from scipy import ndimage

from gyriflow.anatomy.misplaced import misplaced_cortex
from gyriflow.io.volumes import LabelVolume, read_label_volume
from gyriflow.io.yaml_files import SCHEMES

SCHEME = SCHEMES["spina-bifida-atlas"]
(CORTEX,) = SCHEME.cortex
SHIPPED_VOLUMES = str(ROOT / "atlases/spina-bifida/fetal_SB_atlas_GA{week}_*/parcellation.nii.gz")
# room for what is added outside the brain
MARGIN_MM = 20.0
BLOB_MM = 4.0
BLOB_AWAY_MM = 8.0
# a sheet of cortex fills the fissure within this distance of its middle, and stands out by as much above the brain
SHEET_MM = 0.8
SHEET_ABOVE_MM = 8.0
LAYER_MM = 1.6


def with_margin(volume: LabelVolume) -> LabelVolume:
    """Return a volume with empty voxels around it."""
    voxels = int(np.ceil(MARGIN_MM / np.linalg.norm(volume.affine[:3, :3], axis=0).min()))
    affine = volume.affine.copy()
    affine[:3, 3] -= affine[:3, :3] @ np.full(3, voxels)
    return LabelVolume(np.pad(volume.labels, voxels), affine)


def faults(volume: LabelVolume) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the labels unchanged and with each fault, with its name."""
    labels, affine = volume.labels, volume.affine
    size = np.linalg.norm(affine[:3, :3], axis=0)
    cerebrum = np.isin(labels, SCHEME.cerebrum)
    ventricles = np.isin(labels, SCHEME.ventricles)
    hindbrain = np.isin(labels, (*SCHEME.cerebellum, *SCHEME.brainstem))
    x, _, z = np.indices(labels.shape)

    def ball(centre: np.ndarray) -> np.ndarray:
        offsets = (np.indices(labels.shape).T - centre) * size
        return np.linalg.norm(offsets, axis=-1).T <= BLOB_MM

    yield "none", labels
    yield "cerebellum is cortex", np.where(np.isin(labels, SCHEME.cerebellum), CORTEX, labels)
    yield "brainstem is cortex", np.where(np.isin(labels, SCHEME.brainstem), CORTEX, labels)
    yield "both are cortex", np.where(hindbrain, CORTEX, labels)

    depth = ndimage.distance_transform_edt(ventricles, sampling=size)
    widest = np.argwhere(depth == depth.max())[0]
    yield "blob in a ventricle", np.where(ball(widest) & ventricles, CORTEX, labels)

    near = ndimage.distance_transform_edt(~ventricles, sampling=size) <= LAYER_MM
    yield "layer around the ventricles", np.where(near & np.isin(labels, SCHEME.white_matter), CORTEX, labels)

    # above the brain's middle, so that the fissure is filled from the callosum to beyond its edge
    middle = np.argwhere(cerebrum)[:, 0].mean()
    reached = ndimage.distance_transform_edt(~cerebrum, sampling=size) <= SHEET_ABOVE_MM
    above = z > np.median(np.argwhere(cerebrum)[:, 2])
    sheet = (np.abs(x - middle) * size[0] <= SHEET_MM) & reached & above
    yield "sheet in the fissure", np.where(sheet & ~cerebrum & ~hindbrain, CORTEX, labels)

    top = np.argwhere(cerebrum)
    centre = top[top[:, 2].argmax()] + np.array([0, 0, (BLOB_AWAY_MM + BLOB_MM) / size[2]])
    yield "blob outside, 8 mm away", np.where(ball(centre) & ~cerebrum, CORTEX, labels)


def paths(pattern: str, week: int) -> list[Path]:
    """Return the files of a week that a pattern with {week} names."""
    pattern = pattern.format(week=week)
    root = Path(pattern.split("*", maxsplit=1)[0]).parent if "*" in pattern else Path(pattern).parent
    return sorted(root.glob(str(Path(pattern).relative_to(root))))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--atlas", nargs=2, action="append", metavar=("NAME", "PATTERN"))
    parser.add_argument("--weeks", type=int, nargs=2, default=(21, 38))
    parser.add_argument("--every", type=int, default=1, help="weeks between the volumes that get faults")
    arguments = parser.parse_args()
    first, last = arguments.weeks

    rows: dict[tuple[str, str], dict] = {}
    for atlas, pattern in arguments.atlas or [("shipped", SHIPPED_VOLUMES)]:
        for week in range(first, last + 1):
            for path in paths(pattern, week):
                volume = with_margin(read_label_volume(path, cropped=True))
                for fault, labels in faults(volume):
                    if fault != "none" and (week - first) % arguments.every:
                        break
                    warnings = list(misplaced_cortex(labels, volume.affine, SCHEME))
                    row = rows.setdefault((atlas, fault), {"volumes": 0, "warned": 0, "not_warned": []})
                    row["volumes"] += 1
                    row["warned"] += bool(warnings)
                    if not warnings:
                        row["not_warned"].append(week)
    table = [{"atlas": atlas, "fault": fault} | row for (atlas, fault), row in rows.items()]
    print_rows(table)


if __name__ == "__main__":
    main()
