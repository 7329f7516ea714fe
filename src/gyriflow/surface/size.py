"""Whether a cerebrum has a plausible size for its week: catches files in metres, micrometres or centimetres."""

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..units import ML_PER_MM3

# cerebral volume (mL) at 25.4 and 36.6 GW: the atlas of Fidon et al. 2021 (doi 10.5281/zenodo.5524312) and the growth
# by 230 % between these weeks found by Clouchoux et al. 2012 (doi 10.1016/j.ajog.2011.10.002)
EARLY, LATE = (25.4, 92.0), (36.6, 304.0)
# from small fetuses with pathologies to adults, and the log-linear growth is a coarse one
LEAST, MOST = 0.2, 6.0
# means of atlases from 21 to 36 GW are 0.57 to 1.24 of it; in voxels of 0.8 mm instead of mm, 1.95 times as much
DOUBTFUL_LEAST, DOUBTFUL_MOST = 0.4, 1.6
UNITS_MM = {"metres": 1e3, "micrometres": 1e-3, "centimetres": 10.0, "decimetres": 100.0}


def expected_volume_ml(week: float) -> float:
    """Returns the coarse volume of a cerebrum (mL) at a gestational week, growing exponentially."""
    rate = np.log(LATE[1] / EARLY[1]) / (LATE[0] - EARLY[0])
    return float(EARLY[1] * np.exp(rate * (week - EARLY[0])))


def require_plausible_size(volume_mm3: float, extents_mm: NDArray[np.float64], week: float) -> list[str]:
    """Returns what is doubtful about a cerebrum's volume at its week: below 0.4 or above 1.6 of the published one.

    InputError where it is out of all proportion, less than a fifth or more than six times, with a guess of the unit.
    `extents_mm` (3,) only appears in the message.
    """
    expected = expected_volume_ml(week)
    volume = volume_mm3 * ML_PER_MM3
    share = volume / expected
    if LEAST <= share <= MOST:
        if DOUBTFUL_LEAST <= share <= DOUBTFUL_MOST:
            return []
        return [f"a cerebrum of {volume:.0f} mL has {100 * share:.0f} % of the volume expected at week {week:g}: "
                "is the week right, and is the file in mm, not in voxel indices?"]  # fmt: skip
    guess = next((u for u, mm in UNITS_MM.items() if LEAST <= volume * mm**3 / expected <= MOST), None)
    raise InputError(
        f"the cerebrum's size is not that of week {week:g}",
        found=f"{volume:.3g} mL, {' x '.join(f'{extent:.3g}' for extent in extents_mm)} mm",
        expected=f"{LEAST * expected:.0f} to {MOST * expected:.0f} mL",
        remedy=f"The file seems to be in {guess}: give it in mm, or with its unit in the header."
        if guess
        else "Check the file's unit, its week, and which labels make the cerebrum.",
    )
