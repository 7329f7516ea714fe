"""Growth towards known shapes: in each step the growth that keeps the brain on a path
through its targets.

This is growth by inversion (as in Z. Wang et al. 2021): the map of growth is the
result. docs/model.md has the equations. Each element takes the stretch of its own way
along the path X*(t), so that growth is compatible: a body that touches nothing follows
the path without stress. Feedback with a time constant corrects the misfit that contact
leaves.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..errors import InputError
from ..geometry.alignment import rigid_fit
from ..geometry.deformations import transform_points
from ..geometry.diffusion import smooth_integrals, vertex_sizes
from ..geometry.jacobians import determinants
from ..geometry.paths import Path, path_through
from ..geometry.tetrahedra import has_volume, volumes_between
from ..geometry.triangles import Mask
from ..grouping import counted
from ..settings.folding import AXES, FoldingParameters
from ..units import M_PER_MM, SECONDS_PER_GW
from .growth import Floats, GrowthInputs, Size, StepGrowth, StepStart
from .stretches import deformation_gradients, inverse_growth
from .tissue import Elements, Tissue

FEEDBACK_GW = 0.2
"""Time constant with which growth takes the brain back to its path."""
FEEDBACK_SMOOTHING_MM = 1.0
"""Length over which that feedback is smoothed: next to folds that press on each other
the misfit is rough."""
FEEDBACK_FROM_MM = 1e-4
"""Misfit (root mean square) below which feedback is off: that of the solver's
tolerance."""
DAY_S = 86_400.0
MAX_LOG_STRETCH = 0.7
"""Largest principal Hencky strain of an element's growth in a step: to half or twice
its length."""
MAX_SHRINKAGE_PER_DAY = 0.1
"""Loss of an element's volume in a day above which it is reported: so fast is error of
the registration, not tissue."""
MAX_MISFIT_MM = 0.2
"""Misfit (root mean square) above which a run is warned of: about that of surfaces
extracted from labels."""
WEEK_TOL_GW = 1e-6
"""Time before a target at which it counts as reached."""


@dataclass(frozen=True, eq=False)
class TargetGrowth(StepGrowth):
    """Growth of a step towards a shape: the stretch U of each element on its way to
    `goal_mm` (n, 3).

    `misfit_mm` is the root mean square distance to the path at the start of the step,
    without rigid motion. Elements whose stretch is beyond `MAX_LOG_STRETCH` grow by
    that, and those that the goal inverts do not grow; `inverse` counts both as `held`,
    with `total` over the ranks, and as `shrinking` those that lose more than
    `MAX_SHRINKAGE_PER_DAY`.
    """

    goal_mm: Floats
    misfit_mm: float
    total: Callable[[int], int]
    held: list[int] = field(default_factory=list)
    shrinking: list[int] = field(default_factory=list)
    # computed once: the step's growth and the growth of all steps need it
    _deformations: dict[Elements, Floats] = field(default_factory=dict, init=False)

    def inverse(self, tissue: Tissue) -> Floats:
        is_valid, ratios = self._volume_ratios(tissue.elements)
        least = 1 - MAX_SHRINKAGE_PER_DAY * self.start.step_s / DAY_S
        is_shrinking = (ratios > 0) & (ratios < least)
        self.shrinking.append(self.total(int(is_shrinking.sum())))
        growing = np.where(
            is_valid[:, None],
            tissue.at_points(tissue.growing),
            0.0,
        )
        inverse, is_limited = inverse_growth(
            self.deformation(tissue.elements), growing, MAX_LOG_STRETCH
        )
        is_held = ~is_valid | is_limited.any(axis=1)
        self.held.append(self.total(int(is_held.sum())))
        return inverse

    def _volume_ratios(self, elements: Elements) -> tuple[Mask, Floats]:
        """Return whether elements are valid at the goal, and by how much their volume
        changes, (c,)."""
        if elements.points.order == 1:
            ratios = determinants(self.deformation(elements)[:, 0])
            return ratios > 0, ratios
        goal = self.goal_mm[elements.vertices]
        start = self.start.positions_mm[elements.vertices]
        cells = elements.cells
        ratios = volumes_between(goal, cells) / volumes_between(start, cells)
        return has_volume(goal, cells), ratios

    def deformation(self, elements: Elements) -> Floats:
        if elements not in self._deformations:
            self._deformations[elements] = deformation_gradients(
                self.start.positions_mm[elements.vertices],
                self.goal_mm[elements.vertices],
                elements.cells,
                elements.points.gradients,
            )
        return self._deformations[elements]

    def guess(self, fixed: Mask) -> Floats:
        return np.where(
            fixed,
            0.0,
            (self.goal_mm - self.start.positions_mm) * M_PER_MM,
        )

    def row(self, after: Size) -> dict[str, Any]:
        counts = {
            "held_elements": self.held[-1],
            "shrinking_elements": self.shrinking[-1],
        }
        return super().row(after) | {"to_path_mm": self.misfit_mm} | counts


def path_of_run(p: FoldingParameters, inputs: GrowthInputs) -> Path:
    """Return the path of a run from its start mesh through the targets, in any pose,
    that its maps contain.

    InputError if the targets end before the run does.
    """
    last = max(p.targets)
    if last < p.end_week - WEEK_TOL_GW:
        raise InputError(
            "the target shapes of the run end before it does",
            found=f"shapes up to {last:g} GW and a run to {p.end_week:g} GW",
            remedy="End the run earlier, or add brains of later weeks.",
        )
    weeks = [p.start_week]
    shapes = [inputs.mesh.vertices]
    for week, name in sorted(p.targets.items()):
        if week > p.start_week + WEEK_TOL_GW:
            places = [inputs.maps[f"{name}_{axis}"] for axis in AXES]
            weeks.append(week)
            shapes.append(np.stack(places, axis=1))
    return path_through(
        weeks,
        shapes,
        inputs.mesh,
        p.step_s / SECONDS_PER_GW,
        p.stops,
    )


def growth_on_path(
    p: FoldingParameters,
    inputs: GrowthInputs,
    path: Path,
    start: StepStart,
) -> TargetGrowth:
    """Return the growth of a step: that of the path, and of the part of the misfit that
    feedback makes up for."""
    positions = start.positions_mm
    last_week = float(path.weeks[-1])
    week = min(start.week(p, 0.0), last_week)
    end_week = min(start.week(p, 1.0), last_week)
    sizes = vertex_sizes(positions, inputs.pieces)
    motion = rigid_fit(path(week), positions, sizes)
    misfit = transform_points(path(week), motion) - positions
    squares = (misfit**2).sum(axis=1)
    misfit_mm = float(np.sqrt(np.average(squares, weights=sizes)))
    goal = transform_points(path(end_week), motion) - misfit
    if misfit_mm > FEEDBACK_FROM_MM:
        share = 1 - np.exp((week - end_week) / FEEDBACK_GW)
        integrals = sizes[:, None] * (share * misfit)
        goal += smooth_integrals(
            positions, inputs.pieces, integrals, FEEDBACK_SMOOTHING_MM
        )
    return TargetGrowth(p, start, goal, misfit_mm, inputs.total)


def missed_targets(rows: Sequence[dict[str, Any]]) -> list[str]:
    """Return warnings if the steps since the last output week did not follow their
    path."""
    if not rows or "to_path_mm" not in rows[-1]:
        return []
    last = rows[-1]
    warnings = []
    if last["to_path_mm"] > MAX_MISFIT_MM:
        distance = f"{last['to_path_mm']:.2f} mm from its target shape"
        warnings.append(
            f"at GW {last['week']:g} the brain is {distance} (root mean square):"
            " contact or stiffness prevents the growth"
        )
    n_held = max(row["held_elements"] for row in rows)
    if n_held:
        warnings.append(
            f"up to GW {last['week']:g} the path would bend or invert at most"
            f" {counted(n_held, 'element')} in a step: growth there is less"
        )
    return warnings


def shrinkage_note(rows: Sequence[dict[str, Any]]) -> str:
    """Return a note if elements shrank faster than tissue can in any of the steps, else
    an empty text."""
    shrinking = max((row.get("shrinking_elements", 0) for row in rows), default=0)
    if not shrinking:
        return ""
    least = min(row["min_J"] for row in rows)
    return (
        f"up to {shrinking} elements lose more than {MAX_SHRINKAGE_PER_DAY:.0%} of"
        f" their volume in a day (least det F of a step {least:.2f}): an error of the"
        " registration, not of tissue"
    )
