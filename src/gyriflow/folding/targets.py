"""Growth towards known shapes: in each step the growth that takes the brain towards its next target.

This is growth by inversion (as in Z. Wang et al. 2021): the map of growth is the result, and mechanics shows whether
such growth is possible. Growth that smoothing and mechanics prevent in a step is made up for in the next ones.
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
"""Standard deviation of the spatial smoothing of growth."""
SMOOTHING_TOL = 1e-3
"""Relative tolerance of smoothing; the next step makes up for the error."""
WEEK_TOL_GW = 1e-6
"""Time before a target at which it counts as reached."""


@dataclass(frozen=True, eq=False)
class TargetGrowth(StepGrowth):
    """Growth of a step towards a shape.

    `strain` (6, n) is ln G at all vertices, `misfit_mm` the root mean square distance to the target at the start of the
    step, without rigid motion.
    """

    strain: Floats
    misfit_mm: float

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
        return super().row(after) | {"to_target_mm": self.misfit_mm}


@dataclass(frozen=True, eq=False)
class GrowthToTargets:
    """The model of growth towards shapes of the whole mesh at later weeks.

    The run's maps contain the shapes, in any pose; `stretches` are those of the moving mesh.
    """

    parameters: FoldingParameters
    inputs: GrowthInputs
    stretches: Stretches

    @classmethod
    def of(cls, p: FoldingParameters, inputs: GrowthInputs, share: Share) -> "GrowthToTargets":
        """Return the model of a run whose maps contain the targets that its parameters name."""
        if (last := max(p.targets)) < p.end_week - WEEK_TOL_GW:
            raise InputError(
                "the target shapes of the run end before it does",
                found=f"shapes up to {last:g} GW and a run to {p.end_week:g} GW",
                remedy="End the run earlier, or add brains of later weeks.",
            )
        return cls(p, inputs, Stretches(inputs.pieces, len(inputs.zones.growth), share))

    def growth(self, start: StepStart) -> StepGrowth:
        """Return the growth of a step: its share of the misfit to the next target.

        A step that crosses a target goes on towards the next one.
        """
        week, end, positions = start.week(self.parameters, 0.0), start.week(self.parameters, 1.0), start.positions_mm
        sizes = vertex_sizes(positions, self.inputs.pieces)
        targets = self.parameters.targets

        def aligned(target: float, fixed: Floats) -> Floats:
            shape = np.stack([self.inputs.maps[f"{targets[target]}_{axis}"] for axis in AXES], axis=1)
            return transform_points(shape, rigid_fit(shape, fixed, sizes))

        later = sorted(target for target in targets if target > week + WEEK_TOL_GW) or [max(targets)]
        misfit = aligned(later[0], positions) - positions
        reached, reached_week = positions, week
        while len(later) > 1 and later[0] < end - WEEK_TOL_GW:
            reached_week = later.pop(0)
            reached = aligned(reached_week, positions)
        part = min(1.0, (end - reached_week) / max(later[0] - reached_week, WEEK_TOL_GW))
        goal = reached + part * (aligned(later[0], reached) - reached)
        strain = log_growth(positions, self.stretches, goal - positions, SMOOTHING_MM)
        misfit_mm = float(np.sqrt(np.average((misfit**2).sum(axis=1), weights=sizes)))
        growing = self.inputs.zones.growth[:, None]
        return TargetGrowth(self.parameters, start, (strain * growing).T, misfit_mm)


def log_growth(positions: Floats, stretches: Stretches, displacement: Floats, smoothing_mm: float) -> Floats:
    """Return the (n, 6) Hencky strain ln U of a displacement at the vertices, smoothed: xx yy zz xy xz yz.

    Positions and displacement are (n, 3) in mm. Ranks divide first the elements among them, then the six components.
    """
    sums, sizes, stiffness = stretches.compute(positions, displacement)
    sizes = np.where(sizes > 0, sizes, 1.0)[:, None]
    if smoothing_mm == 0:
        return sums / sizes
    # as `diffuse`, but in one implicit step, which has longer tails than a Gaussian
    matrix = sparse.csr_matrix(sparse.diags(sizes[:, 0]) + smoothing_mm**2 / 2 * stiffness)
    smooth, columns = np.zeros_like(sums), stretches.share.of(6)
    smooth[:, columns] = conjugate_gradients(matrix, sums[:, columns], (sums / sizes)[:, columns], SMOOTHING_TOL)
    return stretches.share.summed(smooth)


def inverse_exponential(logs: Floats) -> Floats:
    """Return exp(−L) of small (..., 3, 3) matrices to fourth order in L: to 1e-7 for growth of a tenth."""
    result = np.eye(3) - logs / 4
    for order in (3, 2, 1):
        result = np.eye(3) - logs @ result / order
    return result
