"""Regions at the vertices of a surface, in GIFTI label files."""

from collections.abc import Mapping

import nibabel as nib
import numpy as np
from nibabel.gifti import GiftiDataArray, GiftiImage, GiftiLabel, GiftiLabelTable, GiftiMetaData
from numpy.typing import NDArray

from ..errors import InputError
from .files import AnyPath, replaced
from .surfaces import Structure, load_gifti

NO_REGION = 0
UNNAMED = ("", "???", "unknown", "Unknown", "none")
"""Names that label tables give to what is in no region."""

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#8C6D31", "#F0E442")


def read_vertex_labels(path: AnyPath) -> tuple[NDArray[np.int64], dict[int, str]]:
    """Returns the (n,) labels of a GIFTI label file and the names of its table, without those of no region.

    InputError for missing or truncated files, another number of arrays than one, and values that are no whole numbers.
    """
    image = load_gifti(path)
    arrays = image.darrays
    if len(arrays) != 1 or arrays[0].data.ndim != 1:
        raise InputError(
            "is no label file of one array",
            path=path,
            found=", ".join(str(array.data.shape) for array in arrays) or "no arrays",
            expected="one label for each vertex (.label.gii)",
        )
    values = np.asarray(arrays[0].data)
    labels = np.rint(values).astype(np.int64)
    if not np.isfinite(values).all() or np.abs(values - labels).max(initial=0.0) > 1e-3:
        raise InputError("has values that are no whole numbers", path=path, expected="labels")
    names = {int(key): str(name).strip() for key, name in image.labeltable.get_labels_as_dict().items()}
    return labels, {key: name for key, name in names.items() if key != NO_REGION and name not in UNNAMED}


def write_vertex_labels(
    path: AnyPath, labels: NDArray[np.integer], names: Mapping[int, str], structure: Structure | None = None
) -> None:
    """Writes (n,) labels, 0 for no region, with their names as a GIFTI label file (.label.gii)."""
    table = GiftiLabelTable()
    for number, name in {NO_REGION: "???", **names}.items():
        colour = "#FFFFFF" if number == NO_REGION else COLOURS[(number - 1) % len(COLOURS)]
        red, green, blue = (int(colour[place : place + 2], 16) / 255 for place in (1, 3, 5))
        entry = GiftiLabel(key=int(number), red=red, green=green, blue=blue, alpha=float(number != NO_REGION))
        entry.label = name  # type: ignore[attr-defined]
        table.labels.append(entry)
    array = GiftiDataArray(
        np.asarray(labels, dtype=np.int32), intent="NIFTI_INTENT_LABEL", meta=GiftiMetaData({"Name": "regions"})
    )
    meta = GiftiMetaData({"AnatomicalStructurePrimary": structure} if structure else {})
    with replaced(path) as temporary:
        nib.save(GiftiImage(darrays=[array], labeltable=table, meta=meta), temporary)
