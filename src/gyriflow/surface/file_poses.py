"""How the files of a brain lie to its posed surface, from the report of the surface."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError

LPS_TO_RAS = np.diag([-1.0, -1.0, 1.0, 1.0])


def surface_pose(report: Mapping) -> NDArray[np.float64]:
    """Returns the (4, 4) motion from a brain's surface files to its surface.

    The reported pose begins at the coordinates of the file, but for hemispheres that are given in LPS: theirs begins at
    RAS+.
    """
    pose = np.array(report["pose"])
    return pose @ LPS_TO_RAS if _in_lps(report) and report["source"] == "hemispheres" else pose


def volume_pose(report: Mapping, path: str) -> NDArray[np.float64]:
    """Returns the (4, 4) motion from a brain's volumes to its surface.

    Volumes are in RAS+, whatever the coordinates that the configuration names for the surface files.

    Raises
    ------
    InputError
        Where its hemispheres were posed separately: a volume cannot follow two motions.
    """
    if "posing" in report and not report["posing"]["together"]:
        raise InputError(
            "a volume cannot belong to a brain whose hemispheres were posed separately",
            path=path,
            found="one motion for the left and another for the right hemisphere (posing in surface.json)",
            expected="hemispheres that lie in the coordinates of one brain",
            remedy="Give the values per vertex (GIFTI), on surfaces of the brain, or hemispheres posed as one brain.",
        )
    pose, posing = np.array(report["pose"]), report.get("posing", {})
    begins_in_lps = posing.get("coordinates") == "lps" or (_in_lps(report) and report["source"] != "hemispheres")
    return pose @ LPS_TO_RAS if begins_in_lps else pose


def _in_lps(report: Mapping) -> bool:
    return report.get("coordinates") == "lps"
