"""Growth towards known shapes: in each step, what takes the brain from where it is to where it should be.

This is growth by inversion (as in Z. Wang et al. 2021): the map of growth is the result, and mechanics tells whether
such growth is possible. What smoothing and mechanics leave undone in a step, the next ones make up for.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse

from ..errors import InputError
from ..geometry.alignment import rigid_fit
from ..geometry.deformations import transform_points
from ..geometry.diffusion import MovingStiffness, Share, conjugate_gradients, vertex_sizes
from ..geometry.jacobians import chunks
from ..geometry.tetrahedra import gradients
from ..parameters.folding import AXES, FoldingParameters
from .growth import Floats, Growth, GrowthInputs, Size, StepStart
from .layers import Tissue
from .stress import packed, unpacked

MOST_STRAIN = 0.3
"""Largest logarithmic growth in any direction in a step: more belongs to elements that the target folds over."""
SMALL = 0.12
"""Largest entry of FᵀF − 1 for which the logarithm is taken by its series."""
SMOOTHING_MM = 1.5
"""Standard deviation that growth is smoothed with in space."""
SMOOTHED_TO = 1e-3
"""Relative tolerance of smoothing; the next step makes up for what is left."""
SOON_GW = 1e-6
"""Time before which a target is taken to be reached."""


@dataclass(frozen=True, eq=False)
class TargetGrowth(Growth):
    """Growth of a step towards a shape.

    `strain` (6, n) is the logarithm of G at all vertices, `away_mm` the root mean square distance from the shape at the
    step's start, without rigid motion.
    """

    strain: Floats
    away_mm: float

    def inverse(self, tissue: Tissue) -> Floats:
        inverse = np.empty((len(tissue.cells), len(tissue.points.weights), 3, 3))
        for chunk in chunks(len(inverse)):
            logs = tissue.from_vertices(self.strain, chunk)
            inverse[chunk] = inverse_exponential(unpacked(np.moveaxis(logs, 0, -1)))
        return inverse

    def logarithm(self) -> Floats:
        return self.strain

    def row(self, after: Size) -> dict[str, Any]:
        return super().row(after) | {"to_target_mm": self.away_mm}


@dataclass(frozen=True, eq=False)
class GrowthToTargets:
    """The model of growth towards shapes of the whole mesh at later weeks.

    The run's maps hold the shapes, of which the pose does not count; growth is smoothed with `stiffness`.
    """

    parameters: FoldingParameters
    inputs: GrowthInputs
    stiffness: MovingStiffness

    @classmethod
    def of(cls, p: FoldingParameters, inputs: GrowthInputs, share: Share) -> "GrowthToTargets":
        """Return the model of a run whose maps hold the targets that its parameters name."""
        if (last := max(p.targets)) < p.end_week - SOON_GW:
            raise InputError(
                "the shapes that the run grows towards end before it does",
                found=f"shapes up to {last:g} GW and a run to {p.end_week:g} GW",
                remedy="End the run earlier, or add brains of later weeks.",
            )
        return cls(p, inputs, MovingStiffness(inputs.pieces, len(inputs.zones.growth), share))

    def growth(self, start: StepStart) -> Growth:
        """Return the growth of a step: its part of what is left to the next target.

        A step across a target leads to the shape between it and the one after it.
        """
        week, end, places = start.week(self.parameters, 0.0), start.week(self.parameters, 1.0), start.positions_mm
        sizes = vertex_sizes(places, self.inputs.pieces)

        targets = self.parameters.targets

        def laid(week: float, onto: Floats) -> Floats:
            shape = np.stack([self.inputs.maps[f"{targets[week]}_{axis}"] for axis in AXES], axis=1)
            return transform_points(shape, rigid_fit(shape, onto, sizes))

        ahead = sorted(target for target in targets if target > week + SOON_GW) or [max(targets)]
        missing = laid(ahead[0], places) - places
        before, since = places, week
        while len(ahead) > 1 and ahead[0] < end - SOON_GW:
            since = ahead.pop(0)
            before = laid(since, places)
        part = min(1.0, (end - since) / max(ahead[0] - since, SOON_GW))
        aim = before + part * (laid(ahead[0], before) - before)
        strain = log_growth(places, self.stiffness, aim - places, SMOOTHING_MM)
        away = float(np.sqrt(np.average((missing**2).sum(axis=1), weights=sizes)))
        growing = self.inputs.zones.growth[:, None]
        return TargetGrowth(self.parameters, start, (strain * growing).T, away)


def log_growth(positions: Floats, stiffness: MovingStiffness, displacement: Floats, smoothing_mm: float) -> Floats:
    """Return the (n, 6) logarithm ln U of the stretch of a displacement at the vertices, smoothed: xx yy zz xy xz yz.

    Positions and displacement are (n, 3) in mm. Ranks share elements, then components, as `stiffness` is shared.
    """
    tets, share = stiffness.tets, stiffness.share
    # the last of the seven is the size
    after, parts = positions + displacement, np.empty((len(tets), 7))
    for chunk in chunks(len(tets)):
        corners = tets[chunk]
        slopes, volumes = gradients(positions, corners)
        edges = np.swapaxes(after[corners[:, 1:]] - after[corners[:, :1]], 1, 2)
        parts[chunk, :6], parts[chunk, 6] = packed(log_stretch(edges @ slopes)), 1.0
        parts[chunk] *= (volumes / 4)[:, None]
    sums = [np.bincount(tets.ravel(), np.repeat(part, 4), minlength=len(positions)) for part in parts.T]
    means = share.summed(np.stack(sums, axis=1))
    means, sizes = means[:, :6], np.where(means[:, 6:] > 0, means[:, 6:], 1.0)
    if smoothing_mm == 0:
        return means / sizes
    # as `diffuse` does, but in one step, whose tails are longer than a Gaussian's
    matrix = sparse.csr_matrix(sparse.diags(sizes[:, 0]) + smoothing_mm**2 / 2 * stiffness.at(positions))
    smooth, columns = np.zeros_like(means), share.of(6)
    smooth[:, columns] = conjugate_gradients(matrix, means[:, columns], (means / sizes)[:, columns], SMOOTHED_TO)
    return share.summed(smooth)


def log_stretch(F: Floats) -> Floats:
    """Return the (m, 3, 3) logarithms ln U of the right stretch of (m, 3, 3) gradients, none above `MOST_STRAIN`.

    Where all of FᵀF − 1 is below `SMALL`, six terms of the series of ln(1 + x) give it to 3e-8.
    """
    squares = np.swapaxes(F, 1, 2) @ F
    x = squares - np.eye(3)
    series = np.eye(3) / 6
    for order in range(5, 0, -1):
        series = np.eye(3) / order - x @ series
    logs = 0.5 * (x @ series)
    large = np.abs(x).max(axis=(1, 2)) > SMALL
    values, axes = np.linalg.eigh(squares[large])
    stretches = np.clip(0.5 * np.log(np.maximum(values, 1e-12)), -MOST_STRAIN, MOST_STRAIN)
    logs[large] = (axes * stretches[:, None, :]) @ np.swapaxes(axes, 1, 2)
    return np.asarray(logs)


def inverse_exponential(logs: Floats) -> Floats:
    """Return exp(−L) of small (..., 3, 3) matrices to fourth order in L: to 1e-7 for growth of a tenth."""
    result = np.eye(3) - logs / 4
    for order in (3, 2, 1):
        result = np.eye(3) - logs @ result / order
    return result
