"""How well the present mesh resolves the cortex, and what a user should know of it."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..geometry.tetrahedra import TetrahedralMesh, radius_ratios
from ..parameters.terms import ELEMENTS_NEEDED
from .domain import Domain

Floats = NDArray[np.float64]
EDGES = ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3))
WORST = 0.01
"""Part of the elements whose quality the step table tells."""
LARGEST_POISSON_RATIO = 0.46
"""Above this linear elements are clearly too stiff: at 0.45 the fastest wave of the slab grows 32 % too slowly with two
of them through the cortex, at 0.48 40 %, at 0.49 47 %, at 0.499 69 %, the peak elsewhere."""


def elements_through(domain: Domain, distance: Floats, thickness: float) -> float:
    """Returns a thickness below the pial surface in mean edges of the present elements in it; NaN where there are none.

    Parameters
    ----------
    distance : (k,) float
        Of the local nodes to the pial surface, in m as the thickness.
    """
    inside = domain.corners[distance[domain.corners].mean(axis=1) <= thickness]
    nodes = domain.local(domain.positions)
    lengths = sum(float(np.linalg.norm(nodes[inside[:, i]] - nodes[inside[:, j]], axis=1).sum()) for i, j in EDGES)
    total, count = domain.comm.allreduce(np.array([lengths, len(EDGES) * len(inside)]))
    return float(thickness * count / total) if count else math.nan


def worst_quality(domain: Domain) -> float:
    """Returns the radius ratio that all but the worst hundredth of the present elements are above."""
    ratios = radius_ratios(TetrahedralMesh(domain.local(domain.positions), domain.cells))
    return float(np.quantile(domain.gathered_cells(ratios[:, None]), WORST))


def stiffness_warning(poisson_ratio: float) -> str:
    """Returns what to say of a Poisson's ratio that linear elements are too stiff for; empty where they are not."""
    if poisson_ratio <= LARGEST_POISSON_RATIO:
        return ""
    return (
        f"folding.poisson_ratio {poisson_ratio:g} is nearer to incompressible than linear elements follow: above "
        f"{LARGEST_POISSON_RATIO:g} they lock, and folds grow too slowly and at wrong lengths (docs/verification.md)"
    )


def resolution_warning(rows: Sequence[dict], order: int) -> str:
    """Returns what to say where the cortex has just come to be resolved too coarsely; empty where it has not."""
    # not a number where no element has its centre in the cortex: none lies through it
    found = [0.0 if math.isnan(row["elements_through_cortex"]) else row["elements_through_cortex"] for row in rows[-2:]]
    now, before = found[-1], found[0] if len(found) > 1 else math.inf
    if not now < ELEMENTS_NEEDED[order] <= before:
        return ""
    return (
        f"from GW {rows[-1]['week']:.2f} on fewer than {ELEMENTS_NEEDED[order]:g} elements lie through the cortex, "
        "since it grows: folds may be mesh noise; "
        "a smaller mesh.surface_edge_mm, or mesh.sized_for: end, resolves it to a later week"
    )


def unconverged_warning(row: dict) -> str:
    """Returns what to say of a step that ended above the tolerance; empty of others."""
    if row["converged"]:
        return ""
    return (
        f"step {row['step']} ends at {row['residual']:.1e} of its first residual, above "
        "folding.solver.newton_tolerance: nothing was left to gain but round-off"
    )
