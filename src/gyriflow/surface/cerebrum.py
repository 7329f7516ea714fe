"""Where a label volume's cerebrum is: what its labels enclose, and reports of labels that are lost."""

import logging
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from ..parameters.schemes import LabelScheme
from ..units import ML_PER_MM3
from .labels import cerebrum_mask, missing_tissues, require_cortex_outside
from .pial import TOLD_LOSS, warn
from .stalks import without_stalks
from .ventricles import outside_ventricles

log = logging.getLogger(__name__)

Floats = NDArray[np.float64]
Labels = NDArray[np.integer]

# cortex at less than this fraction of the cerebrum's surface is reported
LITTLE_CORTEX = 0.7


def cerebrum_labels(
    labels: Labels, affine: Floats, scheme: LabelScheme, report: dict[str, Any], least_cortex: float = 0.0
) -> Labels:
    """Returns the labels with 0 in what of the cerebrum's labels is no part of it, and adds volumes to the report.

    These are ventricles that its tissue does not enclose, and what hangs on it by thin stalks. InputError where the
    labels are not the scheme's, and where cortex is at less than `least_cortex` of the cerebrum's surface.
    """
    mask = cerebrum_mask(labels, scheme)
    if missing := missing_tissues(labels, scheme):
        report["missing_tissues"] = missing
        log.info("tissues that this brain does not have: %s", ", ".join(missing[:20]))
    if scheme.cortex and (share := require_cortex_outside(labels, scheme, least_cortex)) < LITTLE_CORTEX:
        warn(report, f"cortex lies at only {100 * share:.0f} % of the cerebrum's surface: check the labels")
    voxel_ml = float(abs(np.linalg.det(affine[:3, :3]))) * ML_PER_MM3
    open_fluid = outside_ventricles(labels, scheme)
    kept, stalks = without_stalks(mask & ~open_fluid, affine)
    tissue = np.where(mask & ~kept, 0, labels)
    hanging = sum(stalk["volume_mm3"] for stalk in stalks) * ML_PER_MM3
    report["outside"] = {"ventricles_mL": float(open_fluid.sum() * voxel_ml), "stalks": stalks}
    lost = float(open_fluid.sum() * voxel_ml) + hanging
    if lost > TOLD_LOSS * mask.sum() * voxel_ml:
        warn(report, f"{lost:.2f} mL of the cerebrum's labels lie outside it or hang on a thin stalk: left out")
    elif lost > 0:
        log.info("%.2f mL of the cerebrum's labels lie outside it or hang on a thin stalk: left out", lost)
    fluid, cortex = np.isin(tissue, scheme.ventricles), np.isin(tissue, scheme.cortex)
    volumes = {"cerebrum": kept, "tissue": kept & ~fluid, "ventricles": fluid, "cortex": cortex}
    volumes["inside_cortex"] = kept & ~fluid & ~cortex
    known = {"cerebrum": True, "tissue": scheme.ventricles, "ventricles": scheme.ventricles, "cortex": scheme.cortex}
    report["label_volumes_mL"] = {
        name: float(voxels.sum() * voxel_ml) for name, voxels in volumes.items() if known.get(name, scheme.cortex)
    }
    return tissue


def report_border(mask: NDArray[np.bool_], report: dict[str, Any]) -> None:
    """Warns where a mask touches the border of its volume: what is beyond it is missing."""
    surface = mask & ~ndimage.binary_erosion(mask, border_value=1)
    ends = [np.moveaxis(mask, axis, 0)[end] for axis in range(3) for end in (0, -1)]
    at_border = int(sum(end.sum() for end in ends))
    share = at_border / max(at_border + int(surface.sum()), 1)
    report["border_share"] = share
    if at_border and share > TOLD_LOSS:
        warn(report, f"the cerebrum touches the border of the volume with {100 * share:.0f} % of its surface: what "
             "lies beyond is missing, and the surface is flat there")  # fmt: skip


def report_dropped(topology: dict[str, Any], affine: Floats, volume_mm3: float, report: dict[str, Any]) -> None:
    """Warns where the repair of a mask's topology has dropped parts of a volume."""
    dropped = topology["voxels_dropped"] * float(abs(np.linalg.det(affine[:3, :3])))
    if dropped > TOLD_LOSS * volume_mm3:
        warn(report, f"{topology['parts_dropped']} parts apart from the brain were dropped: {dropped * ML_PER_MM3:.2f} "
             f"mL, {100 * dropped / volume_mm3:.1f} % of it")  # fmt: skip
