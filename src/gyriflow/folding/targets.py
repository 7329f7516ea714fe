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
from ..geometry.diffusion import Share, conjugate_gradients, vertex_sizes
from ..geometry.jacobians import chunks
from ..settings.folding import AXES, FoldingParameters
from .growth import Floats, GrowthInputs, Size, StepGrowth, StepStart
from .stress import unpacked
from .stretches import Stretches
from .tissue import Tissue

SMOOTHING_MM = 1.5
"""Standard deviation that growth is smoothed with in space."""
SMOOTHED_TO = 1e-3
"""Relative tolerance of smoothing; the next step makes up for what is left."""
SOON_GW = 1e-6
"""Time before which a target is taken to be reached."""


@dataclass(frozen=True, eq=False)
class TargetGrowth(StepGrowth):
    """Growth of a step towards a shape.

    `strain` (6, n) is the logarithm of G at all vertices, `away_mm` the root mean square distance from the shape at the
    step's start, without rigid motion.
    """

    strain: Floats
    away_mm: float

    def inverse(self, tissue: Tissue) -> Floats:
        elements = tissue.elements
        inverse = np.empty((len(elements.cells), len(elements.points.weights), 3, 3))
        for chunk in chunks(len(inverse)):
            logs = tissue.interpolate(self.strain, chunk)
            inverse[chunk] = inverse_exponential(unpacked(np.moveaxis(logs, 0, -1)))
        return inverse

    def logarithm(self) -> Floats:
        return self.strain

    def row(self, after: Size) -> dict[str, Any]:
        return super().row(after) | {"to_target_mm": self.away_mm}


@dataclass(frozen=True, eq=False)
class GrowthToTargets:
    """The model of growth towards shapes of the whole mesh at later weeks.

    The run's maps hold the shapes, of which the pose does not count; `stretches` are those of the moving mesh.
    """

    parameters: FoldingParameters
    inputs: GrowthInputs
    stretches: Stretches

    @classmethod
    def of(cls, p: FoldingParameters, inputs: GrowthInputs, share: Share) -> "GrowthToTargets":
        """Return the model of a run whose maps hold the targets that its parameters name."""
        if (last := max(p.targets)) < p.end_week - SOON_GW:
            raise InputError(
                "the shapes that the run grows towards end before it does",
                found=f"shapes up to {last:g} GW and a run to {p.end_week:g} GW",
                remedy="End the run earlier, or add brains of later weeks.",
            )
        return cls(p, inputs, Stretches(inputs.pieces, len(inputs.zones.growth), share))

    def growth(self, start: StepStart) -> StepGrowth:
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
        strain = log_growth(places, self.stretches, aim - places, SMOOTHING_MM)
        away = float(np.sqrt(np.average((missing**2).sum(axis=1), weights=sizes)))
        growing = self.inputs.zones.growth[:, None]
        return TargetGrowth(self.parameters, start, (strain * growing).T, away)


def log_growth(positions: Floats, stretches: Stretches, displacement: Floats, smoothing_mm: float) -> Floats:
    """Return the (n, 6) logarithm ln U of the stretch of a displacement at the vertices, smoothed: xx yy zz xy xz yz.

    Positions and displacement are (n, 3) in mm. Ranks share elements, then components, as `stretches` are shared.
    """
    sums, sizes, stiffness = stretches.of(positions, displacement)
    sizes = np.where(sizes > 0, sizes, 1.0)[:, None]
    if smoothing_mm == 0:
        return sums / sizes
    # as `diffuse` does, but in one step, whose tails are longer than a Gaussian's
    matrix = sparse.csr_matrix(sparse.diags(sizes[:, 0]) + smoothing_mm**2 / 2 * stiffness)
    smooth, columns = np.zeros_like(sums), stretches.share.of(6)
    smooth[:, columns] = conjugate_gradients(matrix, sums[:, columns], (sums / sizes)[:, columns], SMOOTHED_TO)
    return stretches.share.summed(smooth)


def inverse_exponential(logs: Floats) -> Floats:
    """Return exp(−L) of small (..., 3, 3) matrices to fourth order in L: to 1e-7 for growth of a tenth."""
    result = np.eye(3) - logs / 4
    for order in (3, 2, 1):
        result = np.eye(3) - logs @ result / order
    return result
