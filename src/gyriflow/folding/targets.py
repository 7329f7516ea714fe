"""Growth towards known shapes: in each step the growth that keeps the brain on a path through its targets.

This is growth by inversion (as in Z. Wang et al. 2021): the map of growth is the result, and mechanics shows whether
such growth is possible. docs/model.md has the equations. The path X*(t) is smooth in time, and the growth of a step is
the smoothed stretch of its velocity plus feedback with a time constant, which corrects the misfit that smoothing and
mechanics leave. So growth and stress converge as the time step tends to zero.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from scipy import sparse
from scipy.interpolate import CubicHermiteSpline
from scipy.spatial import cKDTree

from ..errors import InputError
from ..geometry.alignment import rigid_fit
from ..geometry.deformations import transform_points
from ..geometry.diffusion import Share, conjugate_gradients, vertex_sizes
from ..geometry.jacobians import chunks
from ..geometry.tetrahedra import volumes_between
from ..geometry.triangles import Ints
from ..settings.folding import AXES, FoldingParameters
from ..settings.varying import Maps
from .growth import Floats, GrowthInputs, Size, StepGrowth, StepStart
from .stress import packed, unpacked
from .stretches import Stretches
from .tissue import Tissue

SMOOTHING_MM = 0.4
"""Standard deviation of the spatial smoothing of growth."""
SMOOTHING_TOL = 1e-3
"""Relative tolerance of smoothing; feedback makes up for the error."""
FEEDBACK_GW = 0.2
"""Time constant with which growth takes the brain back to its path."""
PARTS_OF_PATH = (0.25, 0.5, 0.75)
"""Fractions of the path between two shapes at which it is checked."""
STRAIGHTENING_ROUNDS = 2
STRAIGHT_MM = 5.0
"""Distance from an element that would be inverted within which the path is straight (Gaussian)."""
WEEK_TOL_GW = 1e-6
"""Time before a target at which it counts as reached."""


@dataclass(frozen=True, eq=False)
class TargetGrowth(StepGrowth):
    """Growth of a step towards a shape.

    `strain` (6, n) is ln G at all vertices, `misfit_mm` the root mean square distance to the path at the start of the
    step, without rigid motion.
    """

    strain: Floats
    misfit_mm: float
    stretches: Stretches

    def inverse(self, tissue: Tissue) -> Floats:
        elements = tissue.elements
        inverse = np.empty((len(elements.cells), len(elements.points.weights), 3, 3))
        for chunk in chunks(len(inverse)):
            logs = tissue.interpolate(self.strain, chunk)
            inverse[chunk] = inverse_exponential(unpacked(np.moveaxis(logs, 0, -1)))
        return inverse

    def logarithm(self) -> Floats:
        return self.strain

    def added_to(self, log_growth: Floats | None, displacement_mm: Floats) -> Floats:
        total = self.strain if log_growth is None else log_growth + self.strain
        turn = self.stretches.rotations(self.start.positions_mm, displacement_mm).as_matrix()
        return packed(turn @ unpacked(total.T) @ np.swapaxes(turn, 1, 2)).T

    def row(self, after: Size) -> dict[str, Any]:
        return super().row(after) | {"to_path_mm": self.misfit_mm}


@dataclass(frozen=True, eq=False)
class GrowthToTargets:
    """The model of growth along a path through shapes of the whole mesh at later weeks.

    The run's maps contain the shapes, in any pose; `path` leads through them, from the start. `stretches` are those of
    the moving mesh.
    """

    parameters: FoldingParameters
    inputs: GrowthInputs
    path: CubicHermiteSpline
    stretches: Stretches

    @classmethod
    def of(cls, p: FoldingParameters, inputs: GrowthInputs, positions_mm: Floats, share: Share) -> "GrowthToTargets":
        """Return the model of a run from (n, 3) positions; its maps contain the targets that its parameters name."""
        if (last := max(p.targets)) < p.end_week - WEEK_TOL_GW:
            raise InputError(
                "the target shapes of the run end before it does",
                found=f"shapes up to {last:g} GW and a run to {p.end_week:g} GW",
                remedy="End the run earlier, or add brains of later weeks.",
            )
        path = path_through(*shapes_of_run(p, inputs.maps, positions_mm), inputs.pieces)
        return cls(p, inputs, path, Stretches(inputs.pieces, len(inputs.zones.growth), share))

    def growth(self, start: StepStart) -> StepGrowth:
        """Return the growth of a step: that of the path, and of the part of the misfit that feedback makes up for."""
        p, positions = self.parameters, start.positions_mm
        week, end = (min(start.week(p, part), float(self.path.x[-1])) for part in (0.0, 1.0))
        sizes = vertex_sizes(positions, self.inputs.pieces)
        motion = rigid_fit(self.path(week), positions, sizes)
        now, later = (transform_points(self.path(at), motion) for at in (week, end))
        misfit = now - positions
        goal = later - np.exp(-(end - week) / FEEDBACK_GW) * misfit
        strain = log_growth(positions, self.stretches, goal - positions, SMOOTHING_MM)
        misfit_mm = float(np.sqrt(np.average((misfit**2).sum(axis=1), weights=sizes)))
        growing = self.inputs.zones.growth[:, None]
        return TargetGrowth(p, start, (strain * growing).T, misfit_mm, self.stretches)


def shapes_of_run(p: FoldingParameters, maps: Maps, positions_mm: Floats) -> tuple[list[float], list[Floats]]:
    """Return the ascending weeks and (n, 3) shapes in mm of a run: that at its start, and the targets in its maps."""
    weeks = sorted(week for week in p.targets if week > p.start_week + WEEK_TOL_GW)
    targets = [np.stack([maps[f"{p.targets[week]}_{axis}"] for axis in AXES], axis=1) for week in weeks]
    return [p.start_week, *weeks], [positions_mm, *targets]


def path_through(weeks: Sequence[float], shapes: Sequence[Floats], pieces: Ints) -> CubicHermiteSpline:
    """Return a path through (n, 3) shapes of tetrahedra `pieces` (p, 4) in mm at ascending weeks, by the week.

    Each shape is first aligned rigidly to the one before. The velocity is continuous: at each week that of the parabola
    through this shape and its neighbours, at the ends the mean velocity to the neighbour. Around an element that would
    be inverted on the way, the path is straight from shape to shape instead, at rest in both weeks.
    """
    sizes = vertex_sizes(shapes[0], pieces)
    aligned = [shapes[0]]
    for shape in shapes[1:]:
        aligned.append(transform_points(shape, rigid_fit(shape, aligned[-1], sizes)))
    places = np.stack(aligned)
    velocities = np.gradient(places, weeks, axis=0)
    # a change at one week affects the intervals on both sides of it
    for number, (week, later) in [*enumerate(pairwise(weeks))] * STRAIGHTENING_ROUNDS:
        path = CubicHermiteSpline([week, later], places[number : number + 2], velocities[number : number + 2])
        on_way = (path((1 - part) * week + part * later) for part in PARTS_OF_PATH)
        inverted = np.concatenate([pieces[volumes_between(at, pieces) <= 0] for at in on_way])
        if len(inverted):
            distance, _ = cKDTree(places[number][inverted].mean(axis=1)).query(places[number])
            velocities[number : number + 2] *= 1 - np.exp(-((distance / STRAIGHT_MM) ** 2))[:, None]
    return CubicHermiteSpline(weeks, places, velocities)


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
