"""Quality of a registration: overlap, folding of the map, and displacement at its rim."""

import logging
from dataclasses import asdict, dataclass, replace

import numpy as np
from scipy.ndimage import map_coordinates

from ..errors import InputError
from ..geometry.deformations import Deformation, carry, determinants, transform_points
from ..geometry.triangles import Floats
from .channels import CEREBRUM_BIT, CORTEX_BIT, Channels
from .diffeomorphic import Registration, register

log = logging.getLogger(__name__)

MIN_DICE = {"cerebrum": 0.95, "cortex": 0.60}
"""Below these overlaps a registration is refused. Overlap of a cortex of one voxel is low."""

MAX_FOLDED = 0.005
"""Largest share of the cerebrum's volume where the map may fold."""


@dataclass(frozen=True)
class RegistrationQuality:
    """Measures of the quality of a registration.

    Dice is the overlap 2|A∩B|/(|A| + |B|) of the masks of the earlier brain with those of the later brain carried back,
    NaN without a cortex. The Jacobian determinant of the map in the earlier cerebrum is described by its minimum, the
    share of the volume where it is ≤ 0, the standard deviation of its logarithm elsewhere, and its mean, the ratio of
    volumes. `rim_mm` and `inside_mm` are 95 % quantiles of the displacement at the rim of the grid and in the cerebrum;
    the rim should have less, since nothing is compared there.
    """

    dice_cerebrum: float
    dice_cortex: float
    least_determinant: float
    folded_share: float
    log_growth_sd: float
    volume_ratio: float
    rim_mm: float
    inside_mm: float


def measure_quality(earlier: Channels, later: Channels, deformation: Deformation) -> RegistrationQuality:
    """Measure the quality of a deformation between two brains from their unsmoothed masks.

    Folding is measured in the earlier cerebrum, on the deformation's own grid.
    """
    grid = transform_points(np.indices(earlier.tissue.shape).reshape(3, -1).T, earlier.affine)
    places = transform_points(carry(deformation, grid), np.linalg.inv(later.affine)).T
    inside = earlier.tissue & CEREBRUM_BIT > 0
    with_cortex = earlier.cortex is not None and later.cortex is not None
    growth = determinants(deformation)
    index = transform_points(transform_points(np.argwhere(inside), earlier.affine), np.linalg.inv(deformation.affine))
    growth = map_coordinates(growth, index.T, order=1, mode="nearest")
    lengths = np.linalg.norm(deformation.displacement, axis=-1)
    rim = np.ones(lengths.shape, dtype=bool)
    rim[1:-1, 1:-1, 1:-1] = False
    return RegistrationQuality(
        dice_cerebrum=_dice(earlier, later, CEREBRUM_BIT, places),
        dice_cortex=_dice(earlier, later, CORTEX_BIT, places) if with_cortex else float("nan"),
        least_determinant=float(growth.min()),
        folded_share=float((growth <= 0).mean()),
        log_growth_sd=float(np.log(growth[growth > 0]).std()),
        volume_ratio=float(growth.mean()),
        rim_mm=float(np.quantile(lengths[rim], 0.95)),
        inside_mm=float(np.quantile(map_coordinates(lengths, index.T, order=1, mode="nearest"), 0.95)),
    )


def register_and_measure(
    earlier: Channels, later: Channels, *, is_filled: bool, smoothing: float = 1.0, threads: int = 1
) -> tuple[Registration, RegistrationQuality]:
    """Register two brains by `register` and measure the quality.

    If the cortex of one `is_filled` from surfaces, it may be far from that of labels, which are coarse or of another
    kind. If both overlap too little, the brains are registered without cortex, with a warning.
    """
    found = register(earlier, later, smoothing=smoothing, threads=threads)
    quality = measure_quality(earlier, later, found.deformation)
    if not (is_filled and quality.dice_cortex < MIN_DICE["cortex"]):
        return found, quality
    overlap = f"Dice {quality.dice_cortex:.2f}, expected {MIN_DICE['cortex']:.2f} or more"
    log.warning("the cortex filled from surfaces is not that of the labels (%s): registered without cortex", overlap)
    brains = [replace(brain, cortex=None) for brain in (earlier, later)]
    return register_and_measure(*brains, is_filled=False, smoothing=smoothing, threads=threads)


def require_good(quality: RegistrationQuality, *, pair: str, only_warn: bool = False) -> None:
    """Raise InputError, with all measures, if a registration of a named `pair` of brains must not be used.

    With `only_warn`, log a warning instead.
    """
    values = asdict(quality)
    faults = [
        f"Dice of the {mask} {values[f'dice_{mask}']:.3f} below {limit:g}"
        for mask, limit in MIN_DICE.items()
        if values[f"dice_{mask}"] < limit
    ]
    if quality.folded_share > MAX_FOLDED:
        faults.append(f"the map folds in {quality.folded_share:.2%} of the cerebrum, above {MAX_FOLDED:.2%}")
    if faults:
        numbers = ", ".join(f"{name} {value:.3g}" for name, value in values.items())
        error = InputError(
            f"the registration {pair} has failed: {'; '.join(faults)}",
            found=numbers,
            expected="two brains that differ by some weeks of growth",
            remedy="Look at both label volumes; leave out the one that does not fit, or use brains of closer weeks.",
        )
        if not only_warn:
            raise error
        log.warning("%s", error)


def _dice(earlier: Channels, later: Channels, bit: int, places: Floats) -> float:
    first = (earlier.tissue & bit > 0).ravel()
    second = map_coordinates((later.tissue & bit > 0).astype(np.float32), places, order=1) > 0.5
    return float(2 * np.count_nonzero(first & second) / max(np.count_nonzero(first) + np.count_nonzero(second), 1))
