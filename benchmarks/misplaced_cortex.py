"""Count warnings of misplaced cortex for unchanged label volumes, and for the same
volumes with faults.

    ./run python benchmarks/misplaced_cortex.py --weeks 21 38 \\
        --atlas cc0 'FOLDER/week{week}_labels.nii.gz' \\
        --atlas crl 'FOLDER/HarvardSTA{week}_Study1/parcellation.nii.gz'

Without --atlas, the volumes of the shipped atlas are taken. Labels are those of the
scheme spina-bifida-atlas. Each row has the number of volumes, the number with a
warning, and the weeks without one. The last line is one JSON object.
"""

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from common import ROOT, print_rows
from scipy import ndimage

from gyriflow.anatomy.extraction import dilated
from gyriflow.anatomy.misplaced import around_cerebrum, misplaced_cortex
from gyriflow.geometry.deformations import voxel_size
from gyriflow.io.volumes import LabelVolume, read_label_volume
from gyriflow.io.yaml_files import SCHEMES

SCHEME = SCHEMES["spina-bifida-atlas"]
(CORTEX,) = SCHEME.cortex
SHIPPED_VOLUMES = str(
    ROOT / "atlases/spina-bifida/fetal_SB_atlas_GA{week}_*/parcellation.nii.gz"
)
# room for what is added outside the brain
MARGIN_MM = 18.0
BLOB_MM = 4.0
BLOB_AWAY_MM = 8.0
# a sheet of cortex fills the fissure within this distance of its middle, and stands out
# by as much above the brain
SHEET_MM = 0.8
SHEET_ABOVE_MM = 8.0
LAYER_MM = 1.6


def with_margin(volume: LabelVolume) -> LabelVolume:
    """Return a volume with empty voxels around it."""
    voxels = int(np.ceil(MARGIN_MM / voxel_size(volume.affine).min()))
    affine = volume.affine.copy()
    affine[:3, 3] -= affine[:3, :3] @ np.full(3, voxels)
    return LabelVolume(np.pad(volume.labels, voxels), affine)


def faults(volume: LabelVolume) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the labels unchanged and with each fault, with its name."""
    labels, affine = volume.labels, volume.affine
    size = voxel_size(affine)
    cerebrum = np.isin(labels, SCHEME.cerebrum)
    ventricles = np.isin(labels, SCHEME.ventricles)
    hindbrain = np.isin(labels, (*SCHEME.cerebellum, *SCHEME.brainstem))
    x, y, z = np.ogrid[tuple(slice(0, n) for n in labels.shape)]

    def ball(centre: np.ndarray) -> np.ndarray:
        squared = (
            ((x - centre[0]) * size[0]) ** 2
            + ((y - centre[1]) * size[1]) ** 2
            + ((z - centre[2]) * size[2]) ** 2
        )
        return squared <= BLOB_MM**2

    yield "none", labels
    yield (
        "cerebellum is cortex",
        np.where(np.isin(labels, SCHEME.cerebellum), CORTEX, labels),
    )
    yield (
        "brainstem is cortex",
        np.where(np.isin(labels, SCHEME.brainstem), CORTEX, labels),
    )
    yield "both are cortex", np.where(hindbrain, CORTEX, labels)

    box = ndimage.find_objects(ventricles.astype(np.uint8))[0]
    depth = ndimage.distance_transform_edt(np.pad(ventricles[box], 1), sampling=size)
    widest = np.argwhere(depth == depth.max())[0] - 1 + [side.start for side in box]
    yield "blob in a ventricle", np.where(ball(widest) & ventricles, CORTEX, labels)

    near = dilated(ventricles, LAYER_MM / size.min())
    yield (
        "layer around the ventricles",
        np.where(near & np.isin(labels, SCHEME.white_matter), CORTEX, labels),
    )

    # above the brain's middle, so that the fissure is filled from the callosum to
    # beyond its edge
    places = np.argwhere(cerebrum)
    middle, height = places[:, 0].mean(), np.median(places[:, 2])
    reached = dilated(cerebrum, SHEET_ABOVE_MM / size.min())
    sheet = (np.abs(x - middle) * size[0] <= SHEET_MM) & reached & (z > height)
    yield (
        "sheet in the fissure",
        np.where(sheet & ~cerebrum & ~hindbrain, CORTEX, labels),
    )

    centre = places[places[:, 2].argmax()] + np.array(
        [0, 0, (BLOB_AWAY_MM + BLOB_MM) / size[2]]
    )
    yield "blob outside, 8 mm away", np.where(ball(centre) & ~cerebrum, CORTEX, labels)


def paths(pattern: str, week: int) -> list[Path]:
    """Return the files of a week that a pattern with {week} names."""
    pattern = pattern.format(week=week)
    root = (
        Path(pattern.split("*", maxsplit=1)[0]).parent
        if "*" in pattern
        else Path(pattern).parent
    )
    return sorted(root.glob(str(Path(pattern).relative_to(root))))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--atlas", nargs=2, action="append", metavar=("NAME", "PATTERN")
    )
    parser.add_argument("--weeks", type=int, nargs=2, default=(21, 38))
    parser.add_argument(
        "--every", type=int, default=1, help="weeks between the volumes that get faults"
    )
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
                    around = around_cerebrum(labels, volume.affine, SCHEME)
                    warnings = list(misplaced_cortex(around))
                    print(
                        f"{path}: {fault}: {warnings or 'no warning'}",
                        file=sys.stderr,
                        flush=True,
                    )
                    row = rows.setdefault(
                        (atlas, fault), {"volumes": 0, "warned": 0, "not_warned": []}
                    )
                    row["volumes"] += 1
                    row["warned"] += bool(warnings)
                    if not warnings:
                        row["not_warned"].append(week)
    table = [
        {"atlas": atlas, "fault": fault} | row for (atlas, fault), row in rows.items()
    ]
    print_rows(table)


if __name__ == "__main__":
    main()
