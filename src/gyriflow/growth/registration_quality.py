"""Whether a registration is good enough to be used: overlap, folding of the map, and its rim."""

from dataclasses import asdict, dataclass

import numpy as np
from scipy.ndimage import map_coordinates

from ..errors import InputError
from ..geometry.deformations import Deformation, carry, determinants, transform_points
from ..geometry.triangles import Floats
from .channels import CEREBRUM_BIT, CORTEX_BIT, Channels

LEAST_DICE = {"cerebrum": 0.95, "cortex": 0.60}
"""Below these overlaps a registration is refused; that of the cortex is low where it is a voxel thick."""

MOST_FOLDED = 0.005
"""Largest part of the cerebrum's volume where the map may fold."""


@dataclass(frozen=True)
class Quality:
    """Measures of how good a registration is.

    Dice is the overlap 2|A∩B|/(|A| + |B|) of the masks of the earlier brain with those of the later brain taken back,
    NaN without a cortex. Of the determinant of the map's gradient in the earlier cerebrum: the least one, the share of
    the volume where it is ≤ 0, the standard deviation of its logarithm elsewhere, and its mean, the ratio of volumes as
    the map has it. `rim_mm` and `inside_mm` are 95 % quantiles of the displacement at the rim of its grid and inside
    the cerebrum. The rim is to be the smaller: nothing is compared there.
    """

    dice_cerebrum: float
    dice_cortex: float
    least_determinant: float
    folded_share: float
    log_growth_sd: float
    volume_ratio: float
    rim_mm: float
    inside_mm: float


def judge(earlier: Channels, later: Channels, deformation: Deformation) -> Quality:
    """Return the quality of a deformation between two brains, by their masks as they are.

    Folding is judged in the earlier cerebrum, on the deformation's own grid.
    """
    grid = transform_points(np.indices(earlier.tissue.shape).reshape(3, -1).T, earlier.affine)
    places = transform_points(carry(deformation, grid), np.linalg.inv(later.affine)).T
    inside = earlier.tissue & CEREBRUM_BIT > 0
    with_cortex = earlier.cortex is not None and later.cortex is not None
    growth = determinants(deformation)
    at = transform_points(transform_points(np.argwhere(inside), earlier.affine), np.linalg.inv(deformation.affine))
    growth = map_coordinates(growth, at.T, order=1, mode="nearest")
    lengths = np.linalg.norm(deformation.displacement, axis=-1)
    rim = np.ones(lengths.shape, dtype=bool)
    rim[1:-1, 1:-1, 1:-1] = False
    return Quality(
        dice_cerebrum=_dice(earlier, later, CEREBRUM_BIT, places),
        dice_cortex=_dice(earlier, later, CORTEX_BIT, places) if with_cortex else float("nan"),
        least_determinant=float(growth.min()),
        folded_share=float((growth <= 0).mean()),
        log_growth_sd=float(np.log(growth[growth > 0]).std()),
        volume_ratio=float(growth.mean()),
        rim_mm=float(np.quantile(lengths[rim], 0.95)),
        inside_mm=float(np.quantile(map_coordinates(lengths, at.T, order=1, mode="nearest"), 0.95)),
    )


def require_good(quality: Quality, *, pair: str) -> None:
    """Raise InputError, with all numbers, where a registration of a named `pair` of brains must not be used."""
    values = asdict(quality)
    faults = [
        f"Dice of the {mask} {values[f'dice_{mask}']:.3f} below {least:g}"
        for mask, least in LEAST_DICE.items()
        if values[f"dice_{mask}"] < least
    ]
    if quality.folded_share > MOST_FOLDED:
        faults.append(f"the map folds in {quality.folded_share:.2%} of the cerebrum, above {MOST_FOLDED:.2%}")
    if faults:
        numbers = ", ".join(f"{name} {value:.3g}" for name, value in values.items())
        raise InputError(
            f"the registration {pair} has failed: {'; '.join(faults)}",
            found=numbers,
            expected="two brains that differ by some weeks of growth",
            remedy="Look at both label volumes; leave out the one that does not fit, or take brains of nearer weeks.",
        )


def _dice(earlier: Channels, later: Channels, bit: int, places: Floats) -> float:
    one = (earlier.tissue & bit > 0).ravel()
    other = map_coordinates((later.tissue & bit > 0).astype(np.float32), places, order=1) > 0.5
    return float(2 * np.count_nonzero(one & other) / max(np.count_nonzero(one) + np.count_nonzero(other), 1))
